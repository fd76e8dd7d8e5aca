//! What is under the cursor.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

use crate::{Ray, ReadError};

use super::leaf_cache::{BLOCK_POINTS, CachedLeaf, LeafCache};
use super::{Bintree, NodeKind};

/// A point that a ray met.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Hit {
    /// World coordinates, as [`Bintree::read_leaf`] gives them.
    pub position: [f64; 3],
    /// Class as stored.
    pub class: f32,
    /// The node that the point is in.
    pub leaf: u32,
    /// Its index among the points of the leaf, in stored order.
    pub point: u32,
    /// Distance along the ray from its origin, world units.
    pub distance: f64,
    /// Distance from the ray, world units.
    pub off_ray: f64,
}

/// Finds the points that rays meet, and keeps leaves in memory from pick to pick.
///
/// ```
/// use pointmill_format::{NodePoints, bintree::{Bintree, Picker, Ray}};
/// use std::sync::Arc;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let tree = Arc::new(Bintree::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/bintree/packed"))?);
/// let (mut points, leaf) = (NodePoints::default(), tree.leaves().next().ok_or("no leaves")?);
/// tree.read_leaf(leaf, &mut points)?;
/// let [x, y, z] = points.world(0).ok_or("no points")?;
///
/// let mut picker = Picker::new(tree, 512 << 20);
/// let from_above = Ray::new([x, y, z + 100.0], [0.0, 0.0, -1.0], 0.05).ok_or("not a ray")?;
/// let hit = picker.pick(&from_above)?.ok_or("nothing under the cursor")?;
/// assert!(hit.distance <= 100.0 && hit.off_ray <= 0.05);
/// println!("{:?} of class {}", hit.position, hit.class);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Picker {
    tree: Arc<Bintree>,
    cache: LeafCache,
}

impl Picker {
    /// A picker whose leaves take at most `cache_bytes` of memory (but at least one leaf): 16 bytes per point and
    /// a little.
    #[must_use]
    pub fn new(tree: Arc<Bintree>, cache_bytes: usize) -> Self {
        Self { tree, cache: LeafCache::new(cache_bytes) }
    }

    /// The point that `ray` meets first: of those within its width the one of the least distance along it; of several,
    /// the one nearest to the ray, then the one of the lowest leaf and index.
    ///
    /// Visits boxes in the order in which the ray enters them and stops when none can hold a nearer point.
    ///
    /// # Errors
    /// A leaf that cannot be read ([`Bintree::read_leaf`]).
    pub fn pick(&mut self, ray: &Ray) -> Result<Option<Hit>, ReadError> {
        let mut best = None;
        // Distances are positive: their bits are ordered as they are.
        let mut queue = BinaryHeap::new();
        let enter = |index: u32| {
            let distance = ray.enter(&self.tree.node(index)?.bounds)?;
            Some(Reverse((distance.to_bits(), index)))
        };
        queue.extend(enter(0));
        while let Some(Reverse((distance, index))) = queue.pop() {
            if best.as_ref().is_some_and(|hit: &Hit| f64::from_bits(distance) > hit.distance) {
                break;
            }
            match self.tree.children(index) {
                Some(children) => queue.extend(children.into_iter().filter_map(enter)),
                None => {
                    let leaf = self.cache.get(&self.tree, index)?;
                    if let Some(node) = self.tree.node(index)
                        && let NodeKind::Leaf { center, .. } = node.kind
                    {
                        scan(ray, &leaf, index, center, &mut best);
                    }
                }
            }
        }
        Ok(best)
    }

    /// Bytes of leaves in memory.
    pub fn cached_bytes(&self) -> usize {
        self.cache.bytes()
    }
}

/// Looks for a better hit in a leaf: block by block, points only of blocks that the ray meets early enough.
fn scan(ray: &Ray, leaf: &CachedLeaf, index: u32, center: [f64; 3], best: &mut Option<Hit>) {
    for (block, bounds) in leaf.block_bounds.iter().enumerate() {
        let nearest = best.as_ref().map_or(f64::INFINITY, |hit| hit.distance);
        if !ray.enter(bounds).is_some_and(|t| t <= nearest) {
            continue;
        }
        let first = block * BLOCK_POINTS;
        for (i, &[x, y, z, class]) in leaf.points.iter().enumerate().skip(first).take(BLOCK_POINTS) {
            let position = super::encode::decode(center, [x, y, z]);
            let nearest = best.as_ref().map_or(f64::INFINITY, |hit| hit.distance);
            let Some((distance, away2)) = ray.meet(position, nearest) else { continue };
            let hit = Hit { position, class, leaf: index, point: i as u32, distance, off_ray: away2.sqrt() };
            if best.as_ref().is_none_or(|best| hit.is_before(best)) {
                *best = Some(hit);
            }
        }
    }
}

impl Hit {
    fn is_before(&self, other: &Self) -> bool {
        let order = self.distance.total_cmp(&other.distance).then(self.off_ray.total_cmp(&other.off_ray));
        order.then((self.leaf, self.point).cmp(&(other.leaf, other.point))).is_lt()
    }
}
