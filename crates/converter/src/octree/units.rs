//! The order in which the tree is made.
//!
//! A *unit* is a subtree that one thread builds alone; above the units each node is a unit of its own. A unit sees what the
//! units before it have taken near their borders ([`super::borders`]), so their order is part of the result: it follows
//! from the tree alone. Units of a *class* do not touch one another and are built side by side; a class begins to sample
//! when those before it are done. Subtrees come first, the deepest first, then the nodes above, level by level; of one
//! level there are eight classes, by whether x, y and z of the node are even.

use std::cmp::{Ordering, Reverse};
use std::collections::BTreeMap;

use pointmill_format::NodeKey;

use super::divide::{Chunk, Subtree};
use crate::cloud::{morton, xyz};

/// A piece of the tree that is made alone.
pub(super) struct Unit {
    pub(super) key: NodeKey,
    pub(super) work: Work,
    /// The first unit of its class.
    pub(super) class_start: usize,
}

/// How a unit is made.
pub(super) enum Work {
    /// A subtree, from the chunks that it consists of, in Morton order.
    Subtree(Vec<Chunk>),
    /// A node above the subtrees, from its children, in order.
    Above(Vec<NodeKey>),
}

impl Unit {
    /// Points that it reads.
    pub(super) fn points(&self) -> u64 {
        match &self.work {
            Work::Subtree(chunks) => chunks.iter().map(|c| c.points).sum(),
            Work::Above(_) => 0,
        }
    }
}

/// All units in their order.
pub(super) fn in_order(subtrees: Vec<Subtree>) -> Vec<Unit> {
    let mut above: BTreeMap<(u8, [u32; 3]), Vec<NodeKey>> = BTreeMap::new();
    for subtree in &subtrees {
        let mut child = subtree.key;
        while let Some(parent) = child.parent() {
            let children = above.entry((parent.level, xyz(parent))).or_default();
            if children.contains(&child) {
                break;
            }
            children.push(child);
            child = parent;
        }
    }
    let above = above.into_iter().map(|((level, [x, y, z]), mut children)| {
        children.sort_unstable_by_key(|c| c.child_index());
        Unit { key: NodeKey { level, x, y, z }, work: Work::Above(children), class_start: 0 }
    });
    let subtree = |s: Subtree| Unit { key: s.key, work: Work::Subtree(s.chunks), class_start: 0 };
    let mut units: Vec<Unit> = subtrees.into_iter().map(subtree).chain(above).collect();
    units.sort_by(|a, b| class(a).cmp(&class(b)).then_with(|| by_place(a.key, b.key)));
    for i in 1..units.len() {
        units[i].class_start = if class(&units[i]) == class(&units[i - 1]) { units[i - 1].class_start } else { i };
    }
    units
}

fn class(unit: &Unit) -> (bool, Reverse<u8>, u32) {
    let NodeKey { level, x, y, z } = unit.key;
    (matches!(unit.work, Work::Above(_)), Reverse(level), (x & 1) << 2 | (y & 1) << 1 | (z & 1))
}

fn by_place(a: NodeKey, b: NodeKey) -> Ordering {
    morton::compare(xyz(a), xyz(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(level: u8, x: u32, y: u32) -> NodeKey {
        NodeKey { level, x, y, z: 0 }
    }

    #[test]
    fn deep_subtrees_come_first_and_neighbours_are_in_different_classes() {
        let keys = [key(2, 0, 0), key(2, 1, 0), key(2, 2, 0), key(3, 2, 2), key(3, 3, 3), key(1, 1, 1)];
        let units = in_order(keys.map(|key| Subtree { key, chunks: Vec::new() }).into());
        let order: Vec<(u8, u32, u32)> = units.iter().map(|u| (u.key.level, u.key.x, u.key.y)).collect();
        let subtrees = [(3, 2, 2), (3, 3, 3), (2, 0, 0), (2, 2, 0), (2, 1, 0), (1, 1, 1)];
        let above = [(2, 1, 1), (1, 0, 0), (1, 1, 0), (0, 0, 0)];
        assert_eq!(order, [&subtrees[..], &above[..]].concat());
        let starts: Vec<usize> = units.iter().map(|u| u.class_start).collect();
        assert_eq!(starts, [0, 1, 2, 2, 4, 5, 6, 7, 8, 9]);
        let Work::Above(children) = &units[9].work else { panic!("the root is above all") };
        assert_eq!(children[..], [key(1, 0, 0), key(1, 1, 0), key(1, 1, 1)]);
    }
}
