//! One page of the hierarchy: a subtree down to other pages, in any order.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use crate::octree::OctreeNode;
use crate::{Advice, Fault, NodeKey, ReadError};

use super::Entry;

/// What entries may refer to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits<'a> {
    pub(super) path: &'a Path,
    /// First byte that chunks can have.
    pub(super) chunks_start: u64,
    pub(super) file_bytes: u64,
}

/// A page as far as its bytes were taken in.
pub(super) struct Page<'a> {
    root: NodeKey,
    limits: Limits<'a>,
    /// Where the next entry stands in the file.
    at: u64,
    nodes: HashMap<NodeKey, OctreeNode>,
}

impl<'a> Page<'a> {
    /// The page of `root` that is those bytes of the file.
    ///
    /// # Errors
    /// Bytes that are not in the file, or no whole number of entries.
    pub(super) fn new(root: NodeKey, bytes: Range<u64>, limits: Limits<'a>) -> Result<Self, ReadError> {
        let Limits { path, file_bytes, .. } = limits;
        let size = bytes.end.saturating_sub(bytes.start);
        if size == 0 || !size.is_multiple_of(Entry::LEN as u64) {
            let what = format!("the hierarchy page of {root} has {size} bytes, not a multiple of {}", Entry::LEN);
            return Err(ReadError::broken(path, bytes.start, what).advise(Advice::ExportAgain));
        }
        if bytes.end > file_bytes {
            let what = format!("the hierarchy page of {root}");
            return Err(outside(path, bytes.start, &what, size, file_bytes));
        }
        Ok(Self { root, limits, at: bytes.start, nodes: HashMap::new() })
    }

    /// Takes the next entries. What cannot be is refused at once, however long the page is.
    ///
    /// # Errors
    /// A key that is none, is not below the page's or comes twice; counts and sizes that contradict each other; chunks and pages
    /// outside of the file.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Result<(), ReadError> {
        let (entries, _) = bytes.as_chunks::<{ Entry::LEN }>();
        if self.nodes.try_reserve(entries.len()).is_err() {
            let what = format!("the nodes of the hierarchy page of {} do not fit memory", self.root);
            return Err(ReadError::memory(self.limits.path, what));
        }
        for bytes in entries {
            let entry = Entry::from_bytes(bytes);
            let node = self.node(&entry)?;
            if self.nodes.insert(node.key, node).is_some() {
                return Err(self.broken(format!("node {} is twice in the hierarchy page of {}", node.key, self.root)));
            }
            self.at += Entry::LEN as u64;
        }
        Ok(())
    }

    fn broken(&self, what: impl Into<Fault>) -> ReadError {
        ReadError::broken(self.limits.path, self.at, what).advise(Advice::ExportAgain)
    }

    fn node(&self, entry: &Entry) -> Result<OctreeNode, ReadError> {
        let Entry { key: numbers, offset, byte_size, points } = *entry;
        let Some(key) = entry.node_key() else {
            let [level, x, y, z] = numbers;
            return Err(self.broken(format!("there is no node {level}-{x}-{y}-{z} in an octree")));
        };
        if key.ancestor(self.root.level) != Some(self.root) {
            return Err(self.broken(format!("node {key} is in the hierarchy page of {}, and not below it", self.root)));
        }
        let is_proxy = points == Entry::PAGE;
        let size = u64::try_from(byte_size).unwrap_or(0);
        let is_sound = match points {
            Entry::PAGE => size > 0 && size.is_multiple_of(Entry::LEN as u64),
            0 => byte_size == 0,
            1.. => size > 0,
            _ => false,
        };
        if !is_sound {
            let what = if is_proxy { "a hierarchy page".to_owned() } else { format!("{points} points") };
            return Err(self.broken(format!("node {key} is said to have {what} in {byte_size} bytes")));
        }
        let Limits { path, chunks_start, file_bytes } = self.limits;
        let node = OctreeNode { is_proxy, ..OctreeNode::new(key) };
        if size == 0 {
            return Ok(node);
        }
        let first = if is_proxy { 0 } else { chunks_start };
        if offset < first || offset.checked_add(size).is_none_or(|end| end > file_bytes) {
            let what = format!("{} of node {key}", if is_proxy { "the hierarchy page" } else { "the chunk" });
            return Err(if offset < first {
                self.broken(format!("{what} is said to begin at byte {offset}, before the points at {chunks_start}"))
            } else {
                outside(path, self.at, &what, size, file_bytes)
            });
        }
        Ok(OctreeNode { points: u64::try_from(points).unwrap_or(0), byte_offset: offset, byte_size: size, ..node })
    }

    /// The nodes, breadth first, with their children.
    ///
    /// # Errors
    /// Nodes that make no tree: no root, a node without its parent, or below a node that is in another page.
    pub(super) fn finish(self) -> Result<Vec<OctreeNode>, ReadError> {
        let Self { root, limits: Limits { path, .. }, at, nodes: mut by_key } = self;
        let broken = |what: String| Err(ReadError::broken(path, at, what).advise(Advice::ExportAgain));
        match by_key.get(&root) {
            None => return broken(format!("the hierarchy page of {root} does not have that node")),
            Some(node) if node.is_proxy => {
                return broken(format!("the hierarchy page of {root} says that this node is in another page"));
            }
            Some(_) => {}
        }
        let mut keys: Vec<NodeKey> = by_key.keys().copied().collect();
        keys.sort_by_cached_key(|key| key.breadth_first_rank());
        for key in keys.iter().filter(|key| **key != root) {
            match key.parent().and_then(|parent| by_key.get_mut(&parent)) {
                Some(parent) if !parent.is_proxy => parent.child_mask |= 1 << key.child_index(),
                Some(_) => return broken(format!("node {key} is below a node that is in another hierarchy page")),
                None => return broken(format!("node {key} is in the hierarchy, its parent is not")),
            }
        }
        Ok(keys.iter().filter_map(|key| by_key.remove(key)).collect())
    }
}

fn outside(path: &Path, at: u64, what: &str, size: u64, file_bytes: u64) -> ReadError {
    let what = format!("{what} is said to have {size} bytes that are not in the file, which has {file_bytes}");
    ReadError::broken(path, at, what).advise(Advice::CutShort)
}
