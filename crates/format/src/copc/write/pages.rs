//! The hierarchy, cut into pages.

use crate::octree::{LinkedTree, chunk_roots};
use crate::potree2::{CHUNK_RECORDS, NodeEntry};
use crate::{NodeKey, WriteError};

use super::super::Entry;

/// Entries of a page that a client can take at once: what a full tree of four levels below its root has, 149,792 bytes.
pub const MAX_PAGE_ENTRIES: u32 = CHUNK_RECORDS;

/// What [`encode_pages`] made.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Pages {
    /// All pages, the root's first.
    pub bytes: Vec<u8>,
    /// Bytes of the root's page.
    pub root_size: u64,
}

/// Writes the hierarchy: pages of at most `max_entries` entries ([`MAX_PAGE_ENTRIES`] is usual), the root's first, the others by level
/// and name of the nodes that they begin with; entries breadth first. `start`: the byte of the file where they will be.
///
/// The tree is cut as [`crate::potree2::encode_hierarchy`] does it: whole levels first, then small subtrees.
///
/// `nodes`: each key once, in any order; they are sorted by level and name. Places are bytes of the file.
///
/// # Errors
/// Nodes that make no tree, or more points or bytes of a node than an entry can say (2³¹ − 1).
pub fn encode_pages(nodes: &mut [NodeEntry], start: u64, max_entries: u32) -> Result<Pages, WriteError> {
    nodes.sort_by_cached_key(|node| node.key.breadth_first_rank());
    let tree = LinkedTree::new(nodes)
        .ok_or_else(|| WriteError::input("the nodes are no tree: one is there twice, or without its parent"))?;
    let roots = chunk_roots(&tree, usize::try_from(max_entries).unwrap_or(usize::MAX));
    let is_root = |node: usize| roots.binary_search(&node).is_ok();
    let parts: Vec<Vec<usize>> = roots.iter().map(|root| tree.part(*root, is_root)).collect();
    let mut places = Vec::with_capacity(parts.len());
    let mut at = start;
    for part in &parts {
        let size = (part.len() * Entry::LEN) as u64;
        places.push((at, size));
        at += size;
    }
    let mut bytes = Vec::with_capacity((at - start) as usize);
    for (root, part) in roots.iter().zip(&parts) {
        for node in part {
            let elsewhere = roots.binary_search(node).ok().filter(|_| node != root).map(|page| places[page]);
            bytes.extend(entry(&tree.nodes[*node], elsewhere)?.to_bytes());
        }
    }
    Ok(Pages { bytes, root_size: places.first().map_or(0, |(_, size)| *size) })
}

/// The entry of a node, or the one that leads to its page.
fn entry(node: &NodeEntry, page: Option<(u64, u64)>) -> Result<Entry, WriteError> {
    let NodeEntry { key, points, byte_offset, byte_size } = *node;
    let (offset, bytes, points) = match page {
        Some((offset, bytes)) => (offset, bytes, Some(Entry::PAGE)),
        None if points == 0 => (0, 0, Some(0)),
        None => (byte_offset, byte_size, i32::try_from(points).ok()),
    };
    match (i32::try_from(bytes), points) {
        (Ok(byte_size), Some(points)) => Ok(Entry { key: Entry::key_of(key), offset, byte_size, points }),
        _ => Err(too_large(key)),
    }
}

fn too_large(key: NodeKey) -> WriteError {
    WriteError::input(format!("node {key} has more points or bytes than 2147483647, which COPC cannot say"))
}
