//! Files of which all appear in a folder or none, whatever else is in it.

use std::fs;
use std::path::{Path, PathBuf};

use super::hidden::HiddenFolder;
use super::leftovers;
use super::place::resolve_path;
use super::replace::Replace;
use crate::error::{ConvertError, OutputFault};
use crate::runtime::{Events, SystemDisk};
use crate::warning::Warning;

/// Complete files on their way into a folder, which need not be there. They are removed when this is dropped.
#[derive(Debug)]
pub struct StagedFiles {
    hidden: HiddenFolder,
    output: PathBuf,
    warnings: Vec<Warning>,
}

impl StagedFiles {
    /// Settles what runs that were killed have left, and makes a hidden folder: in `output` if it is there, else beside.
    ///
    /// # Errors
    /// The file system refuses; another run writes in that folder; the run is to stop.
    pub fn new(output: &Path, events: &dyn Events) -> Result<Self, ConvertError> {
        let failed = |doing| move |e| ConvertError::io(output, doing, e);
        let path = resolve_path(output).map_err(failed("finding the place of the output"))?;
        let warnings = leftovers::settle(&path, events)?;
        let made = if path.is_dir() { HiddenFolder::inside(&path) } else { HiddenFolder::beside(&path) };
        let hidden = made.map_err(failed("making a folder for the output"))?;
        events.works_in(hidden.path());
        Ok(Self { hidden, output: path, warnings })
    }

    /// The folder to write the files in.
    #[must_use]
    pub fn folder(&self) -> PathBuf {
        self.hidden.path_of_new()
    }

    /// What there is to say of earlier runs.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Gives all files their places; files of the names `replaced`, which are there, go.
    ///
    /// # Errors
    /// The file system refuses; what was there is there again.
    pub fn place(mut self, replaced: &[String]) -> Result<(), ConvertError> {
        let is_there = fs::symlink_metadata(&self.output).is_ok();
        let replace = Replace { hidden: &mut self.hidden, output: &self.output, disk: &SystemDisk };
        if is_there {
            replace.entries(replaced)?;
        } else {
            replace.appear()?.then_some(()).ok_or_else(|| OutputFault::Busy(self.output.clone()))?;
        }
        self.hidden.keep_parents();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::Silent;

    #[test]
    fn all_files_appear_and_what_a_killed_run_moved_is_put_back() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("images");
        let staged = StagedFiles::new(&out, &Silent).unwrap();
        fs::write(staged.folder().join("a.png"), "a").unwrap();
        staged.place(&[]).unwrap();
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        fs::write(out.join("mine.txt"), "mine").unwrap();

        let mut killed = StagedFiles::new(&out, &Silent).unwrap();
        fs::write(killed.folder().join("a.png"), "new a").unwrap();
        fs::write(killed.folder().join("b.png"), "b").unwrap();
        // as far as it came: one old file aside, one new file in its place
        fs::write(killed.hidden.path().join("moving"), "a.png\nb.png\nall of them\n").unwrap();
        fs::create_dir(killed.hidden.path_of_old()).unwrap();
        fs::rename(out.join("a.png"), killed.hidden.path_of_old().join("a.png")).unwrap();
        fs::rename(killed.folder().join("b.png"), out.join("b.png")).unwrap();
        killed.hidden.keep();
        drop(killed);

        let next = StagedFiles::new(&out, &Silent).unwrap();
        assert_eq!(next.warnings().len(), 1);
        assert_eq!(fs::read(out.join("a.png")).unwrap(), b"a");
        assert!(!out.join("b.png").exists());
        fs::write(next.folder().join("a.png"), "new a").unwrap();
        next.place(&["a.png".to_owned()]).unwrap();
        assert_eq!(fs::read(out.join("a.png")).unwrap(), b"new a");
        assert_eq!(fs::read(out.join("mine.txt")).unwrap(), b"mine");
        assert_eq!(fs::read_dir(&out).unwrap().count(), 2);
    }
}
