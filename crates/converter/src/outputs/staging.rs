//! A dataset is made beside its final name, synced and renamed: finished or not there.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill_format::DatasetKind;
use tempfile::TempDir;

use crate::error::{ConvertError, OutputFault};
use crate::runtime::disk::{create_folder, rename, sync_file_system, sync_folder, sync_path};
use crate::runtime::{Disk, DiskFile};

/// The account of a run, beside the datasets or in the one that there is.
pub(crate) const REPORT_FILE: &str = "report.json";

/// A folder that becomes the output when all is well, and vanishes when not.
pub(crate) struct StagedFolder {
    staging: TempDir,
    output: PathBuf,
    overwrite: bool,
    disk: Arc<dyn Disk>,
}

impl StagedFolder {
    /// Checks that `output` may be made and makes the staging folder beside it.
    pub(crate) fn new(output: &Path, overwrite: bool, disk: Arc<dyn Disk>) -> Result<Self, ConvertError> {
        // `.` and `..` have a name and a folder above them as well.
        let output = match output.file_name() {
            Some(_) => output.to_path_buf(),
            None => fs::canonicalize(output).unwrap_or_else(|_| output.to_path_buf()),
        };
        check_output(&output, overwrite)?;
        let parent = parent_of(&output);
        fs::create_dir_all(&parent).map_err(|e| ConvertError::io(&parent, "making the folder of the output", e))?;
        let name = output.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let staging = tempfile::Builder::new()
            .prefix(&format!(".{name}.unfinished-"))
            .tempdir_in(&parent)
            .map_err(|e| ConvertError::io(&parent, "making a folder beside the output", e))?;
        Ok(Self { staging, output, overwrite, disk })
    }

    /// The folder that holds the output, on whose file system it is made.
    pub(crate) fn parent(&self) -> PathBuf {
        parent_of(&self.output)
    }

    /// The place of a dataset: the folder itself if it is the only one, else a folder in it.
    pub(crate) fn dataset(&self, kind: DatasetKind, is_only_one: bool) -> Result<StagedDataset, ConvertError> {
        let mut dataset = self.whole();
        if !is_only_one {
            dataset.name = kind.name();
            dataset.folder.push(dataset.name);
            create_folder(&*self.disk, &dataset.folder)
                .map_err(|e| ConvertError::io(&dataset.folder, "making the folder of a dataset", e))?;
        }
        Ok(dataset)
    }

    /// Writes and syncs the report beside the datasets, or in the one that there is.
    pub(crate) fn write_report(&self, text: &str) -> Result<(), ConvertError> {
        self.whole().write(REPORT_FILE, text.as_bytes())
    }

    fn whole(&self) -> StagedDataset {
        StagedDataset { folder: self.staging.path().to_path_buf(), name: "", disk: Arc::clone(&self.disk) }
    }

    /// Gives the folder its final name. What stood there before goes only when the new one is in place; whatever fails
    /// before is undone.
    pub(crate) fn finish(self) -> Result<(), ConvertError> {
        let (output, staging) = (self.output.as_path(), self.staging.path());
        let fail = |doing| move |e| ConvertError::io(output, doing, e);
        check_output(output, self.overwrite)?;
        make_readable(staging).map_err(fail("setting permissions"))?;
        sync_folder(&*self.disk, staging).map_err(fail("syncing the output"))?;
        let old = output.exists().then(|| {
            let mut old = staging.as_os_str().to_owned();
            old.push("-old");
            PathBuf::from(old)
        });
        if let Some(old) = &old {
            rename(&*self.disk, output, old).map_err(fail("moving the old output aside"))?;
        }
        // From here on a failure puts the old output back; the new one goes with the staging folder.
        let put_back = || old.as_ref().map_or(Ok(()), |old| fs::rename(old, output));
        if let Err(error) = rename(&*self.disk, staging, output) {
            put_back().map_err(fail("moving the old output back"))?;
            return Err(fail("giving the output its name")(error));
        }
        if let Err(error) = sync_folder(&*self.disk, &parent_of(output)) {
            fs::rename(output, staging).and_then(|()| put_back()).map_err(fail("moving the old output back"))?;
            return Err(fail("syncing the folder of the output")(error));
        }
        if let Some(old) = &old {
            fs::remove_dir_all(old).map_err(fail("removing the old output"))?;
        }
        let _moved = self.staging.keep();
        Ok(())
    }
}

/// A dataset on its way into a [`StagedFolder`].
pub(crate) struct StagedDataset {
    folder: PathBuf,
    name: &'static str,
    disk: Arc<dyn Disk>,
}

