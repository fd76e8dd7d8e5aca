//! How a finished output gets its name where something stands: the names change places; or, where the system cannot do
//! that, one after the other; or file by file, where the folder itself cannot be moved. Whatever fails is undone, and what
//! a crash leaves half done is undone by the next run ([`undo`]).

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;

use super::hidden::HiddenFolder;
use super::ours::rank;
use super::place::parent_of;
use crate::error::ConvertError;
use crate::runtime::disk::{exchange, rename, sync_folder};
use crate::runtime::os_files::{self, adopt_mode, adopt_owner, is_same_folder};
use crate::runtime::{Disk, DiskOperation, Replacing};

/// In the hidden folder while files are moved: their names, a line each, and a last line that says that these are all.
const MOVING: &str = "moving";
const ALL: &str = "all of them";

/// What replacing works with.
pub(super) struct Replace<'a> {
    pub(super) hidden: &'a mut HiddenFolder,
    /// Resolved.
    pub(super) output: &'a Path,
    pub(super) disk: &'a dyn Disk,
}

impl Replace<'_> {
    fn failed(&self, doing: &'static str) -> impl FnOnce(io::Error) -> ConvertError {
        let output = self.output.to_path_buf();
        move |e| ConvertError::io(output, doing, e)
    }

    /// Nothing stood there; false: another run has made its output meanwhile.
    pub(super) fn appear(self) -> Result<bool, ConvertError> {
        let new = self.hidden.path_of_new();
        match rename(self.disk, &new, self.output) {
            Err(e) if matches!(e.kind(), io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::AlreadyExists) => {
                return Ok(false);
            }
            renamed => renamed.map_err(self.failed("giving the output its name"))?,
        }
        sync_folder(self.disk, parent_of(self.output)).map_err(|e| {
            let _ = fs::rename(self.output, &new);
            self.failed("syncing the folder of the output")(e)
        })?;
        Ok(true)
    }

    /// The folder as a whole. It keeps owner and permissions; what stood there is in the hidden folder then, as `new` or
    /// as `old`.
    pub(super) fn whole(self, replacing: Replacing) -> Result<(), ConvertError> {
        let before = fs::metadata(self.output).map_err(self.failed("reading the output"))?;
        self.try_whole(replacing, &before).inspect_err(|_| {
            // whatever was said to have failed or to be undone: only where the old output is
            if is_same_folder(self.output, &before) && fs::symlink_metadata(self.hidden.path_of_old()).is_err() {
                let _ = self.hidden.holds_ours_alone();
            }
        })
    }

    fn try_whole(&self, replacing: Replacing, before: &fs::Metadata) -> Result<(), ConvertError> {
        let (new, old, output) = (self.hidden.path_of_new(), self.hidden.path_of_old(), self.output);
        adopt_owner(&new, before);
        // a folder that changes its parent must be writable
        adopt_mode(&new, before, true).map_err(self.failed("setting permissions"))?;
        let giving = "giving the output its name";
        self.will_hold_old()?;
        let at_once = replacing == Replacing::AtOnce;
        let is_done = at_once && exchange(self.disk, &new, output).map_err(self.failed(giving))?;
        if !is_done {
            rename(self.disk, output, &old).map_err(self.failed("moving the old output aside"))?;
            if let Err(e) = rename(self.disk, &new, output) {
                self.put_back(&old)?;
                return Err(self.failed(giving)(e));
            }
        }
        let finish = sync_folder(self.disk, parent_of(output)).and_then(|()| adopt_mode(output, before, false));
        if let Err(e) = finish {
            if is_done {
                os_files::exchange(&new, output).map_err(self.failed("moving the old output back"))?;
            } else {
                fs::rename(output, &new).map_err(self.failed("moving the new output back"))?;
                self.put_back(&old)?;
            }
            return Err(self.failed("syncing the folder of the output")(e));
        }
        Ok(())
    }

    /// What is moved aside is judged before it is removed ([`Self::whole`] does so itself).
    pub(super) fn will_hold_old(&self) -> Result<(), ConvertError> {
        self.hidden.will_hold_old(self.disk).map_err(self.failed("preparing to move the old output aside"))
    }

    fn put_back(&self, old: &Path) -> Result<(), ConvertError> {
        fs::rename(old, self.output).map_err(self.failed("moving the old output back"))
    }

    /// Entry by entry: first what is `going` to `old`, then all that is in `new` to the output.
    pub(super) fn entries(self, going: &[String]) -> Result<(), ConvertError> {
        let coming = names_in(&self.hidden.path_of_new()).map_err(self.failed("reading the new output"))?;
        let journal = self.hidden.path().join(MOVING);
        let write = || {
            self.disk.permit(DiskOperation::Create)?;
            let mut file = File::create_new(&journal)?;
            for name in coming.iter().map(String::as_str).chain([ALL]) {
                writeln!(file, "{name}")?;
            }
            file.sync_all()?;
            sync_folder(self.disk, self.hidden.path())
        };
        if let Err(e) = write() {
            let _ = self.hidden.holds_ours_alone(); // nothing was moved
            return Err(self.failed("writing what is to be moved")(e));
        }
        let moved = self.move_entries(going, &coming);
        if let Err(e) = moved {
            if let Err(e) = undo(self.hidden, self.output, When::Always) {
                self.hidden.keep();
                return Err(self.failed("moving the old output back")(e));
            }
            let _ = self.hidden.holds_ours_alone();
            return Err(self.failed("moving the output to its place")(e));
        }
        // What was new is in its place, whatever happens; without `new` nothing is undone.
        let _ = fs::remove_dir(self.hidden.path_of_new()).and_then(|()| fs::remove_file(&journal));
        Ok(())
    }

    fn move_entries(&self, going: &[String], coming: &[String]) -> io::Result<()> {
        let (new, old) = (self.hidden.path_of_new(), self.hidden.path_of_old());
        fs::create_dir(&old)?;
        let mut going: Vec<&String> = going.iter().collect();
        going.sort_by_key(|name| std::cmp::Reverse(rank(name)));
        for name in &going {
            rename(self.disk, &self.output.join(name), &old.join(name))?;
        }
        if !going.is_empty() {
            sync_folder(self.disk, self.output)?;
        }
        let (others, last): (Vec<&String>, Vec<&String>) = coming.iter().partition(|name| rank(name) == 0);
        for some in [others, last] {
            for name in some {
                rename(self.disk, &new.join(name), &self.output.join(name))?;
            }
            sync_folder(self.disk, self.output)?;
        }
        Ok(())
    }
}

