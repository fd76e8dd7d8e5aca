//! Where an output really is: links, `.` and `..` followed while they still lead there.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

/// The absolute path that `path` means now, without links, `.` and `..`; what does not exist yet is taken as it is
/// written. Working folders may be moved and links changed later: the result stays.
///
/// # Errors
/// An empty path, a link that leads nowhere, a file where a folder should be, no permission.
pub fn resolve_path(path: &Path) -> io::Result<PathBuf> {
    if path.as_os_str().is_empty() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the path is empty"));
    }
    let mut there = if path.is_absolute() { path.to_path_buf() } else { std::env::current_dir()?.join(path) };
    let mut missing: Vec<OsString> = Vec::new();
    let mut found = loop {
        match fs::canonicalize(&there) {
            Ok(found) => break found,
            Err(e) if e.kind() == io::ErrorKind::NotFound && fs::symlink_metadata(&there).is_err() => {
                let last = there.components().next_back().map(|c| c.as_os_str().to_owned());
                let (Some(last), true) = (last, there.pop()) else { return Err(e) };
                missing.push(last);
            }
            Err(e) => return Err(e),
        }
    };
    if !missing.is_empty() && !found.is_dir() {
        return Err(io::ErrorKind::NotADirectory.into());
    }
    for name in missing.iter().rev() {
        match Path::new(name).components().next() {
            Some(Component::ParentDir) => drop(found.pop()),
            _ => found.push(name),
        }
    }
    Ok(found)
}

/// The folder that holds `path`, which is resolved.
pub(super) fn parent_of(path: &Path) -> &Path {
    path.parent().unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_where_it_leads() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().canonicalize().unwrap();
        fs::create_dir_all(root.join("a/b")).unwrap();
        fs::write(root.join("file"), "").unwrap();
        let resolved =
            |path: &str| resolve_path(&root.join(path)).map(|p| p.strip_prefix(&root).unwrap().to_path_buf());
        for (given, expected) in [
            ("a/b", "a/b"),
            ("a/b/", "a/b"),
            ("a/b/..", "a"),
            ("new/.", "new"),
            ("new//", "new"),
            ("a/../new", "new"),
            ("new/../other/x", "other/x"),
        ] {
            assert_eq!(resolved(given).unwrap(), Path::new(expected), "{given}");
        }
        assert!(resolved("file/new").is_err() && resolve_path(Path::new("")).is_err());
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("a/b", root.join("link")).unwrap();
            std::os::unix::fs::symlink("nowhere", root.join("dangling")).unwrap();
            assert_eq!(resolved("link/").unwrap(), Path::new("a/b"));
            assert_eq!(resolved("link/../new").unwrap(), Path::new("a/new"));
            assert!(resolved("dangling").is_err() && resolved("dangling/new").is_err());
        }
    }
}
