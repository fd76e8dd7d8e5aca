//! What there is to draw: nodes of an octree by their masks, leaves and batches by their boxes.

use pointmill_format::Aabb;
use pointmill_format::octree::OctreeNode;

const MAGIC: [u8; 4] = *b"PMN1";

/// Flag of a node whose chunk is to be requested.
const PROXY: u8 = 1;

/// A part of the hierarchy: 8 bytes per node.
pub(crate) fn nodes(nodes: &[OctreeNode]) -> Vec<u8> {
    let mut out = begin(nodes.len(), 8);
    for node in nodes {
        out.extend_from_slice(&u32::try_from(node.points).unwrap_or(u32::MAX).to_le_bytes());
        let mask = if node.is_proxy { 0 } else { node.child_mask };
        out.extend_from_slice(&[mask, if node.is_proxy { PROXY } else { 0 }, 0, 0]);
    }
    out
}

/// A leaf of a binary tree or a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BoxRow {
    /// World coordinates.
    pub(crate) bounds: Aabb,
    pub(crate) points: u32,
    /// What it is requested by: the leaf's index in preorder, the batch's slot.
    pub(crate) unit: u32,
    /// Of a batch: points of level 0, of at most 1, 2, 3.
    pub(crate) by_level: [u16; 4],
}

/// Leaves or batches: 64 bytes each.
pub(crate) fn boxes(rows: impl ExactSizeIterator<Item = BoxRow>) -> Vec<u8> {
    let mut out = begin(rows.len(), 64);
    for BoxRow { bounds, points, unit, by_level } in rows {
        bounds.min.iter().chain(&bounds.max).for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        out.extend_from_slice(&points.to_le_bytes());
        out.extend_from_slice(&unit.to_le_bytes());
        by_level.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    }
    out
}

fn begin(count: usize, size: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(8 + count * size);
    out.extend_from_slice(&MAGIC);
    out.extend_from_slice(&u32::try_from(count).unwrap_or(u32::MAX).to_le_bytes());
    out
}
