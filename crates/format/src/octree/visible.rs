//! Which nodes of an octree a picture shows: those in sight that are large in it, as many as a budget allows.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::geometry::vectors::{dot, length, minus, unit};
use crate::{Aabb, Frustum, NodeKey, ReadError};

use super::{Octree, OctreeNode};

/// What a walk must know of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewpoint {
    eye: [f64; 3],
    /// Of length 1.
    forward: [f64; 3],
    focal: f64,
    frustum: Frustum,
}

impl Viewpoint {
    /// `eye`: world coordinates. `forward`: the direction of view, of any length > 0. `focal`: pixels per unit at a depth of one
    /// unit ([`crate::batches::focal_pixels`]). What `frustum` does not contain is not in the picture.
    #[must_use]
    pub fn new(eye: [f64; 3], forward: [f64; 3], focal: f64, frustum: Frustum) -> Self {
        Self { eye, forward: unit(forward), focal, frustum }
    }

    /// False if nothing of the box is in the picture.
    #[must_use]
    pub fn may_see(&self, bounds: &Aabb) -> bool {
        self.frustum.may_see(bounds)
    }

    /// Of the sphere around a box: its radius in the picture, in pixels, infinite from inside; and the angle between its
    /// centre and the direction of view, radians.
    #[must_use]
    pub fn sphere(&self, bounds: &Aabb) -> [f64; 2] {
        let to = minus(bounds.center(), self.eye);
        let (radius, distance) = (length(bounds.extent()) / 2.0, length(to));
        // written so that what is not a number counts as inside
        if !(distance >= radius && distance > 0.0) {
            return [f64::INFINITY, 0.0];
        }
        let angle = (dot(to, self.forward) / distance).clamp(-1.0, 1.0).acos();
        [radius * self.focal / distance, angle]
    }
}

/// Which nodes come first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// By the radius of the node's sphere in the picture (Potree 1.8).
    Radius,
    /// By that radius, divided by one plus the angle to the direction of view in radians (Fraiss, "Rendering Large Point
    /// Clouds in Unity", 2017).
    RadiusAndAngle,
}

/// How much of an octree a picture shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Selection {
    /// Points, at most; the root is shown whatever the budget is.
    pub budget: u64,
    /// Which nodes come first.
    pub order: Order,
    /// Nodes whose sphere has a smaller radius in the picture, in pixels, are not shown; the root always is.
    pub min_node_pixels: f64,
}

/// A node that is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct VisibleNode {
    /// The node; a proxy if the walk was not given what is below it.
    pub node: OctreeNode,
    /// Points of the node alone; 0 of a proxy.
    pub points: u64,
    /// Its parent's place in the list.
    pub parent: Option<usize>,
    /// Radius of its sphere in the picture, pixels; infinite from inside.
    pub pixels: f64,
}

/// A node that may be shown, in a heap: the most urgent first.
struct Candidate {
    weight: f64,
    pixels: f64,
    key: NodeKey,
    parent: Option<usize>,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        // of two that weigh the same, as from inside of both, the coarser one, then the one of the lesser address
        self.weight.total_cmp(&other.weight).then_with(|| other.key.cmp(&self.key))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

/// Walks the tree as viewers do, until a node does not fit the budget any more: the nodes to show, the most urgent first,
/// each behind its parent.
///
/// `node` gives the node of an address, and decides what is read: [`super::OctreeNodes::load`] first reads the chunk of a
/// proxy; a proxy that it returns is listed, without points and what is below.
///
/// ```
/// use pointmill_format::octree::{OctreeNodes, Order, Selection, Viewpoint, visible_nodes};
/// use pointmill_format::{Frustum, batches::focal_pixels, open_octree};
///
/// # fn main() -> Result<(), pointmill_format::ReadError> {
/// let octree = open_octree(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree2/default"))?;
/// let cube = octree.info().cube;
/// let (eye, ahead, fov) = ([cube.center()[0], cube.min[1] - 100.0, cube.center()[2]], [0.0, 1.0, 0.0], 1.0);
/// let frustum = Frustum::perspective(eye, ahead, [0.0, 0.0, 1.0], fov, 16.0 / 9.0, [0.1, 1e4]);
/// let view = Viewpoint::new(eye, ahead, focal_pixels(1080.0, fov), frustum);
/// let wanted = Selection { budget: 1_000_000, order: Order::RadiusAndAngle, min_node_pixels: 30.0 };
/// let mut known = OctreeNodes::new(&*octree)?;
/// let shown = visible_nodes(&*octree, &view, &wanted, |key| {
///     known.load(&*octree, key)?;
///     Ok(known.get(key).copied())
/// })?;
/// println!("{} nodes, {} points", shown.len(), shown.iter().map(|node| node.points).sum::<u64>());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Those of `node`, and of [`Octree::count`].
pub fn visible_nodes(
    octree: &dyn Octree,
    view: &Viewpoint,
    wanted: &Selection,
    mut node: impl FnMut(NodeKey) -> Result<Option<OctreeNode>, ReadError>,
) -> Result<Vec<VisibleNode>, ReadError> {
    let info = octree.info();
    let pixels = view.sphere(&info.cube)[0];
    let root = Candidate { weight: f64::INFINITY, pixels, key: NodeKey::ROOT, parent: None };
    let (mut shown, mut heap, mut total) = (Vec::new(), BinaryHeap::from([root]), 0u64);
    while let Some(Candidate { key, parent, pixels, .. }) = heap.pop() {
        if !view.may_see(&info.node_box(key)) {
            continue;
        }
        let Some(found) = node(key)? else { continue };
        let points = if found.is_proxy { 0 } else { octree.count(&found)? };
        total = total.saturating_add(points);
        if total > wanted.budget && key != NodeKey::ROOT {
            break;
        }
        let index = shown.len();
        shown.push(VisibleNode { node: found, points, parent, pixels });
        for child in (0..8).filter(|child| found.has_child(*child)).filter_map(|child| key.child(child)) {
            let [pixels, angle] = view.sphere(&info.node_box(child));
            let weight = match wanted.order {
                Order::Radius => pixels,
                Order::RadiusAndAngle => pixels / (1.0 + angle),
            };
            if pixels >= wanted.min_node_pixels {
                heap.push(Candidate { weight, pixels, key: child, parent: Some(index) });
            }
        }
    }
    Ok(shown)
}

#[cfg(test)]
mod tests {
    use super::super::OctreeNodes;
    use super::*;
    use crate::batches::focal_pixels;
    use crate::open_octree;

