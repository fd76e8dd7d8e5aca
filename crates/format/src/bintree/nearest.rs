//! Nearest neighbours across leaves, for programs that analyse rather than draw.

use std::collections::BinaryHeap;
use std::sync::Arc;

use rstar::{AABB, PointDistance, RTree, RTreeObject};

use crate::{Aabb, ReadError};

use super::encode::decode;
use super::leaf_cache::{BLOCK_POINTS, LeafCache};
use super::{Bintree, NodeKind};

/// A leaf in an R*-tree: its tight box and its index.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LeafBox {
    /// World coordinates.
    pub bounds: Aabb,
    /// The node.
    pub leaf: u32,
}

impl RTreeObject for LeafBox {
    type Envelope = AABB<[f64; 3]>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_corners(self.bounds.min, self.bounds.max)
    }
}

impl PointDistance for LeafBox {
    fn distance_2(&self, point: &[f64; 3]) -> f64 {
        squared_distance(&self.bounds, *point)
    }
}

/// A point near another one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Neighbour {
    /// World coordinates, as [`Bintree::read_leaf`] gives them.
    pub position: [f64; 3],
    /// Class as stored.
    pub class: f32,
    /// The node that the point is in.
    pub leaf: u32,
    /// Its index among the points of the leaf, in stored order.
    pub point: u32,
    /// Squared distance, world units.
    pub distance2: f64,
}

impl Eq for Neighbour {}

impl Ord for Neighbour {
    /// By distance, then leaf, then index.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.distance2.total_cmp(&other.distance2).then((self.leaf, self.point).cmp(&(other.leaf, other.point)))
    }
}

impl PartialOrd for Neighbour {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Finds the nearest points to any place, whatever leaves they are in, and keeps leaves in memory.
///
/// The leaves' boxes are in an R*-tree, which can also be queried directly: [`Self::leaf_boxes`].
#[derive(Debug)]
pub struct NearestPoints {
    tree: Arc<Bintree>,
    boxes: RTree<LeafBox>,
    cache: LeafCache,
}

impl NearestPoints {
    /// Loads the boxes of all leaves. Leaves take at most `cache_bytes` of memory (but at least one leaf): 16 bytes
    /// per point and a little.
    #[must_use]
    pub fn new(tree: Arc<Bintree>, cache_bytes: usize) -> Self {
        let leaf_box = |leaf| Some(LeafBox { bounds: tree.node(leaf)?.bounds, leaf });
        let boxes = RTree::bulk_load(tree.leaves().filter_map(leaf_box).collect());
        Self { boxes, tree, cache: LeafCache::new(cache_bytes) }
    }

    /// The boxes of all leaves, for other queries.
    pub fn leaf_boxes(&self) -> &RTree<LeafBox> {
        &self.boxes
    }

    /// The `count` points nearest to `place` (world coordinates), nearest first; of equally far ones those of the lowest
    /// leaf and index. Fewer if there are not enough within `max_distance` (world units, may be infinite).
    ///
    /// # Errors
    /// A leaf that cannot be read ([`Bintree::read_leaf`]).
    pub fn nearest(&mut self, place: [f64; 3], count: usize, max_distance: f64) -> Result<Vec<Neighbour>, ReadError> {
        // The farthest of those found is on top.
        let mut found = BinaryHeap::new();
        let limit2 = max_distance * max_distance;
        if count == 0 || max_distance.is_nan() || max_distance < 0.0 || place.iter().any(|v| !v.is_finite()) {
            return Ok(Vec::new());
        }
        for (leaf, distance2) in self.boxes.nearest_neighbor_iter_with_distance_2(place) {
            if distance2 > bound(&found, count, limit2) {
                break;
            }
            let Some(NodeKind::Leaf { center, .. }) = self.tree.node(leaf.leaf).map(|n| n.kind) else { continue };
            let points = self.cache.get(&self.tree, leaf.leaf)?;
            let blocks = points.block_bounds.iter().zip(points.points.chunks(BLOCK_POINTS));
            for (block, (bounds, records)) in blocks.enumerate() {
                if squared_distance(bounds, place) > bound(&found, count, limit2) {
                    continue;
                }
                for (i, &[x, y, z, class]) in records.iter().enumerate() {
                    let position = decode(center, [x, y, z]);
                    let distance2 = squared_length([0, 1, 2].map(|a| position[a] - place[a]));
                    let point = (block * BLOCK_POINTS + i) as u32;
                    let neighbour = Neighbour { position, class, leaf: leaf.leaf, point, distance2 };
                    // Not a number is near nothing.
                    if distance2 <= limit2 {
                        keep(&mut found, neighbour, count);
                    }
                }
            }
        }
        Ok(found.into_sorted_vec())
    }
}

/// Adds `neighbour` if it is among the nearest `count`.
fn keep(found: &mut BinaryHeap<Neighbour>, neighbour: Neighbour, count: usize) {
    if found.len() == count {
        if found.peek().is_none_or(|farthest| *farthest <= neighbour) {
            return;
        }
        found.pop();
    }
    found.push(neighbour);
}

/// The squared distance beyond which nothing is wanted any more.
fn bound(found: &BinaryHeap<Neighbour>, count: usize, limit2: f64) -> f64 {
    found.peek().filter(|_| found.len() == count).map_or(limit2, |farthest| farthest.distance2)
}

fn squared_distance(bounds: &Aabb, p: [f64; 3]) -> f64 {
    squared_length([0, 1, 2].map(|a| (bounds.min[a] - p[a]).max(p[a] - bounds.max[a]).max(0.0)))
}

fn squared_length(v: [f64; 3]) -> f64 {
    v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
}
