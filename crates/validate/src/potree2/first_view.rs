//! What a viewer loads at first, by a simple model: the camera sees the whole cloud, nodes come by level, in a level
//! those with most points first. Real viewers order nodes by their size on the screen, which is nearly the same then.

use std::cmp::Reverse;

use pointmill_format::potree2::Metadata;

use super::tree::{Tree, TreeNode};
use crate::outcome::FirstView;

/// Points that viewers show by default.
const BUDGET: u64 = 1_000_000;

/// Of a dataset whose `metadata.json` has so many bytes; `None` without a root.
pub(crate) fn measure(tree: &Tree, metadata: &Metadata, metadata_bytes: u64) -> Option<FirstView> {
    let root = tree.nodes.first()?;
    let mut order: Vec<&TreeNode> = tree.nodes.iter().collect();
    order.sort_by_key(|n| (n.key.level, Reverse(n.record.points)));
    let mut view = FirstView {
        root_points: u64::from(root.record.points),
        cube_over_extent: cube_over_extent(metadata),
        first_chunk_bytes: metadata.first_chunk_size,
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

fn cube_over_extent(metadata: &Metadata) -> Option<f64> {
    let position = metadata.attributes.iter().find(|a| a.attribute.name == "position")?;
    let extent = position.min.iter().zip(&position.max).map(|(min, max)| max - min).fold(0.0, f64::max);
    (extent > 0.0).then(|| (metadata.cube.max[0] - metadata.cube.min[0]) / extent)
}
