//! The copy of the run report: at a place that is neither an input nor part of a dataset, all of it or nothing.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use pointmill_converter::resolve_path;
use pointmill_format::DatasetKind;

use super::whole_file::{beside, is_of_dataset, is_same};
use crate::exit::Failure;

/// Where the copy goes.
pub(crate) struct ReportFile {
    given: PathBuf,
    /// Resolved before the run, which may move the working folder.
    path: PathBuf,
    way: Way,
}

/// How it gets there.
#[derive(Debug, PartialEq, Eq)]
enum Way {
    /// It is the report that the run itself writes.
    IsThere,
    /// Another file first, which then gets the name.
    Replace,
    /// What is no regular file (a terminal, a pipe), or a file in a folder where no other can be made.
    Into,
}

impl ReportFile {
    /// Checks, before the run, that the report may be written to `given` and has a place there. `sources`: files that are
    /// read.
    pub(crate) fn new<'a>(
        given: &Path,
        output: &Path,
        sources: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<Self, Failure> {
        let refuse = |what: &str| Failure::Usage(format!("{}: {what}; choose another file", given.display()));
        let nowhere = "the report cannot be written there: no such folder, or a folder itself";
        let path = resolve_path(given).map_err(|_| refuse(nowhere))?;
        // an output that cannot be found is an error of the run
        let output = resolve_path(output).unwrap_or_else(|_| output.to_path_buf());
        if output.starts_with(&path) {
            return Err(refuse("the report would stand where the output is to be"));
        }
        let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else { return Err(refuse(nowhere)) };
        let name = name.to_string_lossy().to_ascii_lowercase();
        let report = |way| Self { given: given.to_path_buf(), path: path.clone(), way };
        if folder == output && name == "report.json" {
            return Ok(report(Way::IsThere));
        }
        if path.starts_with(&output) && (folder != output || is_taken(&name)) || is_of_dataset(&path, &name) {
            return Err(refuse("the report would replace a file of a dataset"));
        }
        let meta = fs::metadata(&path).ok();
        if meta.as_ref().is_some_and(|m| m.is_dir()) || folder != output && !folder.is_dir() {
            return Err(refuse(nowhere));
        }
        if let Some(source) = meta.is_some().then(|| sources.into_iter().find(|s| is_same(s, &path))).flatten() {
            let line = "the report would replace this input";
            return Err(Failure::Usage(format!("{}: {line}; choose another file", source.display())));
        }
        if meta.as_ref().is_some_and(|m| !m.is_file()) {
            return Ok(report(Way::Into));
        }
        if folder == output {
            return Ok(report(Way::Replace));
        }
        match beside(&path, ".report-") {
            Ok(_) => Ok(report(Way::Replace)),
            Err(_) if meta.is_some() && File::options().append(true).open(&path).is_ok() => Ok(report(Way::Into)),
            Err(e) => Err(Failure::io(given, "writing the report", &e)),
        }
    }

    /// Writes it.
    pub(crate) fn write(&self, text: &str) -> Result<(), Failure> {
        let write = || match self.way {
            Way::IsThere => Ok(()),
            Way::Into => File::options().write(true).truncate(true).open(&self.path)?.write_all(text.as_bytes()),
            Way::Replace => {
                let mut file = beside(&self.path, ".report-")?;
                file.write_all(text.as_bytes())?;
                file.as_file().sync_all()?;
                if let Ok(meta) = fs::metadata(&self.path) {
                    fs::set_permissions(file.path(), meta.permissions())?;
                }
                file.persist(&self.path).map(drop).map_err(|e| e.error)
            }
        };
        write().map_err(|e| Failure::io(&self.given, "writing the report", &e))
    }
}

/// True if an output has files or folders of that name (in small letters: some file systems do not tell them apart).
fn is_taken(name: &str) -> bool {
    DatasetKind::ALL.iter().any(|kind| kind.owns(name) || kind.name() == name)
        || name.starts_with(super::whole_file::UNFINISHED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_report_has_a_place_of_its_own() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::create_dir_all(at("out")).unwrap();
        fs::create_dir_all(at("folder")).unwrap();
        fs::write(at("scan.las"), "").unwrap();
        fs::hard_link(at("scan.las"), at("folder/same.json")).unwrap();
        let sources = [at("scan.las")];
        let way = |name: &str| ReportFile::new(&at(name), &at("out"), &sources).map(|r| r.way);
        for name in ["run.json", "folder/run.json", "out/run.json", "folder/../run.json"] {
            assert_eq!(way(name).unwrap(), Way::Replace, "{name}");
        }
        for name in ["out/report.json", "folder/../out/./report.json"] {
            assert_eq!(way(name).unwrap(), Way::IsThere, "{name}");
        }
        for name in [
            "scan.las",
            "folder/same.json",
            "folder/../scan.las",
            "out",
            "folder",
            "nowhere/run.json",
            "out/metadata.json",
            "out/Octree.bin",
            "folder/../out/hierarchy.bin",
            "out/points.qbatch",
            "out/n01.bin",
            "out/potree2",
            "out/potree2/run.json",
            "out/.unfinished-abcdef",
            ".out.unfinished-abcdef/new/octree.bin",
        ] {
            let Err(Failure::Usage(line)) = way(name) else { panic!("{name} is accepted") };
            assert!(line.contains("choose another file"), "{line}");
        }
        assert!(ReportFile::new(&at("a"), &at("a/b"), &[]).is_err());
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("../scan.las", at("folder/link.json")).unwrap();
            std::os::unix::fs::symlink("out", at("alias")).unwrap();
            assert!(way("folder/link.json").is_err() && way("alias/metadata.json").is_err());
            assert_eq!(way("alias/report.json").unwrap(), Way::IsThere);
            assert_eq!(ReportFile::new(Path::new("/dev/null"), &at("out"), &[]).unwrap().way, Way::Into);
        }
    }
}
