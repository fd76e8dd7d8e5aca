//! A dataset is made beside its final name, synced and renamed: finished or not there.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::error::ConvertError;

/// A folder that becomes the output when all is well, and vanishes when not.
pub(crate) struct StagedFolder {
    staging: TempDir,
    output: PathBuf,
    overwrite: bool,
}

impl StagedFolder {
    /// Checks that `output` may be made and makes the staging folder beside it.
    pub(crate) fn new(output: &Path, overwrite: bool) -> Result<Self, ConvertError> {
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
        Ok(Self { staging, output, overwrite })
    }

    /// The folder that holds the output, on whose file system it is made.
    pub(crate) fn parent(&self) -> PathBuf {
        parent_of(&self.output)
    }

    /// The place of a dataset: the folder itself (`name` is empty) or a folder in it.
    pub(crate) fn dataset(&self, name: &'static str) -> Result<StagedDataset, ConvertError> {
        let folder = if name.is_empty() { self.staging.path().to_path_buf() } else { self.staging.path().join(name) };
        if !name.is_empty() {
            fs::create_dir(&folder).map_err(|e| ConvertError::io(&folder, "making the folder of a dataset", e))?;
        }
        Ok(StagedDataset { folder, name })
    }

    /// Writes and syncs a small file beside the datasets, or in the one that there is.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<(), ConvertError> {
        self.dataset("")?.write(name, bytes)
    }

    /// Gives the folder its final name. What stood there before goes only when the new one is in place.
    pub(crate) fn finish(self) -> Result<(), ConvertError> {
        let output = self.output.as_path();
        let fail = |doing| move |e| ConvertError::io(output, doing, e);
        check_output(&self.output, self.overwrite)?;
        make_readable(self.staging.path()).map_err(fail("setting permissions"))?;
        sync_folder(self.staging.path()).map_err(fail("syncing the output"))?;
        let old = if self.output.exists() {
            let mut old = self.staging.path().as_os_str().to_owned();
            old.push("-old");
            let old = PathBuf::from(old);
            fs::rename(&self.output, &old).map_err(fail("moving the old output aside"))?;
            Some(old)
        } else {
            None
        };
        if let Err(error) = fs::rename(self.staging.path(), &self.output) {
            if let Some(old) = &old {
                fs::rename(old, &self.output).map_err(fail("moving the old output back"))?;
            }
            return Err(fail("giving the output its name")(error));
        }
        let _moved = self.staging.keep();
        sync_folder(&parent_of(&self.output)).map_err(fail("syncing the folder of the output"))?;
        if let Some(old) = old {
            fs::remove_dir_all(&old).map_err(fail("removing the old output"))?;
        }
        Ok(())
    }
}

/// A dataset on its way into a [`StagedFolder`].
pub(crate) struct StagedDataset {
    folder: PathBuf,
    name: &'static str,
}

impl StagedDataset {
    /// The name of its folder below the output, or nothing.
    pub(crate) fn name(&self) -> &'static str {
        self.name
    }

    /// The path that a file of it has for now.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Creates a file; whoever writes it syncs it.
    pub(crate) fn create(&self, name: &str) -> Result<(File, PathBuf), ConvertError> {
        let path = self.path(name);
        let file = File::create(&path).map_err(|e| ConvertError::io(&path, "making the file", e))?;
        Ok((file, path))
    }

    /// Writes and syncs a small file.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<(), ConvertError> {
        let (mut file, path) = self.create(name)?;
        file.write_all(bytes).and_then(|()| file.sync_all()).map_err(|e| ConvertError::io(&path, "writing the file", e))
    }

    /// Syncs the names of the files.
    pub(crate) fn sync(&self) -> Result<(), ConvertError> {
        sync_folder(&self.folder).map_err(|e| ConvertError::io(&self.folder, "syncing the output", e))
    }
}

/// What the first file of a dataset must hold near its start, and the names of all files that one may have.
const DATASETS: [(&str, &str, &[&str]); 3] = [
    ("metadata.json", "\"hierarchy\"", &["hierarchy.bin", "octree.bin", "log.txt"]),
    ("index.json", "\"pointmill-bintree\"", &["leaves.bin"]),
    ("points.qbatch", "QBATCHES", &[]),
];

/// Folders of the datasets that one conversion makes.
const FOLDERS: [&str; 3] = ["potree2", "bintree", "batches"];

