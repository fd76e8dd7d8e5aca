//! The nodes of an earlier tree.

use std::collections::HashMap;
use std::sync::Arc;

use pointmill_format::{NodeKey, NodePoints};

use crate::error::ConvertError;
use crate::octree::sink::{EarlierTree, FinishedNode};
use crate::runtime::{Consumer, Pool, Reservation};

/// What is known of a node, bytes of memory.
const NODE_BYTES: usize = 2 * (size_of::<(NodeKey, FinishedNode)>() + size_of::<(NodeKey, u64)>());

/// All nodes, by key.
pub(super) struct EarlierNodes<'a> {
    pub(super) tree: &'a dyn EarlierTree,
    by_key: HashMap<NodeKey, FinishedNode>,
    /// Points of a node and of all below it.
    points: HashMap<NodeKey, u64>,
    _room: Reservation,
}

impl<'a> EarlierNodes<'a> {
    /// `None`: there is no memory for them.
    pub(super) fn read(tree: &'a dyn EarlierTree, memory: &Arc<Pool>) -> Result<Option<Self>, ConvertError> {
        let nodes = tree.nodes()?;
        let mut room = Reservation::new(memory, Consumer::Nodes);
        if !room.try_resize((nodes.len() * NODE_BYTES) as u64) {
            return Ok(None);
        }
        let mut points: HashMap<NodeKey, u64> = HashMap::with_capacity(nodes.len());
        for node in &nodes {
            let path = std::iter::successors(Some(node.key), |key| key.parent());
            path.for_each(|key| *points.entry(key).or_default() += u64::from(node.points));
        }
        let by_key = nodes.into_iter().map(|node| (node.key, node)).collect();
        Ok(Some(Self { tree, by_key, points, _room: room }))
    }

    pub(super) fn get(&self, key: NodeKey) -> Option<&FinishedNode> {
        self.by_key.get(&key)
    }

    /// Points of a node alone.
    pub(super) fn own_points(&self, key: NodeKey) -> u64 {
        self.get(key).map_or(0, |node| node.points.into())
    }

    /// Points of a node and of all below it.
    pub(super) fn points(&self, key: NodeKey) -> u64 {
        self.points.get(&key).copied().unwrap_or(0)
    }

    pub(super) fn has_children(&self, key: NodeKey) -> bool {
        self.points(key) > self.own_points(key)
    }

    /// Appends the points of a node to `out`, as stored records.
    pub(super) fn records(&self, key: NodeKey, scratch: &mut Scratch, out: &mut Vec<u8>) -> Result<(), ConvertError> {
        let Some(node) = self.get(key) else { return Ok(()) };
        scratch.bytes.resize(node.byte_size as usize, 0);
        self.tree.read(node.byte_offset, &mut scratch.bytes)?;
        self.tree.records(node, &scratch.bytes, &mut scratch.points, out)
    }

    /// The children of a node that have points of their own, in the order of their bytes.
    pub(super) fn children(&self, key: NodeKey) -> Vec<FinishedNode> {
        let children = (0..8).filter_map(|child| key.child(child));
        let mut found: Vec<FinishedNode> = children.filter_map(|child| self.get(child)).copied().collect();
        found.sort_unstable_by_key(|node| node.byte_offset);
        found
    }

    /// The nodes below one, in the order of their bytes.
    pub(super) fn below(&self, key: NodeKey) -> Vec<FinishedNode> {
        let (mut found, mut open) = (Vec::new(), vec![key]);
        while let Some(node) = open.pop() {
            let children = (0..8).filter_map(|child| node.child(child)).filter(|child| self.points(*child) > 0);
            for child in children {
                open.push(child);
                found.extend(self.get(child).copied());
            }
        }
        found.sort_unstable_by_key(|node| node.byte_offset);
        found
    }
}

/// Memory to decode a node in, used again and again.
#[derive(Default)]
pub(super) struct Scratch {
    bytes: Vec<u8>,
    pub(super) points: NodePoints,
}
