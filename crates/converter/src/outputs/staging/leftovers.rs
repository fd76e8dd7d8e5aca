//! What runs have left: undone, removed, or named, and never that of a run that lives.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::hidden::{Found, HiddenFolder, Side};
use super::nodes;
use super::ours::Standing;
use super::replace::{When, undo};
use crate::error::{ConvertError, OutputFault};
use crate::runtime::{Events, SystemDisk};
use crate::warning::Warning;

/// Settles what runs that are over have left for an output: what they had moved is put back, the rest is removed.
///
/// # Errors
/// A run that lives has its files in the output; the run is to stop; what was moved cannot be put back.
pub(super) fn settle(output: &Path, events: &dyn Events) -> Result<Vec<Warning>, ConvertError> {
    let mut warnings = Vec::new();
    for side in [Side::Inside, Side::Beside] {
        for found in HiddenFolder::find(output, side) {
            match found {
                Found::Dead(hidden) => settle_one(hidden, output, events, &mut warnings)?,
                Found::Living if matches!(side, Side::Inside) => {
                    return Err(OutputFault::Busy(output.to_path_buf()).into());
                }
                Found::Living => {}
                Found::Unknown(path) => warnings.extend(settle_unknown(path, output, events)),
            }
            if events.stop_requested() {
                return Err(ConvertError::Interrupted);
            }
        }
    }
    Ok(warnings)
}

fn settle_one(
    mut hidden: HiddenFolder,
    output: &Path,
    events: &dyn Events,
    warnings: &mut Vec<Warning>,
) -> Result<(), ConvertError> {
    match undo(&hidden, output, When::Unfinished) {
        Ok(is_undone) => warnings.extend(is_undone.then(|| Warning::OldOutputBack { output: output.to_path_buf() })),
        Err(e) => {
            hidden.keep();
            return Err(ConvertError::io(hidden.path(), "putting back what an interrupted run has moved there", e));
        }
    }
    warnings.extend(clear(hidden, events));
    Ok(())
}

/// A folder that is called like one of ours, without a lock: version 0.1.0 made such. Its old output, which lay beside it,
/// is ours by its content; of the folder itself nobody knows whether its run lives.
fn settle_unknown(path: PathBuf, output: &Path, events: &dyn Events) -> Option<Warning> {
    let is_old = path.file_name().is_some_and(|name| name.as_encoded_bytes().ends_with(b"-old"));
    if !is_old {
        let why = "nothing says whether the run that made it is over; remove it if it is".to_owned();
        return Some(Warning::Leftover { path, why });
    }
    match Standing::of(&path, None) {
        Ok(Standing::Ours(_)) if fs::symlink_metadata(output).is_err() && fs::rename(&path, output).is_ok() => {
            Some(Warning::OldOutputBack { output: output.to_path_buf() })
        }
        Ok(Standing::Ours(files)) => {
            let removed = remove(&files, events).and_then(|()| fs::remove_dir(&path));
            removed.err().map(|e| Warning::Leftover { path, why: e.to_string() })
        }
        _ => Some(Warning::Leftover { path, why: "it is no dataset of ours".to_owned() }),
    }
}

/// Removes a hidden folder, and in it nothing that may be of others. `Some`: something stays.
pub(super) fn clear(mut hidden: HiddenFolder, events: &dyn Events) -> Option<Warning> {
    match try_clear(&hidden, events) {
        Ok(()) => None,
        Err((path, why)) => {
            hidden.keep();
            Some(Warning::Leftover { path, why })
        }
    }
}

/// The error: what stays, and why.
fn try_clear(hidden: &HiddenFolder, events: &dyn Events) -> Result<(), (PathBuf, String)> {
    let folders = [hidden.path_of_old(), hidden.path_of_new()];
    if !hidden.may_hold_old() {
        let mut there = folders.into_iter().filter(|folder| fs::symlink_metadata(folder).is_ok());
        return there.try_for_each(|folder| remove_all(&folder, events).map_err(|e| (folder, e.to_string())));
    }
    let mut ours = Vec::new();
    for folder in folders {
        match Standing::of(&folder, None) {
            Ok(Standing::Nothing | Standing::Empty) => {}
            Ok(Standing::Ours(files)) => ours.push((folder, files)),
            Ok(Standing::Foreign(file)) => return Err((file, "it is not part of a dataset".to_owned())),
            Ok(Standing::Other) => return Err((folder, "it is not a dataset any more".to_owned())),
            Err(e) => return Err((folder, e.to_string())),
        }
    }
    hidden.holds_ours_alone().map_err(|e| (hidden.path().to_path_buf(), e.to_string()))?;
    for (folder, files) in ours {
        remove(&files, events).map_err(|e| (folder.clone(), e.to_string()))?;
        if let Err(e) = fs::remove_dir(&folder) {
            // something came after it was judged
            let _ = hidden.will_hold_old(&SystemDisk);
            return Err((folder, e.to_string()));
        }
    }
    Ok(())
}

/// Files and folders, one after the other.
fn remove(paths: &[PathBuf], events: &dyn Events) -> io::Result<()> {
    for path in paths {
        remove_one(path, events)?;
    }
    Ok(())
}

fn remove_one(path: &Path, events: &dyn Events) -> io::Result<()> {
    if events.stop_requested() {
        return Err(io::Error::other("the run was asked to stop; the next one removes it"));
    }
    match fs::symlink_metadata(path)?.is_dir() {
        true if nodes::is_octree(path) => nodes::remove(path, events),
        true => fs::remove_dir(path),
        false => fs::remove_file(path),
    }
}

/// A folder and all that is in it.
fn remove_all(folder: &Path, events: &dyn Events) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            remove_all(&entry.path(), events)?;
        } else {
            remove_one(&entry.path(), events)?;
        }
    }
    remove_one(folder, events)
}
