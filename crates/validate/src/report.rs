//! `report.json` of a conversion, held against what is there.
//!
//! The report lies beside a dataset, or in the folder above where one conversion has made several, each in the folder that
//! the report names. It is read piece by piece: it may list many inputs, which are passed over.

use std::fs;
use std::io::{self, BufReader, Read as _};
use std::path::{Component, Path, PathBuf};

use pointmill_format::bytes::open_file;
use pointmill_format::{DatasetKind, Located, ReadError, json_fault, locate, system_reason};
use serde::Deserialize;
use serde_json::Value;

use crate::check::Check;
use crate::finding::{Finding, Findings};

const REPORT_FILE: &str = "report.json";

/// More than the longest report: 10⁶ inputs of 1 KB.
const MAX_BYTES: u64 = 1 << 30;

#[derive(Deserialize)]
struct Report {
    /// Not there in reports of other programs.
    outputs: Option<Vec<Reported>>,
    /// What was asked of the conversion, under either name.
    #[serde(default)]
    settings: Value,
    #[serde(default)]
    options: Value,
    #[serde(default)]
    derived: Value,
}

impl Report {
    /// What it states of datasets; `None` if it is that of another program.
    fn outputs(self) -> Option<Vec<Reported>> {
        let mut outputs = self.outputs?;
        let mut settings = [&self.settings, &self.options].map(|asked| &asked["derive"]).into_iter();
        if let Some(settings) = settings.find(|settings| !settings.is_null()) {
            let derive = Derive { settings: settings.clone(), counts: self.derived };
            outputs.iter_mut().for_each(|output| output.derive = Some(derive.clone()));
        }
        Some(outputs)
    }
}

/// What the report states of attributes that the conversion has computed, of all datasets that it made.
#[derive(Debug, Clone)]
pub(crate) struct Derive {
    /// How they were computed.
    pub(crate) settings: Value,
    /// How many points are without one, null if that is not stated.
    pub(crate) counts: Value,
}

/// An attribute that is not in a dataset.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Dropped {
    pub(crate) name: String,
    /// What all points agree on, by element, if that is why.
    pub(crate) constant: Option<Vec<f64>>,
}

/// What the report states of a dataset.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Reported {
    format: String,
    folder: String,
    points: Option<u64>,
    /// Equal records of which the dataset has one.
    pub(crate) duplicates_dropped: u64,
    pub(crate) attributes_dropped: Vec<Dropped>,
    pub(crate) accuracy: Option<Value>,
    /// `None`: nothing was computed.
    #[serde(skip)]
    pub(crate) derive: Option<Derive>,
    tree: Tree,
    details: Details,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default)]
struct Tree {
    nodes: Option<u64>,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default)]
struct Details {
    batches: Option<u64>,
}

/// What a report has about datasets.
enum Read {
    Absent,
    /// It is that of another program.
    Foreign,
    /// What is wrong with it.
    Broken(String),
    Outputs(Vec<Reported>),
}

/// Reads the report in `folder`.
///
/// # Errors
/// The operating system cannot read it.
fn read(folder: &Path) -> Result<Read, ReadError> {
    let path = folder.join(REPORT_FILE);
    let file = match open_file(&path) {
        Ok(file) => BufReader::new(file.take(MAX_BYTES)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Read::Absent),
        Err(error) => return Err(ReadError::io(&path, "opening", error)),
    };
    match serde_json::from_reader::<_, Report>(file) {
        Ok(report) => Ok(report.outputs().map_or(Read::Foreign, Read::Outputs)),
        Err(error) if error.is_io() => Err(ReadError::io(&path, "reading", error.into())),
        Err(error) => Ok(Read::Broken(json_fault(&error))),
    }
}

