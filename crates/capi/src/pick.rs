//! What is under the cursor.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::mem::MaybeUninit;
use std::sync::PoisonError;

use pointmill_format::{NodeKey, Ray};

use crate::border::{given, put};
use crate::dataset::{Content, PM_NO_NODE, PmDataset};
use crate::decode::Decoder;
use crate::nodes::record_bounds;
use crate::octree::Tree;
use crate::status::{Fault, Outcome, PmStatus, guard};

/// A ray that is wide enough to meet points, world units, in the axes of the handle: it meets all that lies within
/// `radius + spread · distance` of it.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmRay {
    /// Where it begins.
    pub origin: [f64; 3],
    /// Where it goes, of any length > 0.
    pub direction: [f64; 3],
    /// Its radius at the origin, ≥ 0.
    pub radius: f64,
    /// What its radius gains per unit of distance, ≥ 0: for a tolerance of n pixels n · tan(fov / height).
    pub spread: f64,
}

/// A point that a ray met.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmHit {
    /// Where the point is, in the axes of the handle.
    pub position: [f64; 3],
    /// Along the ray from its origin, world units.
    pub distance: f64,
    /// From the ray, world units.
    pub off_ray: f64,
    /// Its number among the points of the node, as pm_decode() gives them.
    pub point: u64,
    /// The node.
    pub node: u32,
    /// 1 if a point was met; else nothing of this has a meaning.
    pub found: u32,
}

const NOTHING: PmHit = PmHit { position: [0.0; 3], distance: 0.0, off_ray: 0.0, point: 0, node: PM_NO_NODE, found: 0 };

impl PmHit {
    /// In the order in which hits are preferred.
    fn is_before(&self, other: &Self) -> bool {
        let order = self.distance.total_cmp(&other.distance).then(self.off_ray.total_cmp(&other.off_ray));
        other.found == 0 || order.then((self.node, self.point).cmp(&(other.node, other.point))).is_lt()
    }
}

/// The nodes that a ray enters, the first to be entered on top.
type Queue = BinaryHeap<Reverse<(u64, u32)>>;

/// Distances are positive: their bits are ordered as they are.
fn push(queue: &mut Queue, distance: Option<f64>, node: u32) {
    queue.extend(distance.map(|distance| Reverse((distance.to_bits(), node))));
}

impl PmDataset {
    /// The first hit, in the axes of the file.
    fn pick(&self, ray: &Ray) -> Outcome<PmHit> {
        let mut queue = Queue::new();
        match &self.content {
            Content::Bintree(leaves) => {
                let mut picker = leaves.picker.lock().unwrap_or_else(PoisonError::into_inner);
                let hit = picker.pick(ray)?;
                return Ok(hit.map_or(NOTHING, |hit| PmHit {
                    position: hit.position,
                    distance: hit.distance,
                    off_ray: hit.off_ray,
                    point: hit.point.into(),
                    node: hit.leaf,
                    found: 1,
                }));
            }
            Content::Octree(tree) => push(&mut queue, ray.enter(&tree.octree.info().cube), 0),
            Content::Batches(batches) => {
                for (slot, record) in (0u32..).zip(batches.records()) {
                    push(&mut queue, ray.enter(&record_bounds(batches, record)), slot);
                }
            }
        }
        let (mut best, mut decoder) = (NOTHING, Decoder::default());
        while let Some(Reverse((distance, node))) = queue.pop() {
            if best.found == 1 && f64::from_bits(distance) > best.distance {
                break;
            }
            if let Content::Octree(tree) = &self.content {
                open_children(tree, ray, node, &mut queue)?;
            }
            decoder.decode(self, node, 0)?;
            meet(ray, &decoder, node, &mut best);
        }
        Ok(best)
    }
}

/// Adds the children of a node that the ray enters; a proxy is read first.
fn open_children(tree: &Tree, ray: &Ray, node: u32, queue: &mut Queue) -> Outcome {
    if let Some((proxy, _)) = tree.node(node) {
        tree.load(&proxy)?;
    }
    for child in tree.children(node) {
        let key: Option<NodeKey> = tree.node(child).map(|(node, _)| node.key);
        push(queue, key.and_then(|key| ray.enter(&tree.octree.info().node_box(key))), child);
    }
    Ok(())
}

/// Looks for a better hit among decoded points.
fn meet(ray: &Ray, decoder: &Decoder, node: u32, best: &mut PmHit) {
    for i in 0..decoder.points.len() {
        let nearest = if best.found == 1 { best.distance } else { f64::INFINITY };
        let Some(position) = decoder.points.world(i) else { return };
        let Some((distance, away2)) = ray.meet(position, nearest) else { continue };
        let hit = PmHit { position, distance, off_ray: away2.sqrt(), point: i as u64, node, found: 1 };
        if hit.is_before(best) {
            *best = hit;
        }
    }
}

/// The point that `ray` meets first: of those within its width the one of the least distance along it; of several, the one
/// nearest to the ray, then the one of the lowest node and point. All points of the dataset count, drawn or not.
///
/// `*hit` is overwritten; PmHit::found says whether there is one. Boxes are visited in the order in which the ray enters
/// them. Leaves of a binary tree are kept in memory from pick to pick (64 MB); of octrees and batches what the ray enters
/// is decoded each time, some milliseconds per node: for a click, not for each frame. Any thread; picks of a binary tree
/// wait for each other.
#[unsafe(no_mangle)]
pub extern "C" fn pm_pick(
    dataset: Option<&PmDataset>,
    ray: Option<&PmRay>,
    hit: Option<&mut MaybeUninit<PmHit>>,
) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        let hit = hit.ok_or_else(|| Fault::null("hit"))?;
        let given = given(ray, "ray")?;
        let [origin, direction] = [given.origin, given.direction].map(|v| dataset.axes.inward(v));
        let ray = Ray::new(origin, direction, given.radius).filter(|_| given.spread.is_finite() && given.spread >= 0.0);
        let ray = ray.ok_or_else(|| Fault::argument(format!("{given:?} is no ray")))?.with_spread(given.spread);
        let mut found = dataset.pick(&ray)?;
        found.position = dataset.axes.outward(found.position);
        put(Some(hit), "hit", found)
    })
}
