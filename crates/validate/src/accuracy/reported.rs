//! What the report of the conversion says of a dataset.

use serde_json::Value;

use super::figures::{Merged, PositionErrors};

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

impl Reported {
    pub(super) fn new(accuracy: &Value) -> Self {
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