impl StagedDataset {
    /// The name of its folder below the output, or nothing.
    pub(crate) fn name(&self) -> &'static str {
        self.name
    }

    /// Makes a file; whoever writes it syncs it.
    pub(crate) fn create(&self, name: &str) -> Result<DiskFile, ConvertError> {
        DiskFile::create(&self.folder.join(name), &self.disk)
    }

    /// Opens a file that was made before, to write more.
    pub(crate) fn open(&self, name: &str) -> Result<DiskFile, ConvertError> {
        DiskFile::open(&self.folder.join(name), &self.disk)
    }

    /// Writes and syncs a small file.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<(), ConvertError> {
        let file = self.create(name)?;
        file.write_at(bytes, 0, "writing the file")?;
        file.sync("writing the file")
    }

    /// Syncs everything that the file system of the dataset has; false where the system cannot.
    pub(crate) fn sync_file_system(&self) -> Result<bool, ConvertError> {
        sync_file_system(&*self.disk, &self.folder).map_err(|e| ConvertError::io(&self.folder, "syncing the files", e))
    }

    /// Syncs a file that was made before and is closed.
    pub(crate) fn sync_file(&self, name: &str) -> Result<(), ConvertError> {
        let path = self.folder.join(name);
        sync_path(&*self.disk, &path).map_err(|e| ConvertError::io(&path, "syncing the file", e))
    }

    /// Syncs the names of the files.
    pub(crate) fn sync(&self) -> Result<(), ConvertError> {
        sync_folder(&*self.disk, &self.folder).map_err(|e| ConvertError::io(&self.folder, "syncing the output", e))
    }
}

/// `Ok(None)`: the folder is a dataset, or several in folders of their names, and nothing else. `Ok(Some(path))`: it is,
/// but holds something that is not part of it.
///
/// # Errors
/// It is no dataset.
fn foreign_file(folder: &Path) -> Result<Option<PathBuf>, ()> {
    let kind = DatasetKind::detect(folder);
    let inside: Vec<&str> = match kind {
        None if folder.join(REPORT_FILE).is_file() => {
            let names = DatasetKind::ALL.iter().map(|kind| kind.name());
            names.filter(|name| foreign_file(&folder.join(name)).is_ok()).collect()
        }
        _ => Vec::new(),
    };
    if kind.is_none() && inside.is_empty() {
        return Err(());
    }
    let is_ours = |name: &str| name == REPORT_FILE || inside.contains(&name) || kind.is_some_and(|k| k.owns(name));
    for entry in fs::read_dir(folder).map_err(|_| ())?.flatten() {
        if !entry.file_name().to_str().is_some_and(is_ours) {
            return Ok(Some(entry.path()));
        }
    }
    for name in inside {
        if let Ok(Some(path)) = foreign_file(&folder.join(name)) {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

/// An output may be replaced if it is a dataset or an empty folder; anything else is not ours to delete.
fn check_output(output: &Path, overwrite: bool) -> Result<(), ConvertError> {
    let Ok(meta) = fs::symlink_metadata(output) else { return Ok(()) };
    let is_empty = meta.is_dir() && fs::read_dir(output).is_ok_and(|mut d| d.next().is_none());
    if is_empty {
        return Ok(());
    }
    if !overwrite {
        return Err(OutputFault::Exists(output.to_path_buf()).into());
    }
    let found = if meta.is_dir() { foreign_file(output) } else { Err(()) };
    let output = output.to_path_buf();
    match found {
        Ok(None) => Ok(()),
        Ok(Some(file)) => Err(OutputFault::Foreign { output, file }.into()),
        Err(()) => Err(OutputFault::NotADataset(output).into()),
    }
}

fn parent_of(output: &Path) -> PathBuf {
    match output.parent() {
        Some(p) if !p.as_os_str().is_empty() => p.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// Temporary folders are private; a dataset is as readable as any folder that the user makes.
fn make_readable(folder: &Path) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // A folder made the ordinary way shows what the user's mask allows.
        let probe = folder.join("mask");
        fs::create_dir(&probe)?;
        let mode = fs::metadata(&probe)?.permissions().mode();
        fs::remove_dir(&probe)?;
        fs::set_permissions(folder, fs::Permissions::from_mode(mode))?;
    }
    let _ = folder;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::SystemDisk;

    fn stage(output: &Path, overwrite: bool) -> Result<StagedFolder, ConvertError> {
        StagedFolder::new(output, overwrite, Arc::new(SystemDisk))
    }

    #[test]
    fn the_output_appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("größe");
        let staged = stage(&out, false).unwrap();
        staged.whole().write("metadata.json", b"{}").unwrap();
        assert!(!out.exists());
        drop(staged);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "nothing is left behind");
        let staged = stage(&out, false).unwrap();
        staged.whole().write("metadata.json", b"{}").unwrap();
        staged.finish().unwrap();
        assert_eq!(fs::read(out.join("metadata.json")).unwrap(), b"{}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_datasets_are_replaced_and_only_when_asked() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        fs::create_dir(&out).unwrap();
        fs::write(out.join("letter.txt"), "dear").unwrap();
        assert!(matches!(stage(&out, false), Err(ConvertError::Output(OutputFault::Exists(_)))));
        assert!(matches!(stage(&out, true), Err(ConvertError::Output(OutputFault::NotADataset(_)))));
        fs::write(out.join("metadata.json"), "{}").unwrap();
        assert!(
            matches!(stage(&out, true), Err(ConvertError::Output(OutputFault::NotADataset(_)))),
            "metadata of something else"
        );
        fs::write(out.join("metadata.json"), "{\"hierarchy\": {}}").unwrap();
        let refused = stage(&out, true).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(refused.contains("letter.txt"), "{refused}");
        fs::remove_file(out.join("letter.txt")).unwrap();
        let staged = stage(&out, true).unwrap();
        staged.whole().write("metadata.json", b"new").unwrap();
        staged.finish().unwrap();
        assert_eq!(fs::read(out.join("metadata.json")).unwrap(), b"new");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
