//! What makes a row of nodes a tree in preorder; the same for those that are read and those that are written.

use super::node::{MAX_DEPTH, MAX_NAMED_DEPTH, leaf_file_name};
use super::{Layout, Node, NodeKind};

/// Takes nodes one by one and refuses the first that does not continue a tree. Keeps the path to the next node and
/// nothing else.
#[derive(Debug, Default)]
pub(super) struct Preorder {
    /// The inner nodes above the next node, root first.
    above: Vec<Ancestor>,
    /// Nodes so far.
    len: u32,
}

#[derive(Debug)]
struct Ancestor {
    /// Index that its high child has to have.
    high: u32,
    /// The next node is its high child, or below it.
    on_high_side: bool,
    /// Points of the sides that have not begun.
    points_left: u64,
}

impl Preorder {
    /// Nodes so far: the index of the next one.
    pub(super) fn len(&self) -> u32 {
        self.len
    }

    /// The file of the next node in layout `files`, should it be a leaf.
    pub(super) fn file_name(&self) -> String {
        leaf_file_name(self.above.iter().map(|a| a.on_high_side))
    }

    /// Adds the next node. What is wrong with it continues "node 7 …".
    pub(super) fn push(&mut self, node: &Node, layout: Option<Layout>) -> Result<(), String> {
        node.fault().map_or(Ok(()), Err)?;
        self.enter(node.count)?;
        let index = self.len;
        self.len = index.checked_add(1).ok_or("is one too many: indices have 32 bits")?;
        match node.kind {
            NodeKind::Inner { high, .. } | NodeKind::Degenerate { high } => {
                if self.above.len() == MAX_DEPTH {
                    return Err(format!("is an inner node at depth {MAX_DEPTH}, deeper than trees get"));
                }
                if high <= self.len {
                    return Err(format!("has a high child {high}, which is not behind its low child {}", self.len));
                }
                self.above.push(Ancestor { high, on_high_side: false, points_left: node.count });
            }
            NodeKind::Leaf { start, .. } => {
                match layout {
                    Some(Layout::Files) if start.is_some() => return Err("has a start, but the layout is files".into()),
                    Some(Layout::Packed) if start.is_none() => {
                        return Err("has no start, but the layout is packed".into());
                    }
                    _ => {}
                }
                if start.is_none() && self.above.len() > MAX_NAMED_DEPTH {
                    return Err(format!("is a leaf at depth {}, too deep for a file name", self.above.len()));
                }
                // Whatever it is the last node of ends here; then comes the high side of the first ancestor that has
                // not had it.
                while self.above.pop_if(|a| a.on_high_side).is_some() {}
                if let Some(ancestor) = self.above.last_mut() {
                    ancestor.on_high_side = true;
                }
            }
        }
        Ok(())
    }

    /// Checks the next node, which has `count` points, against its parent.
    fn enter(&mut self, count: u64) -> Result<(), String> {
        let index = self.len;
        match self.above.last_mut() {
            None if index == 0 => Ok(()),
            None => Err("is no node's child: the tree is complete without it".into()),
            Some(parent) if parent.on_high_side => {
                if index != parent.high {
                    return Err(format!("stands where the high child {} of its parent has to be", parent.high));
                }
                let left = std::mem::take(&mut parent.points_left);
                if count != left {
                    return Err(format!("has {count} points, but its parent's count leaves {left} for it"));
                }
                Ok(())
            }
            Some(parent) => match parent.points_left.checked_sub(count) {
                Some(left @ 1..) => {
                    parent.points_left = left;
                    Ok(())
                }
                _ => Err(format!("has {count} points, and its parent, with a high side, has {}", parent.points_left)),
            },
        }
    }

    /// Checks that nothing is missing. What is wrong is a sentence.
    pub(super) fn finish(&self) -> Result<(), String> {
        match self.above.last() {
            None => Ok(()),
            Some(parent) => {
                let expected = if parent.on_high_side { parent.high } else { self.len };
                Err(format!("the nodes end at {}, but a node has the child {expected}", self.len))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;

    fn node(count: u64, high: Option<u32>) -> Node {
        let bounds = Aabb { min: [0.0; 3], max: [1.0; 3] };
        let leaf = NodeKind::Leaf { center: [0.5; 3], start: None };
        Node { bounds, count, kind: high.map_or(leaf, |high| NodeKind::Inner { axis: 0, split: 0.5, high }) }
    }

    /// Points, and the high child of an inner node.
    type Row = (u64, Option<u32>);

    /// The fault of the first node that does not fit, or of the end; the names of the leaves.
    fn fault_of(nodes: &[Row]) -> Result<Vec<String>, String> {
        let (mut order, mut names) = (Preorder::default(), Vec::new());
        for &(count, high) in nodes {
            if high.is_none() {
                names.push(order.file_name());
            }
            order.push(&node(count, high), None)?;
        }
        order.finish().map(|()| names)
    }

    #[test]
    fn a_tree_in_preorder_is_accepted_and_its_leaves_are_named_by_their_paths() {
        let tree = [(9, Some(4)), (4, Some(3)), (1, None), (3, None), (5, Some(6)), (2, None), (3, None)];
        assert_eq!(fault_of(&tree).unwrap(), ["n00.bin", "n01.bin", "n10.bin", "n11.bin"]);
        assert_eq!(fault_of(&[(1, None)]).unwrap(), ["n.bin"]);
        assert_eq!(fault_of(&[]).unwrap(), [""; 0]);
    }

    #[test]
    fn whatever_is_not_a_tree_in_preorder_is_refused() {
        let faults: [(&[Row], &str); 9] = [
            (&[(2, Some(0))], "high child 0"),
            (&[(2, Some(1))], "not behind its low child 1"),
            (&[(3, Some(3)), (1, None), (2, None)], "stands where the high child 3"),
            (&[(2, Some(2)), (1, None), (1, None), (1, None)], "is no node's child"),
            (&[(2, Some(2)), (1, None)], "the nodes end at 2, but a node has the child 2"),
            (&[(2, Some(2)), (2, None), (1, None)], "has 2 points, and its parent, with a high side, has 2"),
            (&[(3, Some(2)), (1, None), (1, None)], "leaves 2 for it"),
            (&[(0, None)], "has no points"),
            (&[(u64::MAX, Some(2)), (u64::MAX - 1, None), (2, None)], "leaves 1 for it"),
        ];
        for (nodes, expected) in faults {
            let fault = fault_of(nodes).unwrap_err();
            assert!(fault.contains(expected), "{nodes:?}: {fault}");
        }
    }

    #[test]
    fn a_chain_without_end_is_refused_and_one_of_the_greatest_depth_is_not() {
        let chain = |depth: u32| -> Vec<Node> {
            let inner = |i: u32| node(u64::from(depth - i + 1), Some(2 * depth - i));
            let leaves = (0..=depth)
                .map(|_| Node { kind: NodeKind::Leaf { center: [0.0; 3], start: Some(0) }, ..node(1, None) });
            (0..depth).map(inner).chain(leaves).collect()
        };
        let push_all = |nodes: &[Node]| {
            let mut order = Preorder::default();
            nodes.iter().try_for_each(|n| order.push(n, None)).and_then(|()| order.finish())
        };
        assert_eq!(push_all(&chain(MAX_DEPTH as u32)), Ok(()));
        assert!(push_all(&chain(MAX_DEPTH as u32 + 1)).unwrap_err().contains("depth 512"));
    }
}