/// The statement on the dataset at `path`, from the report beside it or in the folder above. A report that cannot be that
/// of the dataset is a finding.
///
/// # Errors
/// The operating system cannot read the report.
pub(crate) fn find(path: &Path, findings: &Findings) -> Result<Option<Reported>, ReadError> {
    let kind = findings.format();
    let folder = if path.is_dir() { path } else { parent(path) };
    let beside = read(folder)?;
    let stated = match beside {
        Read::Outputs(outputs) => {
            let stated = outputs.iter().find(|o| o.folder.is_empty() && o.format == kind.name()).cloned();
            let others = outputs.iter().filter(|o| o.folder.is_empty()).map(|o| o.format.clone()).collect::<Vec<_>>();
            if stated.is_none() && !others.is_empty() {
                findings.checked(Check::Report, 1);
                findings.push(Finding::new(Check::Report, "format in the report", kind.name(), others.join(", ")));
                return Ok(None);
            }
            stated
        }
        Read::Broken(what) => {
            findings.checked(Check::Report, 1);
            findings.push(Finding::new(Check::Report, REPORT_FILE, "the report of the conversion", what));
            return Ok(None);
        }
        Read::Absent | Read::Foreign => None,
    };
    let stated = match stated {
        None => above(folder, kind)?,
        stated => stated,
    };
    if stated.is_none() {
        findings.skip(Check::Report, "there is no report of the conversion beside the dataset");
    }
    Ok(stated)
}

/// From the folder above, whose report names this one.
fn above(folder: &Path, kind: DatasetKind) -> Result<Option<Reported>, ReadError> {
    // ".." and "." have no name of their own
    let folder = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_path_buf());
    let (Some(parent), Some(name)) = (folder.parent(), folder.file_name().and_then(|n| n.to_str())) else {
        return Ok(None);
    };
    let Ok(Read::Outputs(outputs)) = read(parent) else { return Ok(None) };
    Ok(outputs.into_iter().find(|o| o.folder == name && o.format == kind.name()))
}

fn parent(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Holds what is stated against the dataset, which has so many points and nodes (batches).
pub(crate) fn check(stated: Option<&Reported>, (points, nodes): (u64, u64), findings: &Findings) {
    let Some(stated) = stated else { return };
    let kind = findings.format();
    let stated_nodes = if kind == DatasetKind::Batches { stated.details.batches } else { stated.tree.nodes };
    let what = if kind == DatasetKind::Batches { "batches in the report" } else { "nodes in the report" };
    for (subject, found, stated) in [("points in the report", points, stated.points), (what, nodes, stated_nodes)] {
        findings.checked(Check::Report, 1);
        if stated != Some(found) {
            findings.push(Finding::new(Check::Report, subject, found, stated));
        }
    }
}

/// The datasets that one conversion has put into a folder, and what of its report is not so.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Several {
    /// Those that are there, by name of format.
    pub datasets: Vec<Located>,
    /// Outputs that are not there, datasets of which the report knows nothing.
    pub problems: Vec<Finding>,
    /// Why it is not known whether these are all, if it is not.
    pub unchecked: Option<&'static str>,
}

/// Looks for the outputs of a conversion to several formats in `folder`; `None` if there are none, nor a report that names
/// some.
///
/// # Errors
/// The operating system cannot read the folder or the report.
pub fn several(folder: &Path) -> Result<Option<Several>, ReadError> {
    let datasets: Vec<Located> = DatasetKind::ALL
        .iter()
        .filter_map(|kind| locate(folder.join(kind.name())).ok().filter(|l| l.kind == *kind))
        .collect();
    let mut several = Several { datasets, problems: Vec::new(), unchecked: None };
    match read(folder)? {
        Read::Outputs(outputs) => {
            let outputs: Vec<Reported> = outputs.into_iter().filter(|o| !o.folder.is_empty()).collect();
            several.hold_against(folder, &outputs);
            Ok((!outputs.is_empty() || !several.datasets.is_empty()).then_some(several))
        }
        Read::Broken(what) if !several.datasets.is_empty() => {
            several.problems.push(Finding::new(Check::Report, REPORT_FILE, "the report of the conversion", what));
            Ok(Some(several))
        }
        Read::Absent | Read::Foreign if !several.datasets.is_empty() => {
            several.unchecked = Some("there is no report.json: whether these are all outputs is not checked");
            Ok(Some(several))
        }
        _ => Ok(None),
    }
}

impl Several {
    fn hold_against(&mut self, folder: &Path, outputs: &[Reported]) {
        let is_named = |o: &Reported, l: &Located| o.folder == l.kind.name() && o.format == l.kind.name();
        for output in outputs {
            if !self.datasets.iter().any(|l| is_named(output, l)) {
                let found = whereabouts(folder, &output.folder);
                self.problems.push(Finding::new(
                    Check::Report,
                    output.folder.clone(),
                    dataset_of(&output.format),
                    found,
                ));
            }
        }
        for located in &self.datasets {
            if !outputs.iter().any(|o| is_named(o, located)) {
                let found = "a dataset of which report.json knows nothing";
                self.problems.push(Finding::new(Check::Report, located.kind.name(), "no such output", found));
            }
        }
    }
}

