//! The table of nodes, cut into chunks.

use std::collections::HashSet;

use crate::NodeKey;

use super::{NodeRecord, NodeType};

/// A node to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

/// What [`encode_hierarchy`] made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HierarchyBytes {
    /// The contents of `hierarchy.bin`.
    pub bytes: Vec<u8>,
    /// For [`super::Metadata::first_chunk_size`].
    pub first_chunk_size: u64,
    /// For [`super::Metadata::depth`]: the deepest level that has a node.
    pub depth: u32,
}

/// Where a node stands in breadth-first order: by level, then by name. The level in the top bits, then the name's
/// digits as an index.
pub(super) fn breadth_first_rank(key: NodeKey) -> u128 {
    let low = super::morton::interleave(key.z as u16, key.y as u16, key.x as u16);
    let high = super::morton::interleave((key.z >> 16) as u16, (key.y >> 16) as u16, (key.x >> 16) as u16);
    u128::from(key.level) << 96 | u128::from(high) << 48 | u128::from(low)
}

/// Writes `hierarchy.bin`: chunks of `step_size` levels (4 is usual), the root's first, the others by level and name of
/// their root; records breadth first. The result depends on the set of nodes alone.
///
/// `nodes`: each key once, in any order; they are sorted by level and name. Child masks and types come from the keys:
/// type 0 with children, 1 without. A node at the border of a chunk becomes a proxy only if it has children. Ancestors
/// that are missing are added as nodes without points, so the result is a valid hierarchy whatever is passed.
pub fn encode_hierarchy(nodes: &mut [NodeEntry], step_size: u32) -> HierarchyBytes {
    nodes.sort_by_cached_key(|n| breadth_first_rank(n.key));
    match with_missing_ancestors(nodes) {
        None => Levels::of(nodes).encode(step_size),
        Some(mut complete) => {
            complete.sort_by_cached_key(|n| breadth_first_rank(n.key));
            Levels::of(&complete).encode(step_size)
        }
    }
}

/// `nodes` and the ancestors that they lack, unsorted; `None` if they lack none.
fn with_missing_ancestors(nodes: &[NodeEntry]) -> Option<Vec<NodeEntry>> {
    let complete = Levels::of(nodes).is_complete();
    if complete {
        return None;
    }
    let mut keys: HashSet<NodeKey> = nodes.iter().map(|n| n.key).collect();
    let mut all = nodes.to_vec();
    let mut add = |key: NodeKey| {
        let missing = keys.insert(key);
        if missing {
            all.push(NodeEntry { key, points: 0, byte_offset: 0, byte_size: 0 });
        }
        missing
    };
    add(NodeKey::ROOT);
    for node in nodes {
        let mut key = node.key;
        while let Some(parent) = key.parent().filter(|p| add(*p)) {
            key = parent;
        }
    }
    Some(all)
}

/// Sorted nodes with the links between levels.
struct Levels<'a> {
    nodes: &'a [NodeEntry],
    /// For each node, and one past the last: index of the first node of the next level that is a child of it or of a
    /// node after it.
    first_child: Vec<usize>,
}

impl<'a> Levels<'a> {
    /// `nodes` by level and name. One sweep: the children of a node follow those of the node before it.
    fn of(nodes: &'a [NodeEntry]) -> Self {
        let mut first_child = Vec::with_capacity(nodes.len() + 1);
        let mut next = 1;
        for (index, node) in nodes.iter().enumerate() {
            next = next.max(index + 1);
            // Skip what belongs to parents before this one; only an incomplete tree has such nodes left over.
            while next < nodes.len() && nodes[next].key.level <= node.key.level {
                next += 1;
            }
            first_child.push(next);
            while next < nodes.len() && nodes[next].key.parent() == Some(node.key) {
                next += 1;
            }
        }
        first_child.push(nodes.len());
        Self { nodes, first_child }
    }

    /// True if there is a root and every other node has its parent.
    fn is_complete(&self) -> bool {
        let has_root = self.nodes.first().is_some_and(|n| n.key == NodeKey::ROOT);
        has_root && self.first_child.last() == Some(&self.nodes.len()) && {
            let children: usize = (0..self.nodes.len()).map(|i| self.child_mask(i).count_ones() as usize).sum();
            children + 1 == self.nodes.len()
        }
    }

    fn child_mask(&self, index: usize) -> u8 {
        let key = self.nodes[index].key;
        let children = self.nodes[self.first_child[index]..].iter().take(8).map(|n| n.key);
        children.take_while(|c| c.parent() == Some(key)).fold(0, |mask, c| mask | 1 << c.child_index())
    }

    fn encode(&self, _step_size: u32) -> HierarchyBytes {
        let mut bytes = Vec::with_capacity(self.nodes.len() * NodeRecord::LEN);
        for (index, node) in self.nodes.iter().enumerate() {
            let child_mask = self.child_mask(index);
            let node_type = if child_mask == 0 { NodeType::Leaf } else { NodeType::Normal } as u8;
            let NodeEntry { points, byte_offset, byte_size, .. } = *node;
            bytes.extend(NodeRecord { node_type, child_mask, points, byte_offset, byte_size }.to_bytes());
        }
        let depth = self.nodes.last().map_or(0, |n| u32::from(n.key.level));
        HierarchyBytes { first_chunk_size: bytes.len() as u64, bytes, depth }
    }
}
