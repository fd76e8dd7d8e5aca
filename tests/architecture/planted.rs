//! Small crates to try the checks on.

use std::fs;

use crate::imports::Imports;

/// A crate in a temporary folder.
pub(crate) struct Planted(tempfile::TempDir);

/// Writes files, the first of which is the root of the crate.
pub(crate) fn planted(files: &[(&str, &str)]) -> Planted {
    let dir = tempfile::tempdir().unwrap();
    for (name, source) in files {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, source).unwrap();
    }
    Planted(dir)
}

impl Planted {
    pub(crate) fn imports(&self) -> Imports {
        Imports::read(&self.0.path().join("lib.rs"), self.0.path())
    }
}
