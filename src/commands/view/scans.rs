//! Scans become a dataset before they are shown: a temporary one, or one that is kept beside them.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use pointmill_converter::{Events, OnFault, Phase, Plan, Potree2Settings, Warning, resolve_path};
use pointmill_format::DatasetKind;
use serde_json::Value;

use crate::args::ViewArgs;
use crate::commands::convert::name_from;
use crate::exit::{Failure, print_line};
use crate::human::progress::Progress;
use crate::inputs::Inputs;
use crate::interrupt;

/// What the name of a kept dataset ends in.
const KEPT: &str = "pointmill";

/// A dataset made of scans.
pub(super) struct Made {
    folder: PathBuf,
    /// Removed with all that is in it when it is dropped.
    temporary: Option<tempfile::TempDir>,
}

impl Made {
    /// Converts `scans`, unless a kept dataset of them is there.
    pub(super) fn of(args: &ViewArgs, scans: &[PathBuf]) -> Result<Self, Failure> {
        if args.keep { kept(args, scans) } else { temporary(args, scans) }
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    pub(super) fn is_temporary(&self) -> bool {
        self.temporary.is_some()
    }
}

fn temporary(args: &ViewArgs, scans: &[PathBuf]) -> Result<Made, Failure> {
    let parent = args.temp_dir.clone().unwrap_or_else(std::env::temp_dir);
    if !parent.is_dir() {
        return Err(Failure::Usage(format!("{}: --temp-dir is not a folder", parent.display())));
    }
    let made = tempfile::Builder::new().prefix(".view-").tempdir_in(&parent);
    let temporary = made.map_err(|error| Failure::io(&parent, "making a folder for the temporary dataset", &error))?;
    let folder = temporary.path().join("dataset");
    interrupt::works_in(temporary.path());
    interrupt::keeps("interrupted; nothing was kept".to_owned());
    let plan = plan(args, scans, &folder)?;
    convert(args, &plan, true)?;
    Ok(Made { folder, temporary: Some(temporary) })
}

fn kept(args: &ViewArgs, scans: &[PathBuf]) -> Result<Made, Failure> {
    let folder = place(scans)?;
    let mut plan = plan(args, scans, &folder)?;
    let report = fs::read(folder.join("report.json")).ok();
    let report: Option<Value> = report.and_then(|text| serde_json::from_slice(&text).ok());
    if folder.symlink_metadata().is_ok() {
        if !report.is_some_and(|report| is_of(&report, &plan.inputs)) {
            let shown = folder.display();
            return Err(Failure::Usage(format!(
                "{shown}: what is there was not made of these scans and is not replaced; move it, or leave out --keep"
            )));
        }
        if args.inputs.reading.given().is_none() && is_newer(&folder, &plan.inputs) {
            if !args.talk.quiet {
                print_line(&format!("{}: kept by an earlier run, and newer than the scans", folder.display()));
            }
            return Ok(Made { folder, temporary: None });
        }
        plan.overwrite = true;
    }
    interrupt::keeps("interrupted; nothing was kept".to_owned());
    convert(args, &plan, false)?;
    interrupt::keeps("interrupted; the server has stopped".to_owned());
    if !args.talk.quiet {
        print_line(&format!("{}: kept for later runs", folder.display()));
    }
    Ok(Made { folder, temporary: None })
}

/// Beside the first scan, or the folder of scans: its name, and the ending of kept datasets.
fn place(scans: &[PathBuf]) -> Result<PathBuf, Failure> {
    let first = scans.first().map(PathBuf::as_path).unwrap_or(Path::new("."));
    let nowhere = || Failure::Usage(format!("{}: --keep needs a path of a scan or a folder", first.display()));
    let resolved = resolve_path(first).map_err(|_| nowhere())?;
    let mut name = resolved.file_name().ok_or_else(nowhere)?.to_owned();
    name.push(".");
    name.push(KEPT);
    // shown as it was typed where that has a name
    Ok(if first.file_name().is_some() { first.with_file_name(name) } else { resolved.with_file_name(name) })
}

/// True if the report is of a conversion of files of these names.
fn is_of(report: &Value, scans: &[PathBuf]) -> bool {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    let inputs = report["inputs"].as_array().map(Vec::as_slice).unwrap_or_default();
    let mut found: Vec<_> =
        inputs.iter().map(|input| input["path"].as_str().and_then(|p| name(Path::new(p)))).collect();
    let mut expected: Vec<_> = scans.iter().map(|scan| name(scan)).collect();
    found.sort();
    expected.sort();
    !found.is_empty() && found == expected
}

/// True if no scan was changed after the dataset was made.
fn is_newer(folder: &Path, scans: &[PathBuf]) -> bool {
    let time = |path: &Path| -> Option<SystemTime> { fs::metadata(path).ok()?.modified().ok() };
    let made = time(&folder.join(DatasetKind::Potree2.marker_file()));
    made.is_some_and(|made| scans.iter().all(|scan| time(scan).is_some_and(|changed| changed <= made)))
}

fn plan(args: &ViewArgs, scans: &[PathBuf], output: &Path) -> Result<Plan, Failure> {
    let inputs: Inputs = args.inputs.expand_these(scans, output)?;
    if let Some(failure) = inputs.unread_failure("") {
        return Err(failure);
    }
    if !args.talk.quiet {
        inputs.notes.iter().for_each(|note| print_line(note));
    }
    let name = name_from(scans, &inputs.files);
    let mut plan = Plan::new(inputs.files, output.to_path_buf());
    (plan.name, plan.other_files, plan.open) = (name, inputs.other_files, args.inputs.options()?);
    plan.invalid = OnFault::Skip;
    plan.crs.clone_from(&args.inputs.reading.placing.crs);
    if let Some(bytes) = args.memory {
        plan.memory_bytes = bytes;
    }
    if let Some(threads) = args.threads {
        plan.threads = usize::from(threads.get());
    }
    Ok(plan)
}

fn convert(args: &ViewArgs, plan: &Plan, is_temporary: bool) -> Result<(), Failure> {
    let progress = Progress::new(&args.talk, Some(interrupt::stop_flag()));
    let watch = Watch { progress: &progress, is_temporary };
    let result = pointmill_converter::convert(plan, &[Potree2Settings::default().into()], &watch);
    progress.end();
    result?;
    Ok(())
}

/// What is made for a temporary dataset is all in one folder, which goes as a whole if the program is ended.
struct Watch<'a> {
    progress: &'a Progress,
    is_temporary: bool,
}

