//! Files that appear in a folder once all of them are complete.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use pointmill_converter::{Events, StagedFiles};

use crate::exit::{Failure, print_line};
use crate::flags::warning_line;
use crate::interrupt::{self, stop_flag};

/// Takes the bytes of a file, in order.
pub(super) type ByteSink<'a> = dyn FnMut(&[u8]) -> Result<(), Failure> + 'a;

/// Complete files on their way into a folder. They are removed in the end, come what may.
pub(super) struct Staging {
    files: StagedFiles,
    target: PathBuf,
    names: Vec<String>,
}

/// The request to stop, and what a stop removes.
struct Stop;

impl Events for Stop {
    fn works_in(&self, folder: &Path) {
        interrupt::works_in(folder);
    }

    fn stop_requested(&self) -> bool {
        stop_flag().load(Ordering::Relaxed)
    }
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
        let files = StagedFiles::new(target, &Stop)?;
        files.warnings().iter().for_each(|warning| print_line(&format!("warning: {}", warning_line(warning))));
        Ok(Self { files, target: target.to_path_buf(), names: Vec::new() })
    }

    /// Writes a file of that name: one component, which nothing else has here.
    pub(super) fn write(
        &mut self,
        name: &str,
        fill: &mut dyn FnMut(&mut ByteSink<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let shown = self.target.join(name);
        let io = |e: io::Error| Failure::io(&shown, "writing", &e);
        let mut file = File::create_new(self.files.folder().join(name)).map_err(io)?;
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
        let _ = fs::remove_file(self.files.folder().join(name));
    }

    /// Moves all files into the folder. With `overwrite` files of the same names are replaced, else nothing is moved if
    /// there is one.
    pub(super) fn finish(self, overwrite: bool) -> Result<(), Failure> {
        interrupt::settling();
        let mut replaced = Vec::new();
        for name in &self.names {
            let path = self.target.join(name);
            let there = fs::symlink_metadata(&path);
            let line = match &there {
                Err(_) => continue,
                Ok(meta) if meta.is_dir() => "is there already, a folder; choose another folder",
                Ok(_) if !overwrite => "is there already; choose another folder, or pass --overwrite",
                Ok(_) => {
                    replaced.push(name.clone());
                    continue;
                }
            };
            return Err(Failure::Usage(format!("{}: {line}", path.display())));
        }
        Ok(self.files.place(&replaced)?)
    }
}