fn dataset_of(format: &str) -> String {
    let kind = DatasetKind::ALL.iter().find(|kind| kind.name() == format);
    kind.map_or_else(
        || format!("a dataset of format {format}"),
        |kind| format!("{} dataset with {}", kind.title(), kind.marker_file()),
    )
}

/// What is where an output should be. Names that lead elsewhere are not followed.
fn whereabouts(folder: &Path, name: &str) -> String {
    let mut parts = Path::new(name).components();
    if !matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None)) {
        return "a name that is none of a folder in it".into();
    }
    let path: PathBuf = folder.join(name);
    match fs::metadata(&path) {
        Ok(about) if about.is_dir() => "a folder without it".into(),
        Ok(_) => "no folder".into(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => "nothing".into(),
        Err(error) => system_reason(&error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(report: &str, counts: (u64, u64), kind: DatasetKind) -> (Vec<String>, bool) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(REPORT_FILE), report).unwrap();
        let findings = Findings::new(kind, 20);
        let stated = find(folder.path(), &findings).unwrap();
        check(stated.as_ref(), counts, &findings);
        (findings.finish().1.iter().map(|f| f.subject.to_string()).collect(), stated.is_some())
    }

    #[test]
    fn counts_formats_and_text_of_a_report_are_held_against_the_dataset() {
        let report = r#"{"outputs": [{"format": "potree2", "folder": "", "points": 7, "tree": {"nodes": 2}}]}"#;
        let octree = |counts| found(report, counts, DatasetKind::Potree2);
        assert_eq!(octree((7, 2)), (vec![], true));
        assert_eq!(octree((8, 2)).0, ["points in the report"]);
        assert_eq!(octree((7, 3)).0, ["nodes in the report"]);
        assert_eq!(found(report, (7, 2), DatasetKind::Bintree).0, ["format in the report"]);
        assert_eq!(found(&report[..50], (7, 2), DatasetKind::Potree2).0, [REPORT_FILE]);
        let nothing = r#"{"outputs": [{"format": "potree2", "folder": ""}]}"#;
        assert_eq!(found(nothing, (7, 2), DatasetKind::Potree2).0.len(), 2);
        let batches = r#"{"outputs": [{"format": "batches", "folder": "", "points": 7, "details": {"batches": 1}}]}"#;
        assert_eq!(found(batches, (7, 1), DatasetKind::Batches), (vec![], true));
        assert_eq!(found(batches, (7, 2), DatasetKind::Batches).0, ["batches in the report"]);
        assert_eq!(found(r#"{"pages": 3}"#, (7, 1), DatasetKind::Batches), (vec![], false), "of another program");
        assert_eq!(found(r#"{"options": [3], "derived": ""}"#, (7, 1), DatasetKind::Batches), (vec![], false));
    }

    #[test]
    fn what_was_computed_is_found_under_either_name_and_beside_every_output() {
        let of = |asked: &str| {
            let text = format!(
                r#"{{"outputs": [{{"format": "copc", "folder": "", "attributes_dropped": [{{"name": "a", "why": "b"}}]}}],
                    "{asked}": {{"derive": {{"radius": true}}}}, "derived": {{"without_radius": 3}}}}"#
            );
            let report: Report = serde_json::from_str(&text).unwrap();
            let outputs = report.outputs().unwrap();
            outputs[0].derive.as_ref().map(|d| (d.settings["radius"] == true, d.counts["without_radius"].as_u64()))
        };
        assert_eq!(["settings", "options"].map(of), [Some((true, Some(3))); 2]);
        assert_eq!(of("others"), None);
    }

    #[test]
    fn names_that_lead_out_of_the_folder_are_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["../x", "/etc", "a/b", "..", ""] {
            assert!(whereabouts(folder.path(), name).contains("none of a folder"), "{name}");
        }
        assert_eq!(whereabouts(folder.path(), "potree2"), "nothing");
    }
}