/// Names of what is in a folder, in the order in which it is to be moved to its place.
fn names_in(folder: &Path) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let name = entry?.file_name().into_string();
        names.push(name.map_err(|name| io::Error::other(format!("{} is no name of ours", name.display())))?);
    }
    names.sort_by(|a, b| (rank(a), a).cmp(&(rank(b), b)));
    Ok(names)
}

/// When to undo that entries were moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum When {
    /// If not all are in their places.
    Unfinished,
    Always,
}

/// Undoes what was begun and not finished. True if something was: what stood at the place of the output is there again.
///
/// # Errors
/// The file system refuses, or something else stands there now.
pub(super) fn undo(hidden: &HiddenFolder, output: &Path, when: When) -> io::Result<bool> {
    let (new, old) = (hidden.path_of_new(), hidden.path_of_old());
    let journal = hidden.path().join(MOVING);
    match fs::read_to_string(&journal) {
        // what is inside of the output was never renamed as a whole
        Err(e) if e.kind() == io::ErrorKind::NotFound && hidden.is_inside(output) => Ok(false),
        Err(e) if e.kind() == io::ErrorKind::NotFound => undo_rename(&new, &old, output),
        Err(e) => Err(e),
        Ok(text) => {
            let is_complete = !new.is_dir() || names_in(&new)?.is_empty();
            let is_undone = !(is_complete && when == When::Unfinished) && undo_entries(&text, &new, &old, output)?;
            for folder in [old, new] {
                let _ = fs::remove_dir(folder); // an empty one: both together would look like the half of two renames
            }
            fs::remove_file(&journal)?;
            Ok(is_undone)
        }
    }
}

/// Of two renames only one was done if both folders are still there.
fn undo_rename(new: &Path, old: &Path, output: &Path) -> io::Result<bool> {
    if !(new.is_dir() && old.is_dir()) {
        return Ok(false);
    }
    match fs::remove_dir(output) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
        _ => fs::rename(old, output)?,
    }
    Ok(true)
}

/// A new entry that is not in `new` any more is in the output.
fn undo_entries(text: &str, new: &Path, old: &Path, output: &Path) -> io::Result<bool> {
    let Some(names) = text.strip_suffix('\n').and_then(|text| text.strip_suffix(ALL)) else {
        return Ok(false); // nothing is moved before all names are written
    };
    let is_there = |path: &Path| fs::symlink_metadata(path).is_ok();
    let mut is_undone = false;
    let mut names: Vec<&str> = names.lines().filter(|name| !name.contains(['/', '\\']) && *name != "..").collect();
    names.sort_by_key(|name| std::cmp::Reverse(rank(name)));
    for name in names {
        let (from, to) = (output.join(name), new.join(name));
        if !is_there(&to) && is_there(&from) {
            fs::rename(from, to)?;
            is_undone = true;
        }
    }
    let back = if old.is_dir() { names_in(old)? } else { Vec::new() };
    for name in back {
        let to = output.join(&name);
        if is_there(&to) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        fs::rename(old.join(&name), to)?;
        is_undone = true;
    }
    Ok(is_undone)
}
