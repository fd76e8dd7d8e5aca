//! What a viewer loads at first, by a simple model: the camera sees the whole cloud, nodes come by level, in a level
//! those with most points first. Real viewers order nodes by their size on the screen, which is nearly the same then.

use std::cmp::Reverse;

use super::tree::{Tree, TreeNode};
use crate::outcome::FirstView;

/// Points that viewers show by default.
const BUDGET: u64 = 1_000_000;

/// Of a dataset whose description has so many bytes, and whose cube is so much longer than the longest side of its points'
/// box; `None` without a root.
pub(crate) fn measure(tree: &Tree, metadata_bytes: u64, cube_over_extent: Option<f64>) -> Option<FirstView> {
    let root = tree.nodes.first()?;
    let mut order: Vec<&TreeNode> = tree.nodes.iter().collect();
    order.sort_by_key(|n| (n.key.level, Reverse(n.record.points)));
    let mut view = FirstView {
        root_points: u64::from(root.record.points),
        cube_over_extent,
        first_chunk_bytes: root.chunk_bytes,
        points: 0,
        nodes: 0,
        requests: 1,
        bytes: metadata_bytes,
    };
    for node in order {
        if view.points >= BUDGET {
            break;
        }
        view.points += u64::from(node.record.points);
        view.nodes += 1;
        // a node that begins a chunk is located by it
        view.requests += 1 + u64::from(node.chunk_bytes > 0);
        view.bytes = view.bytes.saturating_add(node.record.byte_size).saturating_add(node.chunk_bytes);
    }
    Some(view)
}
