//! Leaves in memory, ready to be picked from.

use std::collections::HashMap;
use std::sync::Arc;

use crate::{Aabb, ReadError};

use super::encode::decode;
use super::leaf_points::core;
use super::{Bintree, NodeKind};

/// Points that share a box. They are neighbours in Morton order, so the box is small: a ray that passes through a leaf
/// of 65,000 points meets a few of its 254 boxes.
pub(super) const BLOCK_POINTS: usize = 256;

/// What picking needs of a leaf.
#[derive(Debug)]
pub(super) struct CachedLeaf {
    /// Offset from the center, class.
    pub(super) points: Vec<[f32; 4]>,
    /// Boxes of the decoded points of each block, world coordinates.
    pub(super) block_bounds: Vec<Aabb>,
}

impl CachedLeaf {
    fn new(records: &[u8], stride: usize, center: [f64; 3]) -> Self {
        let point = |record| core(record).map(|([x, y, z], class)| [x, y, z, class]);
        let points: Vec<[f32; 4]> = records.chunks_exact(stride).filter_map(point).collect();
        let bounds = |block: &[[f32; 4]]| {
            let mut bounds = Aabb::EMPTY;
            block.iter().for_each(|&[x, y, z, _]| bounds.grow(decode(center, [x, y, z])));
            bounds
        };
        let block_bounds = points.chunks(BLOCK_POINTS).map(bounds).collect();
        Self { points, block_bounds }
    }

    fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(&self.points[..]) + size_of_val(&self.block_bounds[..])
    }
}

/// Leaves that were used last, within a limit of memory.
#[derive(Debug)]
pub(super) struct LeafCache {
    /// Each with the time it was last used at.
    leaves: HashMap<u32, (u64, Arc<CachedLeaf>)>,
    limit: usize,
    bytes: usize,
    clock: u64,
    records: Vec<u8>,
}

impl LeafCache {
    pub(super) fn new(limit: usize) -> Self {
        Self { leaves: HashMap::new(), limit, bytes: 0, clock: 0, records: Vec::new() }
    }

    pub(super) fn bytes(&self) -> usize {
        self.bytes
    }

    /// The leaf `index` of `tree`, which has to be the same tree every time.
    pub(super) fn get(&mut self, tree: &Bintree, index: u32) -> Result<Arc<CachedLeaf>, ReadError> {
        self.clock += 1;
        if let Some((last_used, leaf)) = self.leaves.get_mut(&index) {
            *last_used = self.clock;
            return Ok(Arc::clone(leaf));
        }
        let leaf = Arc::new(self.load(tree, index)?);
        self.make_room(leaf.bytes());
        self.bytes += leaf.bytes();
        self.leaves.insert(index, (self.clock, Arc::clone(&leaf)));
        Ok(leaf)
    }

    fn load(&mut self, tree: &Bintree, index: u32) -> Result<CachedLeaf, ReadError> {
        tree.read_leaf_bytes(index, &mut self.records)?;
        let center = match tree.node(index).map(|n| n.kind) {
            Some(NodeKind::Leaf { center, .. }) => center,
            _ => [0.0; 3],
        };
        Ok(CachedLeaf::new(&self.records, tree.header().record.stride(), center))
    }

    /// Drops the leaves that were not used for longest.
    fn make_room(&mut self, bytes: usize) {
        while self.bytes + bytes > self.limit {
            let oldest = self.leaves.iter().min_by_key(|(_, (last_used, _))| last_used).map(|(index, _)| *index);
            let Some((_, leaf)) = oldest.and_then(|index| self.leaves.remove(&index)) else { break };
            self.bytes -= leaf.bytes();
        }
    }
}
