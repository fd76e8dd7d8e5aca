//! The nodes of an octree that could be reached, whatever format they are in.

use std::collections::HashMap;

use pointmill_format::NodeKey;
use pointmill_format::potree2::NodeRecord;

/// A node with the record that locates its payload; formats that have no such records state points, mask and bytes in one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TreeNode {
    pub(crate) key: NodeKey,
    pub(crate) record: NodeRecord,
    /// Bytes of the hierarchy chunk that begins with it; 0 if none does.
    pub(crate) chunk_bytes: u64,
    /// Its payload range makes sense and may be read.
    pub(crate) readable: bool,
}

/// What a node takes in all tables together, at most: records, the index, deviations.
pub(crate) const NODE_BYTES: u64 = 320;

/// All nodes that could be reached from the root.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    pub(crate) nodes: Vec<TreeNode>,
    index: HashMap<NodeKey, u32>,
}

impl Tree {
    /// A tree of nodes, parents before their children.
    pub(crate) fn new(nodes: Vec<TreeNode>) -> Self {
        let mut tree = Self { nodes, index: HashMap::new() };
        tree.link();
        tree
    }

    /// Makes all nodes known that were added.
    pub(crate) fn link(&mut self) {
        self.index = self.nodes.iter().enumerate().map(|(i, n)| (n.key, i as u32)).collect();
    }

    /// Where a node stands in `nodes`.
    pub(crate) fn find(&self, key: NodeKey) -> Option<usize> {
        self.index.get(&key).map(|i| *i as usize)
    }

    /// The children that are there, by child index.
    pub(crate) fn children(&self, node: &TreeNode) -> Vec<usize> {
        let mask = node.record.child_mask;
        (0..8).filter(|c| mask >> c & 1 == 1).filter_map(|c| self.find(node.key.child(c)?)).collect()
    }

    /// What the points around a node and its ancestors take while it is looked at, at most, bytes: those of the inner
    /// nodes on the way to it, with those of their neighbours that are near.
    pub(crate) fn surroundings_bytes(&self) -> u64 {
        const SITE_BYTES: u64 = 72;
        let mut most = 0;
        // parents come before their children
        let mut above: HashMap<NodeKey, u64> = HashMap::new();
        for node in self.nodes.iter().filter(|n| n.readable && n.record.child_mask != 0) {
            let parent = node.key.parent().and_then(|key| above.get(&key)).copied().unwrap_or(0);
            let sum = parent + u64::from(node.record.points);
            above.insert(node.key, sum);
            most = most.max(sum);
        }
        2 * most * SITE_BYTES
    }

    /// The node's neighbours of the same level, sharing a face, an edge or a corner; at most 26.
    pub(crate) fn neighbours(&self, key: NodeKey) -> impl Iterator<Item = usize> + '_ {
        let around = |cell: u32| [cell.checked_sub(1), Some(cell), cell.checked_add(1)].into_iter().flatten();
        around(key.x)
            .flat_map(move |x| around(key.y).flat_map(move |y| around(key.z).map(move |z| NodeKey { x, y, z, ..key })))
            .filter(move |other| *other != key)
            .filter_map(|other| self.find(other))
    }
}
