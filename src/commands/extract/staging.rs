//! Files that appear in a folder once all of them are complete.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use crate::exit::Failure;
use crate::interrupt::stop_flag;

/// Takes the bytes of a file, in order.
pub(super) type ByteSink<'a> = dyn FnMut(&[u8]) -> Result<(), Failure> + 'a;

/// Complete files on their way into a folder: they are written into another beside it. It is removed in the end, come
/// what may.
pub(super) struct Staging {
    folder: tempfile::TempDir,
    target: PathBuf,
    names: Vec<String>,
}

impl Staging {
    /// Prepares to write into `target`, which need not be there; its parent must.
    pub(super) fn new(target: &Path) -> Result<Self, Failure> {
        if target.exists() && !target.is_dir() {
            return Err(Failure::Usage(format!("{}: this is a file; name a folder", target.display())));
        }
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        if !parent.is_dir() {
            return Err(Failure::Usage(format!("{}: no such folder for the output", parent.display())));
        }
        let name = target.file_name().map_or_else(|| "extract".into(), |name| name.to_string_lossy());
        let folder = tempfile::Builder::new()
            .prefix(&format!(".{name}.part-"))
            .tempdir_in(parent)
            .map_err(|e| Failure::io(target, "making the folder", &e))?;
        Ok(Self { folder, target: target.to_path_buf(), names: Vec::new() })
    }

    /// Writes a file of that name: one component, which nothing else has here.
    pub(super) fn write(
        &mut self,
        name: &str,
        fill: &mut dyn FnMut(&mut ByteSink<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let shown = self.target.join(name);
        let io = |e: io::Error| Failure::io(&shown, "writing", &e);
        let mut file = File::create_new(self.folder.path().join(name)).map_err(io)?;
        fill(&mut |bytes| {
            if stop_flag().load(Ordering::Relaxed) {
                return Err(Failure::Interrupted("interrupted; nothing was written".to_owned()));
            }
            file.write_all(bytes).map_err(io)
        })?;
        file.sync_all().map_err(io)?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Removes a file that was written.
    pub(super) fn forget(&mut self, name: &str) {
        self.names.retain(|kept| kept != name);
        // what stays is removed with the folder
        let _ = fs::remove_file(self.folder.path().join(name));
    }

    /// Moves all files into the folder. With `overwrite` files of the same names are replaced, else nothing is moved if
    /// there is one.
    pub(super) fn finish(self, overwrite: bool) -> Result<(), Failure> {
        let target = &self.target;
        let is_there = |name: &&String| fs::symlink_metadata(target.join(name)).is_ok();
        if let Some(name) = self.names.iter().find(is_there).filter(|_| !overwrite) {
            let path = target.join(name);
            let line = format!("{}: is there already; choose another folder, or pass --overwrite", path.display());
            return Err(Failure::Usage(line));
        }
        fs::create_dir_all(target).map_err(|e| Failure::io(target, "making the folder", &e))?;
        for name in &self.names {
            let to = target.join(name);
            fs::rename(self.folder.path().join(name), &to).map_err(|e| Failure::io(&to, "writing", &e))?;
        }
        Ok(())
    }
}
