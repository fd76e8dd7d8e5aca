//! What the report of the conversion says of a dataset.

use std::fs;
use std::path::Path;

use pointmill_format::DatasetKind;
use serde_json::Value;

use super::figures::{Merged, PositionErrors};

const REPORT_FILE: &str = "report.json";

/// The accuracy that the report states.
#[derive(Debug, Default)]
pub(super) struct Reported {
    pub(super) lattice: Option<Figures>,
    pub(super) format: Option<Figures>,
    pub(super) total: Option<Figures>,
    pub(super) points: Option<u64>,
    pub(super) same: Option<u64>,
    pub(super) merged: Merged,
    /// Totals in metres, if they are stated.
    pub(super) metres: Option<Figures>,
}

/// Figures, and where they come from.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Figures {
    pub(super) errors: PositionErrors,
    /// No error is larger, but it need not be attained.
    pub(super) is_bound: bool,
    /// It is said to be the rounding of doubles.
    pub(super) is_rounding: bool,
}

/// The statement on the dataset at `path`, from the report beside it or in the folder above.
pub(super) fn find(path: &Path, kind: DatasetKind) -> Option<Reported> {
    let folder = if path.is_dir() { path } else { path.parent()? };
    let beside = || output_of(folder, |output| output["folder"] == "" && is_of(output, kind));
    let above = || {
        let name = folder.file_name()?.to_str()?;
        output_of(folder.parent()?, |output| output["folder"] == name && is_of(output, kind))
    };
    let output = beside().or_else(above)?;
    output.get("accuracy").map(Reported::new)
}

fn is_of(output: &Value, kind: DatasetKind) -> bool {
    output["format"] == kind.name()
}

/// The first output of the report in `folder` that is the one.
fn output_of(folder: &Path, is_it: impl Fn(&Value) -> bool) -> Option<Value> {
    let bytes = fs::read(folder.join(REPORT_FILE)).ok()?;
    let report: Value = serde_json::from_slice(&bytes).ok()?;
    report["outputs"].as_array()?.iter().find(|output| is_it(output)).cloned()
}

impl Reported {
    fn new(accuracy: &Value) -> Self {
        let figures = |key: &str| Figures::new(&accuracy[key]);
        Self {
            lattice: figures("lattice"),
            format: figures("format"),
            total: figures("total"),
            points: accuracy["integers"]["points"].as_u64(),
            same: accuracy["integers"]["same"].as_u64(),
            merged: Merged {
                lattice: accuracy["merged"]["lattice"].as_u64(),
                format: accuracy["merged"]["format"].as_u64(),
            },
            metres: Figures::new(&accuracy["metres"]["total"]),
        }
    }
}

impl Figures {
    fn new(value: &Value) -> Option<Self> {
        let vector = |key: &str| -> Option<[f64; 3]> {
            let numbers: Option<Vec<f64>> = value[key].as_array()?.iter().map(Value::as_f64).collect();
            numbers?.try_into().ok()
        };
        let errors = PositionErrors {
            max: vector("max")?,
            max_3d: value["max_3d"].as_f64()?,
            rms: vector("rms")?,
            rms_3d: value["rms_3d"].as_f64()?,
            mean: vector("mean")?,
        };
        let is_rounding = value["how"] == "rounding";
        Some(Self { errors, is_bound: is_rounding || value["how"] == "bound", is_rounding })
    }
}
