//! The nodes of a tree, each with the range of its children.

use std::ops::Range;

use crate::NodeKey;

use super::NodeEntry;

/// Nodes in breadth-first order, linked. Nodes are named by their index.
pub(crate) struct LinkedTree<'a> {
    pub(crate) nodes: &'a [NodeEntry],
    /// The children of node i are the nodes `first_child[i]..first_child[i + 1]`: in breadth-first order, children
    /// follow the children of the node before. So the descendants of a node in a level are one range, too.
    first_child: Vec<usize>,
}

impl<'a> LinkedTree<'a> {
    /// `None` if `nodes` is no tree: no root, a parent missing, a key twice.
    pub(crate) fn new(nodes: &'a [NodeEntry]) -> Option<Self> {
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

    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The deepest level that has a node.
    pub(crate) fn depth(&self) -> u32 {
        self.nodes.last().map_or(0, |n| u32::from(n.key.level))
    }

    pub(crate) fn children(&self, node: usize) -> Range<usize> {
        self.first_child[node]..self.first_child[node + 1]
    }

    /// The subtree of a node, level by level, itself first.
    pub(crate) fn levels(&self, node: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let next = |r: &Range<usize>| Some(self.first_child[r.start]..self.first_child[r.end]);
        std::iter::successors(Some(node..node + 1), next).take_while(|r| !r.is_empty())
    }

    /// Nodes of the subtree of a node.
    pub(crate) fn size(&self, node: usize) -> usize {
        self.levels(node).map(|r| r.len()).sum()
    }

    /// The subtree of a node without what is below nodes that `stops`, breadth first.
    pub(crate) fn part(&self, root: usize, stops: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut part = vec![root];
        let mut at = 0;
        while let Some(&node) = part.get(at) {
            if node == root || !stops(node) {
                part.extend(self.children(node));
            }
            at += 1;
        }
        part
    }
}