/// Bytes in which a dataset makes itself known.
const KNOWN_BYTES: u64 = 64 << 10;

/// `Ok(None)`: the folder is a dataset, or several in folders of their names, and nothing else. `Ok(Some(path))`: it is,
/// but holds something that is none of it.
///
/// # Errors
/// It is no dataset.
fn foreign_file(folder: &Path) -> Result<Option<PathBuf>, ()> {
    let kind = DATASETS.iter().find(|(file, mark, _)| starts_with_mark(&folder.join(file), mark));
    let inside: Vec<&str> = match kind {
        Some(_) => Vec::new(),
        None if folder.join("report.json").is_file() => {
            FOLDERS.into_iter().filter(|name| foreign_file(&folder.join(name)).is_ok()).collect()
        }
        None => Vec::new(),
    };
    if kind.is_none() && inside.is_empty() {
        return Err(());
    }
    let is_leaf = |name: &str| {
        let path = name.strip_prefix('n').and_then(|n| n.strip_suffix(".bin"));
        path.is_some_and(|p| p.bytes().all(|b| matches!(b, b'0' | b'1')))
    };
    let is_ours = |name: &str| {
        name == "report.json"
            || inside.contains(&name)
            || kind.is_some_and(|(file, _, others)| {
                name == *file || others.contains(&name) || *file == "index.json" && is_leaf(name)
            })
    };
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

fn starts_with_mark(file: &Path, mark: &str) -> bool {
    let mut start = Vec::new();
    let read = File::open(file).and_then(|f| f.take(KNOWN_BYTES).read_to_end(&mut start));
    read.is_ok() && start.windows(mark.len()).any(|w| w == mark.as_bytes())
}

/// An output may be replaced if it is a dataset or an empty folder; anything else is not ours to delete.
fn check_output(output: &Path, overwrite: bool) -> Result<(), ConvertError> {
    let Ok(meta) = fs::symlink_metadata(output) else { return Ok(()) };
    let is_empty = meta.is_dir() && fs::read_dir(output).is_ok_and(|mut d| d.next().is_none());
    if is_empty {
        return Ok(());
    }
    if !overwrite {
        return Err(ConvertError::OutputExists(output.to_path_buf()));
    }
    let found = if meta.is_dir() { foreign_file(output) } else { Err(()) };
    let output = output.display();
    match found {
        Ok(None) => Ok(()),
        Ok(Some(foreign)) => Err(ConvertError::Usage(format!(
            "{output}: {} in it is no part of a dataset, so --overwrite does not replace it; move it away, or choose another \
             output",
            foreign.display()
        ))),
        Err(()) => Err(ConvertError::Usage(format!(
            "{output}: exists and is not a dataset, so --overwrite does not replace it; choose another output"
        ))),
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
        // A folder made the ordinary way tells what the user's mask allows.
        let probe = folder.join("mask");
        fs::create_dir(&probe)?;
        let mode = fs::metadata(&probe)?.permissions().mode();
        fs::remove_dir(&probe)?;
        fs::set_permissions(folder, fs::Permissions::from_mode(mode))?;
    }
    let _ = folder;
    Ok(())
}

fn sync_folder(folder: &Path) -> std::io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_output_appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("größe");
        let staged = StagedFolder::new(&out, false).unwrap();
        staged.write("metadata.json", b"{}").unwrap();
        assert!(!out.exists());
        drop(staged);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "nothing is left behind");
        let staged = StagedFolder::new(&out, false).unwrap();
        staged.write("metadata.json", b"{}").unwrap();
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
        assert!(matches!(StagedFolder::new(&out, false), Err(ConvertError::OutputExists(_))));
        assert!(matches!(StagedFolder::new(&out, true), Err(ConvertError::Usage(_))));
        fs::write(out.join("metadata.json"), "{}").unwrap();
        assert!(matches!(StagedFolder::new(&out, true), Err(ConvertError::Usage(_))), "metadata of something else");
        fs::write(out.join("metadata.json"), "{\"hierarchy\": {}}").unwrap();
        let refused = StagedFolder::new(&out, true).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(refused.contains("letter.txt"), "{refused}");
        fs::remove_file(out.join("letter.txt")).unwrap();
        let staged = StagedFolder::new(&out, true).unwrap();
        staged.write("metadata.json", b"new").unwrap();
        staged.finish().unwrap();
        assert_eq!(fs::read(out.join("metadata.json")).unwrap(), b"new");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
