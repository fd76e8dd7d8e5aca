//! Datasets among the inputs, and folders of depth maps: folders that are one input.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use pointmill_format::scan::depth::is_sequence;
use pointmill_format::{DatasetKind, Located, ScanKind, locate};

use super::kind::{Kind, kind_in_folder};
use crate::datasets;

/// What the names of folders have that a run makes its datasets in, and the file that is in them.
const UNFINISHED: (&str, &str) = (".unfinished-", "lock");

/// What a run says of itself.
const REPORT_FILE: &str = "report.json";

/// What a search makes of a folder.
pub(super) enum Met {
    /// It is searched.
    Folder,
    /// It is one input.
    Dataset(PathBuf),
    /// It is what a run makes, or has made for the output of this one.
    NoInput,
    /// One conversion has put datasets of these kinds into it.
    Several(Vec<&'static str>),
}

/// The dataset that a path names: its folder, or its file; or the folder of depth maps with a trajectory. `None` for anything else. A folder with a dataset that is one file
/// is a folder like others.
pub(super) fn named(path: &Path) -> Option<PathBuf> {
    if is_sequence(path) {
        return Some(path.to_path_buf());
    }
    let Located { kind, path: found, .. } = detected(path)?;
    (!kind.is_single_file() || !path.is_dir()).then_some(found)
}

/// What a folder is that a search has come to. `output`: without links.
pub(super) fn met(folder: &Path, output: Option<&Path>) -> Met {
    let is_dataset = detected(folder).is_some_and(|found| !found.kind.is_single_file());
    let inside = if is_dataset { Vec::new() } else { datasets::inside(folder) };
    match () {
        () if is_unfinished(folder) => Met::NoInput,
        () if (is_dataset || inside.len() > 1) && is_in(folder, output) => Met::NoInput,
        () if is_dataset || is_sequence(folder) => Met::Dataset(folder.to_path_buf()),
        () if inside.len() > 1 => Met::Several(inside.iter().map(|one| one.kind.name()).collect()),
        () => Met::Folder,
    }
}

/// True for a file that is a dataset, or has one in it.
pub(super) fn is_file(path: &Path) -> bool {
    detected(path).is_some_and(|found| found.path == path)
}

/// True for the account of a run beside the dataset that it made.
pub(super) fn is_report(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == REPORT_FILE) && path.parent().is_some_and(has_dataset)
}

fn has_dataset(folder: &Path) -> bool {
    DatasetKind::detect(folder).is_some()
}

/// True for the output of the run and what is in it.
pub(super) fn is_in(path: &Path, output: Option<&Path>) -> bool {
    output.is_some_and(|output| fs::canonicalize(path).is_ok_and(|path| path.starts_with(output)))
}

/// Scans in the folder of a dataset that are none of its files.
pub(super) fn scans_beside(dataset: &Path) -> Vec<PathBuf> {
    let kind = DatasetKind::detect(dataset).filter(|_| dataset.is_dir());
    if kind.is_none() && !is_sequence(dataset) {
        return Vec::new();
    }
    let owns = |name: &str| kind.is_some_and(|kind| kind.owns(name));
    let is_frame = |path: &Path| kind.is_none() && matches!(ScanKind::of_file(path), Ok(Some(ScanKind::Depth)));
    let entries = fs::read_dir(dataset).into_iter().flatten().flatten();
    let others = entries.filter(|entry| !entry.file_name().to_str().is_some_and(owns));
    let scans = others.map(|entry| entry.path()).filter(|path| !is_frame(path));
    let scans = scans.filter(|path| kind_in_folder(path).is_ok_and(|kind| kind == Kind::Scan));
    let mut scans: Vec<PathBuf> = scans.collect();
    scans.sort();
    scans
}

/// COPC files are scans like others.
fn detected(path: &Path) -> Option<Located> {
    DatasetKind::detect(path).filter(|kind| *kind != DatasetKind::Copc)?;
    locate(path).ok()
}

fn is_unfinished(folder: &Path) -> bool {
    let (part, file) = UNFINISHED;
    folder.file_name().and_then(OsStr::to_str).is_some_and(|name| name.contains(part)) && folder.join(file).is_file()
}