    fn octree() -> Box<dyn Octree> {
        open_octree(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree2/default")).unwrap()
    }

    /// From the south of the cube to its middle.
    fn view(octree: &dyn Octree, ahead: f64) -> Viewpoint {
        let (cube, forward) = (octree.info().cube, [0.0, ahead, 0.0]);
        let eye = [cube.center()[0], cube.min[1] - cube.extent()[1], cube.center()[2]];
        let frustum = Frustum::perspective(eye, forward, [0.0, 0.0, 1.0], 1.2, 1.0, [0.0, 1e9]);
        Viewpoint::new(eye, forward, focal_pixels(1000.0, 1.2), frustum)
    }

    const ALL: Selection = Selection { budget: u64::MAX, order: Order::Radius, min_node_pixels: 0.0 };

    fn shown(octree: &dyn Octree, view: &Viewpoint, wanted: &Selection) -> Vec<VisibleNode> {
        let mut known = OctreeNodes::new(octree).unwrap();
        let node = |key| known.load(octree, key).map(|_| known.get(key).copied());
        visible_nodes(octree, view, wanted, node).unwrap()
    }

    #[test]
    fn all_nodes_are_shown_parents_first_and_a_budget_ends_the_walk() {
        let octree = octree();
        let view = view(&*octree, 1.0);
        let all = shown(&*octree, &view, &ALL);
        assert_eq!(Some(all.iter().map(|n| n.points).sum()), octree.info().points);
        for (i, node) in all.iter().enumerate() {
            let parent = node.parent.map(|p| (p < i, all[p].node.key));
            assert_eq!(parent, node.node.key.parent().map(|key| (true, key)));
            assert_eq!(node.pixels, view.sphere(&octree.info().node_box(node.node.key))[0]);
        }
        let budget = all[..2].iter().map(|n| n.points).sum();
        assert_eq!(shown(&*octree, &view, &Selection { budget, ..ALL }), all[..2]);
        assert_eq!(shown(&*octree, &view, &Selection { budget: 0, ..ALL }), all[..1], "the root always");
    }

    #[test]
    fn nothing_is_shown_behind_and_little_of_what_is_small() {
        let octree = octree();
        assert_eq!(shown(&*octree, &view(&*octree, -1.0), &ALL), []);
        let large = Selection { min_node_pixels: 1e9, ..ALL };
        assert_eq!(shown(&*octree, &view(&*octree, 1.0), &large).len(), 1);
    }

    #[test]
    fn a_proxy_that_is_not_read_is_listed_without_points() {
        let octree = octree();
        let root = octree.root();
        let node = |key| Ok((key == root.key).then_some(root));
        let found = visible_nodes(&*octree, &view(&*octree, 1.0), &ALL, node).unwrap();
        assert!(matches!(found[..], [VisibleNode { node: OctreeNode { is_proxy: true, .. }, points: 0, .. }]));
    }
}
