//! What is in the folder of the nodes.

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

use pointmill_format::bytes::Archive;
use pointmill_format::{NodeKey, ReadError};

use super::expect::Names;
use super::store::Store;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::Budget;

/// What a file takes in the tables, at most.
const FILE_BYTES: u64 = 96;

/// The files that have the names of nodes.
#[derive(Debug, Default)]
pub(crate) struct Files {
    /// Bytes of each node's file.
    pub(crate) nodes: HashMap<NodeKey, u64>,
    /// Bytes of each index.
    pub(crate) indexes: HashMap<NodeKey, u64>,
}

impl Files {
    /// Looks at everything below the folder of the nodes, in a folder or an archive; links to folders are not followed. What
    /// has no name of a node, or is in the wrong folder, is a finding.
    ///
    /// # Errors
    /// The operating system could not read a folder; or more files than there is memory for.
    pub(crate) fn look(store: &Store, names: &Names, budget: &Budget, findings: &Findings) -> Result<Self, ReadError> {
        let mut strays = BTreeSet::new();
        let files = match store {
            Store::Folder(folder, _) => Self::in_folder(folder, names, budget, &mut strays, findings.cap())?,
            Store::Archive(archive) => Self::in_archive(archive, names, budget, &mut strays, findings.cap())?,
        };
        for stray in strays {
            let found = stray.to_string_lossy().into_owned();
            findings.push(Finding::new(Check::NodeFiles, "a file", "the name and folder of a node", found));
        }
        Ok(files)
    }

    fn in_archive(
        archive: &Archive,
        names: &Names,
        budget: &Budget,
        strays: &mut BTreeSet<PathBuf>,
        cap: usize,
    ) -> Result<Self, ReadError> {
        let mut files = Self::default();
        for (name, bytes) in archive.files() {
            let inside = Path::new(name);
            if inside.starts_with(&names.octree_dir) && !files.take(inside, names, || Ok(bytes))? && strays.len() <= cap
            {
                strays.insert(inside.to_path_buf());
            }
        }
        budget.require((files.nodes.len() + files.indexes.len()) as u64 * FILE_BYTES)?;
        Ok(files)
    }

    fn in_folder(
        folder: &Path,
        names: &Names,
        budget: &Budget,
        strays: &mut BTreeSet<PathBuf>,
        cap: usize,
    ) -> Result<Self, ReadError> {
        let mut files = Self::default();
        let mut waiting = vec![PathBuf::from(&names.octree_dir)];
        while let Some(below) = waiting.pop() {
            let path = folder.join(&below);
            let entries = match fs::read_dir(&path) {
                Err(e) if e.kind() == std::io::ErrorKind::NotFound && below == Path::new(&names.octree_dir) => {
                    return Ok(files); // no node has a file then
                }
                entries => entries.map_err(|e| ReadError::io(&path, "listing the folder", e))?,
            };
            for entry in entries {
                let entry = entry.map_err(|e| ReadError::io(&path, "listing the folder", e))?;
                let inside = below.join(entry.file_name());
                let kind = entry.file_type().map_err(|e| ReadError::io(entry.path(), "looking at it", e))?;
                let path = entry.path();
                let size =
                    || path.metadata().map(|m| m.len()).map_err(|e| ReadError::io(&path, "asking for the size", e));
                if kind.is_dir() {
                    waiting.push(inside);
                } else if !files.take(&inside, names, size)? && strays.len() <= cap {
                    strays.insert(inside);
                }
            }
            budget.require((files.nodes.len() + files.indexes.len() + waiting.len()) as u64 * FILE_BYTES)?;
        }
        Ok(files)
    }

    /// Takes in a file that is where a node's should be. False if it is none.
    fn take(
        &mut self,
        inside: &Path,
        names: &Names,
        size: impl Fn() -> Result<u64, ReadError>,
    ) -> Result<bool, ReadError> {
        let key = inside.file_stem().and_then(|stem| stem.to_str()).and_then(NodeKey::from_name);
        match key {
            Some(key) if Path::new(&names.node(key)) == inside => {
                self.nodes.insert(key, size()?);
                Ok(true)
            }
            Some(key) if names.begins_index(key.level) && Path::new(&names.index(key)) == inside => {
                self.indexes.insert(key, size()?);
                Ok(true)
            }
            _ => Ok(false),
        }
    }
}
