//! The table of nodes, cut into chunks.

use std::collections::BTreeMap;

use crate::NodeKey;
use crate::octree::{LinkedTree, chunk_roots};

use super::{NodeEntry, NodeRecord, NodeType};

/// Records of a hierarchy chunk that a client can take at once: what a full tree of four levels below its root has,
/// 102,982 bytes.
pub const CHUNK_RECORDS: u32 = 4681;

/// What [`encode_hierarchy`] made.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct HierarchyBytes {
    /// The contents of `hierarchy.bin`.
    pub bytes: Vec<u8>,
    /// For [`super::Metadata::first_chunk_size`].
    pub first_chunk_size: u64,
    /// For [`super::Metadata::depth`]: the deepest level that has a node.
    pub depth: u32,
}

/// Writes `hierarchy.bin`: chunks of at most `max_records` records ([`CHUNK_RECORDS`] is usual), the root's first, the
/// others by level and name of their root; records breadth first. The result depends on the set of nodes alone.
///
/// A chunk holds the whole subtree of its root if that fits. Otherwise it holds as many whole levels of it as fit half
/// of `max_records`, at least the children of the root, and then the subtrees below them that fit as well, smallest
/// first. The nodes of its last level whose subtrees did not fit are proxies, and the roots of other chunks.
///
/// `nodes`: each key once, in any order; they are sorted by level and name. Child masks and types come from the keys:
/// type 0 with children, 1 without. A node at the border of a chunk becomes a proxy only if it has children. Ancestors
/// that are missing are added as nodes without points, so the result is a valid hierarchy whatever is passed.
#[must_use]
pub fn encode_hierarchy(nodes: &mut [NodeEntry], max_records: u32) -> HierarchyBytes {
    let most = usize::try_from(max_records).unwrap_or(usize::MAX);
    nodes.sort_by_cached_key(|n| n.key.breadth_first_rank());
    if let Some(tree) = LinkedTree::new(nodes) {
        return encode(&tree, most);
    }
    let complete = with_missing_ancestors(nodes);
    LinkedTree::new(&complete).map_or_else(HierarchyBytes::default, |tree| encode(&tree, most))
}

/// `nodes` and the ancestors that they lack, in breadth-first order, keys that repeat merged.
fn with_missing_ancestors(nodes: &[NodeEntry]) -> Vec<NodeEntry> {
    let empty = |key| NodeEntry { key, points: 0, byte_offset: 0, byte_size: 0 };
    let mut by_rank = BTreeMap::from([(NodeKey::ROOT.breadth_first_rank(), empty(NodeKey::ROOT))]);
    by_rank.extend(nodes.iter().map(|n| (n.key.breadth_first_rank(), *n)));
    for node in nodes {
        let mut key = node.key;
        while let Some(parent) = key.parent() {
            by_rank.entry(parent.breadth_first_rank()).or_insert(empty(parent));
            key = parent;
        }
    }
    by_rank.into_values().collect()
}

/// A chunk to be written.
struct Chunk {
    root: usize,
    byte_offset: u64,
    byte_size: u64,
}

fn encode(tree: &LinkedTree<'_, NodeEntry>, most: usize) -> HierarchyBytes {
    let chunks = place(tree, most);
    let own = |node: usize| chunks.binary_search_by_key(&node, |c| c.root).ok().map(|i| &chunks[i]);
    let mut bytes = Vec::with_capacity((tree.len() + chunks.len()) * NodeRecord::LEN);
    for chunk in &chunks {
        for node in tree.part(chunk.root, |node| own(node).is_some()) {
            let elsewhere = own(node).filter(|_| node != chunk.root);
            bytes.extend_from_slice(&record(tree, node, elsewhere).to_bytes());
        }
    }
    HierarchyBytes { bytes, first_chunk_size: chunks.first().map_or(0, |c| c.byte_size), depth: tree.depth() }
}

/// The chunks in breadth-first order of their roots.
fn place(tree: &LinkedTree<'_, NodeEntry>, most: usize) -> Vec<Chunk> {
    let roots = chunk_roots(tree, most);
    let mut byte_offset = 0;
    let place = |&root: &usize| {
        let records = tree.part(root, |node| roots.binary_search(&node).is_ok()).len();
        let chunk = Chunk { root, byte_offset, byte_size: (records * NodeRecord::LEN) as u64 };
        byte_offset += chunk.byte_size;
        chunk
    };
    roots.iter().map(place).collect()
}

/// The record of a node, or the proxy for its chunk.
fn record(tree: &LinkedTree<'_, NodeEntry>, node: usize, own_chunk: Option<&Chunk>) -> NodeRecord {
    let NodeEntry { points, byte_offset, byte_size, .. } = tree.nodes[node];
    if let Some(&Chunk { byte_offset, byte_size, .. }) = own_chunk {
        return NodeRecord { node_type: NodeType::Proxy as u8, child_mask: 0, points, byte_offset, byte_size };
    }
    let child_mask = tree.child_mask(node);
    let node_type = if child_mask == 0 { NodeType::Leaf } else { NodeType::Normal } as u8;
    NodeRecord { node_type, child_mask, points, byte_offset, byte_size }
}
