//! The nested folders of a Potree 1 dataset: what of them is ours, by names and places, and how it goes. There may be
//! millions of files, so they are not listed.

use std::fs::{self, DirEntry};
use std::io;
use std::path::{Path, PathBuf};

use pointmill_format::NodeKey;
use pointmill_format::potree1::OCTREE_DIR;

use crate::runtime::Events;

/// Levels of a folder in what is written here.
const STEP: usize = 5;

const EXTENSIONS: [&str; 2] = [".bin", ".hrc"];

/// A folder, by what all names in it begin with: nothing for that of the octree, `r` for that of the root.
type Prefix<'a> = &'a str;

/// What an entry of a folder is.
enum Entry {
    File,
    /// A folder of nodes, whose names begin so.
    Folder(String),
    Foreign,
}

impl Entry {
    fn of(entry: &DirEntry, prefix: Prefix<'_>) -> io::Result<Self> {
        let (name, kind) = (entry.file_name(), entry.file_type()?);
        let Some(name) = name.to_str() else { return Ok(Self::Foreign) };
        Ok(if kind.is_dir() {
            inner(name, prefix).map_or(Self::Foreign, Self::Folder)
        } else if kind.is_file() && is_node_file(name, prefix) {
            Self::File
        } else {
            Self::Foreign
        })
    }
}

/// What the names in the folder `name` begin with.
fn inner(name: &str, prefix: Prefix<'_>) -> Option<String> {
    let is_inner = if prefix.is_empty() { name == "r" } else { name.len() == STEP };
    Some(format!("{prefix}{name}")).filter(|inner| is_inner && is_node(inner))
}

fn is_node_file(name: &str, prefix: Prefix<'_>) -> bool {
    let node = EXTENSIONS.iter().find_map(|extension| name.strip_suffix(extension));
    let is_here = |node: &str| node.strip_prefix(prefix).is_some_and(|rest| rest.len() < STEP);
    !prefix.is_empty() && node.is_some_and(|node| is_here(node) && is_node(node))
}

fn is_node(name: &str) -> bool {
    name.len() <= 1 + usize::from(NodeKey::MAX_LEVEL) && NodeKey::from_name(name).is_some()
}

/// True if a path is called like the folder of the octree.
pub(super) fn is_octree(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == OCTREE_DIR)
}

/// The first thing in the folder of an octree that is none of ours.
pub(super) fn foreign_in(octree: &Path) -> io::Result<Option<PathBuf>> {
    if !fs::symlink_metadata(octree)?.is_dir() {
        return Ok(Some(octree.to_path_buf()));
    }
    look(octree, "")
}

fn look(folder: &Path, prefix: Prefix<'_>) -> io::Result<Option<PathBuf>> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let foreign = match Entry::of(&entry, prefix)? {
            Entry::File => None,
            Entry::Folder(inner) => look(&entry.path(), &inner)?,
            Entry::Foreign => Some(entry.path()),
        };
        if foreign.is_some() {
            return Ok(foreign);
        }
    }
    Ok(None)
}

/// Removes the folder of an octree with all that is ours in it; fails if something else is there.
pub(super) fn remove(octree: &Path, events: &dyn Events) -> io::Result<()> {
    remove_in(octree, "", events)
}

fn remove_in(folder: &Path, prefix: Prefix<'_>, events: &dyn Events) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        match Entry::of(&entry, prefix)? {
            Entry::File if events.stop_requested() => {
                return Err(io::Error::other("the run was asked to stop; the next one removes it"));
            }
            Entry::File => fs::remove_file(entry.path())?,
            Entry::Folder(inner) => remove_in(&entry.path(), &inner, events)?,
            Entry::Foreign => {}
        }
    }
    fs::remove_dir(folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::Silent;

    fn octree(files: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for file in files {
            let path = dir.path().join("data").join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        dir
    }

    const OURS: [&str; 6] = [
        "r/r.bin",
        "r/r.hrc",
        "r/r7777.bin",
        "r/01234/r01234.bin",
        "r/01234/r01234.hrc",
        "r/01234/56701/r0123456701.bin",
    ];

    #[test]
    fn files_of_nodes_in_their_folders_are_ours_and_go() {
        let dir = octree(&OURS);
        let data = dir.path().join("data");
        assert!(is_octree(&data) && !is_octree(dir.path()));
        assert_eq!(foreign_in(&data).unwrap(), None);
        remove(&data, &Silent).unwrap();
        assert!(!data.exists());
    }

    #[test]
    fn whatever_else_is_there_is_found_and_stays() {
        let deep = format!("r/{}/r{}67.bin", ["01234"; 6].join("/"), "01234".repeat(6));
        for other in [
            "notes.txt",
            "r/notes.txt",
            "r/r01234.bin",
            "r/r8.bin",
            "r/r0.las",
            "r/0123/r0123.bin",
            "r/01238/x",
            "r/01234/r01235.bin",
            "r/01234/r0.bin",
            "other/r.bin",
            &deep,
        ] {
            let dir = octree(&[&OURS[..], &[other]].concat());
            let data = dir.path().join("data");
            let found = foreign_in(&data).unwrap().unwrap();
            assert!(data.join(other).starts_with(&found), "{other}: {}", found.display());
            assert!(remove(&data, &Silent).is_err());
            assert!(data.join(other).exists());
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_not_followed() {
        let (dir, elsewhere) = (octree(&OURS), octree(&OURS));
        let data = dir.path().join("data");
        std::os::unix::fs::symlink(elsewhere.path().join("data/r"), data.join("r/77777")).unwrap();
        assert_eq!(foreign_in(&data).unwrap(), Some(data.join("r/77777")));
        assert!(remove(&data, &Silent).is_err());
        assert!(elsewhere.path().join("data/r/r.bin").exists());
    }
}
