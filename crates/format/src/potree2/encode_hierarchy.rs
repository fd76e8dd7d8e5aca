//! The table of nodes, cut into chunks.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::NodeKey;

use super::morton::breadth_first_rank;
use super::{Node, NodeRecord, NodeType};

/// A node to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct NodeEntry {
    /// Its address.
    pub key: NodeKey,
    /// Points of the node alone.
    pub points: u32,
    /// Where its payload starts in `octree.bin`.
    pub byte_offset: u64,
    /// Bytes of its payload.
    pub byte_size: u64,
}

impl NodeEntry {
    /// The node `key` with `points` points, whose payload is `byte_size` bytes of `octree.bin`, from `byte_offset` on.
    #[must_use]
    pub const fn new(key: NodeKey, points: u32, byte_offset: u64, byte_size: u64) -> Self {
        Self { key, points, byte_offset, byte_size }
    }
}

impl From<&Node> for NodeEntry {
    fn from(node: &Node) -> Self {
        let NodeRecord { points, byte_offset, byte_size, .. } = node.record;
        Self { key: node.key, points, byte_offset, byte_size }
    }
}

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

/// Writes `hierarchy.bin`: chunks of `step_size` levels (4 is usual), the root's first, the others by level and name of
/// their root; records breadth first. The result depends on the set of nodes alone.
///
/// `nodes`: each key once, in any order; they are sorted by level and name. Child masks and types come from the keys:
/// type 0 with children, 1 without. A node at the border of a chunk becomes a proxy only if it has children. Ancestors
/// that are missing are added as nodes without points, so the result is a valid hierarchy whatever is passed.
#[must_use]
pub fn encode_hierarchy(nodes: &mut [NodeEntry], step_size: u32) -> HierarchyBytes {
    nodes.sort_by_cached_key(|n| breadth_first_rank(n.key));
    if let Some(tree) = Tree::link(nodes) {
        return tree.encode(step_size);
    }
    let complete = with_missing_ancestors(nodes);
    Tree::link(&complete).map_or_else(HierarchyBytes::default, |tree| tree.encode(step_size))
}

/// `nodes` and the ancestors that they lack, in breadth-first order, keys that repeat merged.
fn with_missing_ancestors(nodes: &[NodeEntry]) -> Vec<NodeEntry> {
    let empty = |key| NodeEntry { key, points: 0, byte_offset: 0, byte_size: 0 };
    let mut by_rank = BTreeMap::from([(breadth_first_rank(NodeKey::ROOT), empty(NodeKey::ROOT))]);
    by_rank.extend(nodes.iter().map(|n| (breadth_first_rank(n.key), *n)));
    for node in nodes {
        let mut key = node.key;
        while let Some(parent) = key.parent() {
            by_rank.entry(breadth_first_rank(parent)).or_insert(empty(parent));
            key = parent;
        }
    }
    by_rank.into_values().collect()
}

/// Nodes in breadth-first order, linked.
struct Tree<'a> {
    nodes: &'a [NodeEntry],
    /// The children of node i are the nodes `first_child[i]..first_child[i + 1]`: in breadth-first order, children
    /// follow the children of the node before. So the descendants of a node in a level are one range, too.
    first_child: Vec<usize>,
}

/// A chunk to be written.
struct Chunk {
    root: usize,
    byte_offset: u64,
    byte_size: u64,
}

impl<'a> Tree<'a> {
    /// `None` if `nodes` is no tree: no root, a parent missing, a key twice.
    fn link(nodes: &'a [NodeEntry]) -> Option<Self> {
        nodes.first().filter(|n| n.key == NodeKey::ROOT)?;
        let mut first_child = Vec::with_capacity(nodes.len() + 1);
        let mut next = 1;
        for node in nodes {
            first_child.push(next);
            let mut mask = 0;
            while let Some(child) = nodes.get(next).filter(|n| n.key.parent() == Some(node.key)) {
                let bit = 1u8 << child.key.child_index();
                if mask & bit != 0 {
                    return None;
                }
                mask |= bit;
                next += 1;
            }
        }
        first_child.push(next);
        (next == nodes.len()).then_some(Self { nodes, first_child })
    }

    fn encode(&self, step_size: u32) -> HierarchyBytes {
        // Deeper than the deepest level is the same as everything in one chunk.
        let step = step_size.clamp(1, u32::from(NodeKey::MAX_LEVEL) + 1);
        let chunks = self.chunks(step);
        // Proxies come in the order of their chunks, as both follow breadth-first order.
        let mut own_chunks = chunks.iter().skip(1);
        let mut bytes = Vec::with_capacity((self.nodes.len() + chunks.len()) * NodeRecord::LEN);
        for chunk in &chunks {
            for (level, range) in self.levels_below(chunk.root, step) {
                for index in range {
                    let own = if level == step && self.has_children(index) { own_chunks.next() } else { None };
                    bytes.extend_from_slice(&self.record(index, own).to_bytes());
                }
            }
        }
        let depth = self.nodes.last().map_or(0, |n| u32::from(n.key.level));
        HierarchyBytes { bytes, first_chunk_size: chunks.first().map_or(0, |c| c.byte_size), depth }
    }

    /// The chunks in breadth-first order of their roots.
    fn chunks(&self, step: u32) -> Vec<Chunk> {
        let begins = |index: &usize| {
            let level = u32::from(self.nodes[*index].key.level);
            level == 0 || level.is_multiple_of(step) && self.has_children(*index)
        };
        let mut byte_offset = 0;
        let mut chunks = Vec::new();
        for root in (0..self.nodes.len()).filter(begins) {
            let records: usize = self.levels_below(root, step).map(|(_, range)| range.len()).sum();
            let byte_size = (records * NodeRecord::LEN) as u64;
            chunks.push(Chunk { root, byte_offset, byte_size });
            byte_offset += byte_size;
        }
        chunks
    }

    /// The node `root` and its descendants down to `step` levels below: levels below it, and range of nodes.
    fn levels_below(&self, root: usize, step: u32) -> impl Iterator<Item = (u32, Range<usize>)> + '_ {
        let next = |r: &Range<usize>| Some(self.first_child[r.start]..self.first_child[r.end]);
        (0..=step).zip(std::iter::successors(Some(root..root + 1), next))
    }

    fn has_children(&self, index: usize) -> bool {
        self.first_child[index] < self.first_child[index + 1]
    }

    /// The record of a node, or the proxy for its chunk.
    fn record(&self, index: usize, own_chunk: Option<&Chunk>) -> NodeRecord {
        let NodeEntry { points, byte_offset, byte_size, .. } = self.nodes[index];
        if let Some(&Chunk { byte_offset, byte_size, .. }) = own_chunk {
            return NodeRecord { node_type: NodeType::Proxy as u8, child_mask: 0, points, byte_offset, byte_size };
        }
        let children = &self.nodes[self.first_child[index]..self.first_child[index + 1]];
        let child_mask = children.iter().fold(0, |mask, c| mask | 1 << c.key.child_index());
        let node_type = if child_mask == 0 { NodeType::Leaf } else { NodeType::Normal } as u8;
        NodeRecord { node_type, child_mask, points, byte_offset, byte_size }
    }
}
