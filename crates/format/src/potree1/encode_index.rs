//! The table of nodes, cut into `.hrc` files.

use crate::octree::{Keyed, LinkedTree};
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

impl Keyed for NodeCount {
    fn key(&self) -> NodeKey {
        self.key
    }
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
    let Some(tree) = LinkedTree::new(nodes) else {
        return Err(WriteError::input(
            "nodes that are no octree: the root or a parent is missing, or a node is there twice",
        ));
    };
    let roots = (0..tree.len())
        .filter(|n| *n == 0 || begins_index(tree.nodes[*n].key.level, step) && !tree.children(*n).is_empty());
    Ok(roots.map(|root| IndexFile { root: tree.nodes[root].key, bytes: encode(&tree, root, step) }).collect())
}

/// The records of the levels from `root` to `step` levels below it.
fn encode(tree: &LinkedTree<'_, NodeCount>, root: usize, step: u32) -> Vec<u8> {
    let levels = tree.levels(root).take(usize::try_from(step).unwrap_or(usize::MAX).saturating_add(1));
    let record = |node| IndexRecord { child_mask: tree.child_mask(node), points: tree.nodes[node].points };
    levels.flatten().flat_map(|node| record(node).to_bytes()).collect()
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
