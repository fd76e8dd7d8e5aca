//! Which paths are the same file.

use std::fs;
use std::path::{Path, PathBuf};

/// What two paths of one file have in common.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Identity {
    /// The path without links.
    Path(PathBuf),
    /// Of a file with several names: device, inode and length. Other files are known by their path: not every file
    /// system has numbers that differ, and no scan may be lost to that.
    Inode(u64, u64, u64),
}

impl Identity {
    /// That of the file at `path`; of a broken link its own place in its folder's.
    pub(super) fn of(path: &Path) -> Self {
        if let Some(inode) = of_many_names(path) {
            return inode;
        }
        let in_folder = || Some(fs::canonicalize(path.parent()?).ok()?.join(path.file_name()?));
        Self::Path(fs::canonicalize(path).ok().or_else(in_folder).unwrap_or_else(|| path.to_path_buf()))
    }
}

#[cfg(unix)]
fn of_many_names(path: &Path) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt as _;
    let meta = fs::metadata(path).ok().filter(|meta| meta.nlink() > 1)?;
    Some(Identity::Inode(meta.dev(), meta.ino(), meta.len()))
}

#[cfg(not(unix))]
fn of_many_names(_: &Path) -> Option<Identity> {
    None
}
