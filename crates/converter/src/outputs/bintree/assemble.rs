//! Upper nodes and subtrees put together, and the figures of the whole tree.

use pointmill_format::Aabb;
use pointmill_format::bintree::{Node, NodeKind};

use super::subtree::Built;
use super::upper::Upper;
use crate::report::TreeReport;

/// A node above the subtrees, until what is below it is complete.
struct Open {
    node: usize,
    waits_for_high: bool,
}

/// Puts the upper nodes and the subtrees together, in preorder.
pub(super) fn assemble(upper: &Upper, built: Vec<Built>) -> Vec<Node> {
    let mut nodes: Vec<Node> =
        Vec::with_capacity(upper.splits.len() + built.iter().map(|b| b.nodes.len()).sum::<usize>());
    let mut open: Vec<Open> = Vec::new();
    let mut built = built.into_iter();
    for entry in &upper.splits {
        if let Some(split) = entry {
            open.push(Open { node: nodes.len(), waits_for_high: false });
            let kind = NodeKind::Inner { axis: split.axis, split: split.plane, high: 0 };
            nodes.push(Node::new(Aabb::EMPTY, split.points, kind));
            continue;
        }
        let first = nodes.len();
        let Some(subtree) = built.next() else { break };
        nodes.extend(subtree.nodes.into_iter().map(|node| moved(node, first as u32)));
        let mut bounds = nodes.get(first).map_or(Aabb::EMPTY, |n| n.bounds);
        // Whatever is complete now gives its box to the node above.
        while let Some(top) = open.last_mut() {
            let above = &mut nodes[top.node].bounds;
            *above = above.union(&bounds);
            bounds = *above;
            if !top.waits_for_high {
                top.waits_for_high = true;
                let next = nodes.len() as u32;
                if let NodeKind::Inner { high, .. } = &mut nodes[top.node].kind {
                    *high = next;
                }
                break;
            }
            open.pop();
        }
    }
    nodes
}

/// A node of a subtree whose first node gets the index `by`.
fn moved(mut node: Node, by: u32) -> Node {
    if let NodeKind::Inner { high, .. } | NodeKind::Degenerate { high } = &mut node.kind {
        *high += by;
    }
    node
}

/// Counts by depth, and the figures that the choice of a splitting rule is judged by.
pub(super) fn figures(nodes: &[Node]) -> (TreeReport, serde_json::Map<String, serde_json::Value>) {
    let mut tree = TreeReport { nodes: nodes.len() as u64, ..TreeReport::default() };
    let (mut leaves, mut smallest, mut volume, mut degenerate) = (0u64, u64::MAX, 0.0, 0u64);
    let mut depth_of = vec![0usize; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        let depth = depth_of[i];
        if let Some(high) = node.high() {
            for child in [i + 1, high as usize] {
                if let Some(d) = depth_of.get_mut(child) {
                    *d = depth + 1;
                }
            }
            degenerate += u64::from(matches!(node.kind, NodeKind::Degenerate { .. }));
        }
        if tree.nodes_per_level.len() <= depth {
            tree.nodes_per_level.resize(depth + 1, 0);
            tree.points_per_level.resize(depth + 1, 0);
        }
        tree.nodes_per_level[depth] += 1;
        if node.is_leaf() {
            tree.points_per_level[depth] += node.count;
            tree.largest_leaf = tree.largest_leaf.max(node.count);
            smallest = smallest.min(node.count);
            leaves += 1;
            volume += node.bounds.extent().iter().product::<f64>();
        }
    }
    tree.depth = tree.nodes_per_level.len().saturating_sub(1) as u32;
    let points: u64 = tree.points_per_level.iter().sum();
    let details = serde_json::json!({
        "leaves": leaves,
        "smallest_leaf": if leaves == 0 { 0 } else { smallest },
        "mean_leaf": points as f64 / leaves.max(1) as f64,
        "leaf_volume": volume,
        "degenerate_nodes": degenerate,
    });
    (tree, details.as_object().cloned().unwrap_or_default())
}