impl Events for Watch<'_> {
    fn phase(&self, phase: Phase, total: u64) {
        self.progress.phase(phase, total);
    }

    fn advance(&self, points: u64) {
        self.progress.advance(points);
    }

    fn warning(&self, warning: &Warning) {
        self.progress.warning(warning);
    }

    fn works_in(&self, folder: &Path) {
        if !self.is_temporary {
            self.progress.works_in(folder);
        }
    }

    fn settling(&self) {
        if !self.is_temporary {
            self.progress.settling();
        }
    }

    fn stop_requested(&self) -> bool {
        self.progress.stop_requested()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_kept_dataset_is_beside_its_scan_and_has_its_whole_name() {
        let of = |path: &str| place(&[PathBuf::from(path)]).unwrap();
        assert_eq!(of("a/site.laz"), Path::new("a/site.laz.pointmill"));
        assert_eq!(of("tiles/"), Path::new("tiles.pointmill"));
        assert!(place(&[PathBuf::from("/")]).is_err());
    }

    #[test]
    fn a_report_names_the_scans_that_a_dataset_is_made_of() {
        let report = json!({ "inputs": [{ "path": "/x/b.las" }, { "path": "a.las" }] });
        let scans = |names: &[&str]| -> Vec<PathBuf> { names.iter().map(PathBuf::from).collect() };
        assert!(is_of(&report, &scans(&["y/a.las", "b.las"])));
        assert!(!is_of(&report, &scans(&["a.las"])) && !is_of(&json!({}), &[]));
    }
}
