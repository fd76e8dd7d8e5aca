//! Where an output is to be, what stands there, and whether it can be made beside that place.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::hidden::HiddenFolder;
use super::ours::Standing;
use crate::error::{ConvertError, OutputFault};
use crate::runtime::os_files::adopt_owner;
use crate::runtime::{Disk, Replacing};

/// Where the output is to be.
pub(super) struct Place {
    /// As it was requested.
    pub(super) given: PathBuf,
    /// Resolved.
    pub(super) path: PathBuf,
    pub(super) overwrite: bool,
}

impl Place {
    /// An output may be replaced if it is ours or an empty folder; anything else is not ours to delete. `aside`: a path
    /// in it that does not count.
    pub(super) fn check(&self, aside: Option<&Path>) -> Result<Standing, ConvertError> {
        let standing =
            Standing::of(&self.path, aside).map_err(|e| ConvertError::io(&self.given, "reading the output", e))?;
        let output = self.given.clone();
        match standing {
            Standing::Nothing | Standing::Empty => Ok(standing),
            Standing::Foreign(file) => {
                let file = file.strip_prefix(&self.path).map_or(file.clone(), |inner| output.join(inner));
                Err(OutputFault::Foreign { output, file }.into())
            }
            Standing::Other => Err(OutputFault::NotADataset(output).into()),
            Standing::Ours(_) if !self.overwrite => Err(OutputFault::Exists(output).into()),
            Standing::Ours(_) => Ok(standing),
        }
    }

    /// Makes the hidden folder beside the output, or in it: where the folder of the output cannot be replaced, because
    /// something is mounted there, the folder above is not writable, or its owner could not be kept.
    pub(super) fn make_room(
        &self,
        standing: &Standing,
        disk: &dyn Disk,
    ) -> Result<(HiddenFolder, Replacing), ConvertError> {
        let best = disk.replacing();
        if *standing == Standing::Nothing || best != Replacing::EntryByEntry {
            match HiddenFolder::beside(&self.path) {
                Ok(hidden) if *standing == Standing::Nothing => return Ok((hidden, best)),
                Ok(mut hidden) => {
                    let suits = self.can_be_moved(&mut hidden) && self.keeps_owner(standing, &hidden);
                    if suits {
                        return Ok((hidden, best));
                    }
                }
                Err(e) if *standing == Standing::Nothing || !is_denied(&e) => {
                    return Err(ConvertError::io(&self.given, "making a folder beside the output", e));
                }
                _ => {}
            }
        }
        match HiddenFolder::inside(&self.path) {
            Ok(hidden) => Ok((hidden, Replacing::EntryByEntry)),
            Err(e) => Err(ConvertError::io(&self.given, "making a folder in the output", e)),
        }
    }

    /// Learns it from the system without moving anything: a folder never takes the place of one with something in it,
    /// and what cannot be moved at all is refused first.
    fn can_be_moved(&self, hidden: &mut HiddenFolder) -> bool {
        if cfg!(not(unix)) {
            return true;
        }
        let full = hidden.path().join("probe");
        let made = fs::create_dir(&full).and_then(|()| fs::write(full.join("full"), ""));
        let moved = made.and_then(|()| fs::rename(&self.path, &full));
        if moved.is_ok() {
            // a file system that keeps no promise: back with it
            if fs::rename(&full, &self.path).is_err() {
                hidden.keep();
            }
            return false;
        }
        let _ = fs::remove_dir_all(&full);
        moved.is_err_and(|e| matches!(e.kind(), io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::AlreadyExists))
    }

    /// An empty folder was made by someone for this output: it keeps its owner, come what may.
    fn keeps_owner(&self, standing: &Standing, hidden: &HiddenFolder) -> bool {
        let owner = fs::metadata(&self.path);
        *standing != Standing::Empty || owner.is_ok_and(|of| adopt_owner(&hidden.path_of_new(), &of))
    }
}

fn is_denied(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem)
}
