//! What the tests share.

use std::path::PathBuf;

use pointmill_format::bytes::Memory;
use pointmill_format::copc::{Dataset, Entry, Info};
use pointmill_format::octree::{Octree, OctreeNodes};
use pointmill_format::{NodeKey, NodePoints, ReadError};
use pointmill_testkit::files::{fixture, fixture_bytes};

pub(crate) const FIXTURES: [&str; 3] = ["format6", "pages", "format8"];

/// The path of a golden file.
pub(crate) fn golden(name: &str) -> PathBuf {
    fixture("copc").join(format!("{name}.copc.laz"))
}

/// The bytes of a golden file.
pub(crate) fn load(name: &str) -> Vec<u8> {
    fixture_bytes(&format!("copc/{name}.copc.laz"))
}

pub(crate) fn open(bytes: &[u8]) -> Result<Dataset, ReadError> {
    Dataset::from_source(Memory::from([("a.copc.laz".to_owned(), bytes.to_vec())]), "a.copc.laz")
}

/// The info record of a file.
pub(crate) fn info(bytes: &[u8]) -> Info {
    Info::from_bytes(bytes[Info::OFFSET as usize..].first_chunk().unwrap())
}

pub(crate) fn set_info(bytes: &mut [u8], info: &Info) {
    bytes[Info::OFFSET as usize..][..Info::LEN].copy_from_slice(&info.to_bytes());
}

/// The hierarchy of a golden file, whose pages follow one another to its end: where entry `index` is.
pub(crate) fn entry_at(bytes: &[u8], index: usize) -> usize {
    info(bytes).root_page_offset as usize + Entry::LEN * index
}

pub(crate) fn entry(bytes: &[u8], index: usize) -> Entry {
    Entry::from_bytes(bytes[entry_at(bytes, index)..].first_chunk().unwrap())
}

pub(crate) fn set_entry(bytes: &mut [u8], index: usize, entry: &Entry) {
    let at = entry_at(bytes, index);
    bytes[at..at + Entry::LEN].copy_from_slice(&entry.to_bytes());
}

/// Points of all nodes by name, as they are read, and the names breadth first.
pub(crate) fn read_all(dataset: &Dataset) -> Result<Vec<(String, NodePoints)>, ReadError> {
    let nodes = dataset.read_hierarchy()?;
    let read = |node| {
        let mut points = NodePoints::default();
        dataset.read_points(node, &mut points)?;
        Ok(points)
    };
    nodes.iter().map(|node| Ok((node.key.to_string(), read(node)?))).collect()
}

/// As a renderer does it: page by page. The names of the nodes, sorted.
pub(crate) fn walk(octree: &dyn Octree) -> Result<Vec<String>, ReadError> {
    let (mut nodes, mut names) = (OctreeNodes::new(octree)?, Vec::new());
    let mut stack = vec![NodeKey::ROOT];
    while let Some(key) = stack.pop() {
        nodes.load(octree, key)?;
        names.push(key.to_string());
        stack.extend(nodes.children(key).map(|child| child.key));
    }
    names.sort();
    Ok(names)
}
