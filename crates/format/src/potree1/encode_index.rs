//! The table of nodes, cut into `.hrc` files.

use std::ops::Range;

use crate::{NodeKey, WriteError};

use super::IndexRecord;
use super::path::begins_index;

/// A node to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeCount {
    /// Its address.
    pub key: NodeKey,
    /// Points of the node alone, at least 1.
    pub points: u32,
}

/// One `.hrc` file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IndexFile {
    /// The node that it is named after.
    pub root: NodeKey,
    /// Its contents.
    pub bytes: Vec<u8>,
}

/// Makes the `.hrc` files: the root's first, the others by level and name of their node. Each node with children whose level is
/// a multiple of `step` has one, and the root always; nodes at the border of two files are in both, with their true masks.
///
/// `nodes`: each key once, in any order; they are sorted by level and name.
///
/// # Errors
/// A `step` of 0; no root, a node without its parent, or a key twice.
pub fn encode_index(nodes: &mut [NodeCount], step: u32) -> Result<Vec<IndexFile>, WriteError> {
    if step == 0 {
        return Err(WriteError::input("a hierarchy step of 0 levels"));
    }
    nodes.sort_by_cached_key(|n| n.key.breadth_first_rank());
    let tree = Tree::new(nodes)?;
    let roots = (0..nodes.len())
        .filter(|n| *n == 0 || begins_index(nodes[*n].key.level, step) && !tree.children(*n).is_empty());
    Ok(roots.map(|root| IndexFile { root: nodes[root].key, bytes: tree.encode(root, step) }).collect())
}

/// Nodes in breadth-first order, each with the range of its children.
struct Tree<'a> {
    nodes: &'a [NodeCount],
    /// The children of node i are `first_child[i]..first_child[i + 1]`: they follow the children of the node before.
    first_child: Vec<usize>,
}

impl<'a> Tree<'a> {
    fn new(nodes: &'a [NodeCount]) -> Result<Self, WriteError> {
        if nodes.first().is_none_or(|n| n.key != NodeKey::ROOT) {
            return Err(WriteError::input("an octree without a root"));
        }
        let (mut first_child, mut next) = (Vec::with_capacity(nodes.len() + 1), 1);
        for node in nodes {
            first_child.push(next);
            let mut mask = 0;
            while let Some(child) = nodes.get(next).filter(|n| n.key.parent() == Some(node.key)) {
                let bit = 1u8 << child.key.child_index();
                if mask & bit != 0 {
                    return Err(WriteError::input(format!("node {} is there twice", child.key)));
                }
                mask |= bit;
                next += 1;
            }
        }
        first_child.push(next);
        match nodes.get(next) {
            None => Ok(Self { nodes, first_child }),
            Some(node) => Err(WriteError::input(format!("node {} is there twice, or without its parent", node.key))),
        }
    }

    fn children(&self, node: usize) -> Range<usize> {
        self.first_child[node]..self.first_child[node + 1]
    }

    /// The records of the levels from `root` to `step` levels below it.
    fn encode(&self, root: usize, step: u32) -> Vec<u8> {
        let (mut bytes, mut level) = (Vec::new(), root..root + 1);
        for _ in 0..=step {
            for node in level.clone() {
                let children = &self.nodes[self.children(node)];
                let child_mask = children.iter().fold(0, |mask, child| mask | 1 << child.key.child_index());
                bytes.extend(IndexRecord { child_mask, points: self.nodes[node].points }.to_bytes());
            }
            // a level of a subtree is one range
            level = self.first_child[level.start]..self.first_child[level.end];
            if level.is_empty() {
                break;
            }
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes(names: &[&str]) -> Vec<NodeCount> {
        let node = |(i, name): (usize, &&str)| NodeCount { key: name.parse().unwrap(), points: i as u32 + 1 };
        names.iter().enumerate().map(node).collect()
    }

    #[test]
    fn nodes_at_a_border_are_in_both_files_with_their_true_masks() {
        let mut nodes = nodes(&["r", "r1", "r7", "r12", "r70", "r120", "r123", "r1203", "r12034"]);
        nodes.reverse();
        let files = encode_index(&mut nodes, 2).unwrap();
        let expected: [(&str, &[u8]); 3] = [
            // r, r1, r7, r12 (children 0 and 3, elsewhere), r70
            ("r", &[0x82, 1, 0, 0, 0, 4, 2, 0, 0, 0, 1, 3, 0, 0, 0, 9, 4, 0, 0, 0, 0, 5, 0, 0, 0]),
            // r12, r120, r123, r1203
            ("r12", &[9, 4, 0, 0, 0, 8, 6, 0, 0, 0, 0, 7, 0, 0, 0, 16, 8, 0, 0, 0]),
            ("r1203", &[16, 8, 0, 0, 0, 0, 9, 0, 0, 0]),
        ];
        assert_eq!(
            files.iter().map(|f| (f.root.to_string(), &f.bytes[..])).collect::<Vec<_>>(),
            expected.map(|(n, b)| (n.into(), b))
        );
    }

    #[test]
    fn a_root_alone_has_its_file() {
        let files = encode_index(&mut nodes(&["r"]), 5).unwrap();
        assert_eq!(files, [IndexFile { root: NodeKey::ROOT, bytes: vec![0, 1, 0, 0, 0] }]);
    }

    #[test]
    fn what_is_no_tree_is_refused() {
        for (names, step) in
            [(&[][..], 5), (&["r0"], 5), (&["r", "r00"], 5), (&["r", "r0", "r0"], 5), (&["r", "r"], 5), (&["r"], 0)]
        {
            assert!(encode_index(&mut nodes(names), step).is_err(), "{names:?}");
        }
    }
}
