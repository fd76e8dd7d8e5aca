//! A folder for files that are needed for a while.

use std::io;
use std::path::{Path, PathBuf};

use super::hidden::{HiddenFolder, Side};

/// A hidden folder for temporary files, removed with all that is in it when it is dropped. If the run is killed, the next one
/// with a folder of that name in the same place removes it, which a lock that ends with the process allows.
#[derive(Debug)]
pub struct WorkFolder(HiddenFolder);

impl WorkFolder {
    /// Makes one in `parent`, whose name begins with `prefix`, and removes those that dead runs have left there.
    ///
    /// # Errors
    /// The file system refuses. What cannot be removed stays, and is no error.
    pub fn make(parent: &Path, prefix: &'static str) -> io::Result<Self> {
        let side = Side::Work(prefix);
        drop(HiddenFolder::find(parent, side));
        HiddenFolder::in_place(parent, side).map(Self)
    }

    /// The folder itself: all that there is to remove.
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// The folder in it for the files.
    pub fn files(&self) -> PathBuf {
        self.0.path_of_new()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn what_a_killed_run_has_left_is_removed_by_the_next_and_what_lives_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let names = || fs::read_dir(dir.path()).unwrap().count();
        let mut killed = WorkFolder::make(dir.path(), ".work-").unwrap();
        fs::create_dir(killed.files().join("dataset")).unwrap();
        fs::write(killed.files().join("dataset/x"), "").unwrap();
        killed.0.keep();
        let left = killed.path().to_owned();
        drop(killed);
        let living = WorkFolder::make(dir.path(), ".other-").unwrap();
        fs::create_dir(dir.path().join(".work-of somebody else")).unwrap();
        fs::write(dir.path().join(".work-of somebody else/x"), "").unwrap();
        assert!(left.exists(), "of another name");
        let next = WorkFolder::make(dir.path(), ".work-").unwrap();
        let second = WorkFolder::make(dir.path(), ".work-").unwrap();
        assert!(!left.exists() && living.files().is_dir() && next.files().is_dir());
        drop((next, second, living));
        assert_eq!(names(), 1, "what is no folder of ours stays");
    }
}
