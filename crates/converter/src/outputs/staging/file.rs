//! One file that appears when it is complete.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::hidden::HiddenFolder;
use super::leftovers;
use super::place::{parent_of, resolve_path};
use crate::error::{ConvertError, OutputFault};
use crate::runtime::disk::{rename, sync_folder};
use crate::runtime::{Disk, DiskFile, Events};
use crate::warning::Warning;

/// A file on its way to its name. It is removed when this is dropped.
pub(crate) struct StagedFile {
    hidden: HiddenFolder,
    /// As it was named.
    given: PathBuf,
    path: PathBuf,
    overwrite: bool,
    disk: Arc<dyn Disk>,
    /// What there is to say of earlier runs.
    pub(crate) warnings: Vec<Warning>,
}

impl StagedFile {
    /// Settles what runs that were killed have left, checks that `output` may be made, and makes a hidden folder beside it.
    ///
    /// # Errors
    /// A file is there and may not be replaced, or something else is there; the file system refuses; the run is to stop.
    pub(crate) fn new(
        output: &Path,
        overwrite: bool,
        disk: Arc<dyn Disk>,
        events: &dyn Events,
    ) -> Result<Self, ConvertError> {
        let failed = |doing| move |e| ConvertError::io(output, doing, e);
        let path = resolve_path(output).map_err(failed("finding the place of the output"))?;
        check(&path, output, overwrite)?;
        let warnings = leftovers::settle(&path, events)?;
        let hidden = HiddenFolder::beside(&path).map_err(failed("making a folder for the output"))?;
        events.works_in(hidden.path());
        Ok(Self { hidden, given: output.to_path_buf(), path, overwrite, disk, warnings })
    }

    fn hidden_path(&self) -> PathBuf {
        self.hidden.path_of_new().join("file")
    }

    /// Makes the file, empty.
    pub(crate) fn create(&self) -> Result<DiskFile, ConvertError> {
        let path = self.hidden_path();
        Ok(DiskFile::create(&path, self.given.clone(), &self.disk)?.past_cache(&path))
    }

    /// Gives the file, which is complete and synced, its name.
    ///
    /// # Errors
    /// As [`Self::new`]: what stands there may have appeared since.
    pub(crate) fn finish(mut self) -> Result<(), ConvertError> {
        check(&self.path, &self.given, self.overwrite)?;
        let given = self.given.as_path();
        let failed = |doing| move |e: io::Error| ConvertError::io(given, doing, e);
        if let Ok(meta) = fs::metadata(&self.path) {
            fs::set_permissions(self.hidden_path(), meta.permissions()).map_err(failed("keeping the permissions"))?;
        }
        rename(&*self.disk, &self.hidden_path(), &self.path).map_err(failed("giving the file its name"))?;
        sync_folder(&*self.disk, parent_of(&self.path)).map_err(failed("syncing the folder of the output"))?;
        self.hidden.keep_parents();
        Ok(())
    }
}

fn check(path: &Path, given: &Path, overwrite: bool) -> Result<(), ConvertError> {
    match fs::symlink_metadata(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(e) => Err(ConvertError::io(given, "finding the place of the output", e)),
        Ok(meta) if !meta.is_file() => Err(OutputFault::NotAFile(given.to_path_buf()).into()),
        Ok(_) if !overwrite => Err(OutputFault::Exists(given.to_path_buf()).into()),
        Ok(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::{DiskOperation, Silent, SystemDisk};

    #[test]
    fn a_file_appears_whole_and_nothing_else_does() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("new/a.las");
        let staged = |overwrite| StagedFile::new(&out, overwrite, Arc::new(SystemDisk), &Silent);
        let first = staged(false).unwrap();
        first.create().unwrap().write_at(b"first", 0, "writing").unwrap();
        assert!(!out.exists());
        drop(first);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "folders that were made for it are gone");
        let second = staged(false).unwrap();
        second.create().unwrap().write_at(b"second", 0, "writing").unwrap();
        second.finish().unwrap();
        assert_eq!(fs::read(&out).unwrap(), b"second");
        assert!(matches!(staged(false), Err(ConvertError::Output(OutputFault::Exists(_)))));
        let third = staged(true).unwrap();
        third.create().unwrap().write_at(b"third", 0, "writing").unwrap();
        assert_eq!(fs::read(&out).unwrap(), b"second");
        third.finish().unwrap();
        assert_eq!(fs::read(&out).unwrap(), b"third");
        assert_eq!(fs::read_dir(dir.path().join("new")).unwrap().count(), 1);
        let folder = StagedFile::new(dir.path(), true, Arc::new(SystemDisk), &Silent);
        assert!(matches!(folder, Err(ConvertError::Output(OutputFault::NotAFile(_)))));
    }

    #[derive(Debug)]
    struct NoRename;

    impl Disk for NoRename {
        fn permit(&self, operation: DiskOperation) -> io::Result<()> {
            if operation == DiskOperation::Rename { Err(io::ErrorKind::PermissionDenied.into()) } else { Ok(()) }
        }
    }

    #[test]
    fn what_cannot_get_its_name_leaves_the_old_file() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("a.las");
        fs::write(&out, "old").unwrap();
        let staged = StagedFile::new(&out, true, Arc::new(NoRename), &Silent).unwrap();
        staged.create().unwrap().write_at(b"new", 0, "writing").unwrap();
        assert!(matches!(staged.finish(), Err(ConvertError::Io { .. })));
        assert_eq!(fs::read(&out).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
