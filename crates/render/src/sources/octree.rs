//! What is drawn of an octree: the nodes in sight that are large in the picture, as many as the budget allows.

use pointmill_format::octree::{Octree, OctreeNode, OctreeNodes, Selection, VisibleNode, visible_nodes};
use pointmill_format::{Attribute, ReadError};

use crate::projection::Projection;
use crate::{PointSize, Style};

use super::{Buffers, Points, Source, Take, Unit, UnitSize};

/// No node.
const NONE: u32 = u32::MAX;

/// Points of a leaf are at most this many times as large as those of an inner node of its level.
const LARGEST_IN_LEAF: f64 = 4.0;

/// A node that is drawn.
struct Drawn {
    node: OctreeNode,
    points: u64,
    /// Distance between the points that are drawn there, world units.
    spacing: f32,
    /// The nodes drawn below it, by child index.
    children: [u32; 8],
}

/// The chosen nodes of an octree.
pub(crate) struct OctreeSource<'a> {
    octree: &'a dyn Octree,
    nodes: Vec<Drawn>,
    size: PointSize,
}

impl<'a> OctreeSource<'a> {
    /// The nodes that viewers draw ([`visible_nodes`]).
    ///
    /// # Errors
    /// Those of reading the index.
    pub(crate) fn new(
        octree: &'a dyn Octree,
        projection: &Projection,
        style: &Style,
        budget: u64,
    ) -> Result<Self, ReadError> {
        let mut source = Self { octree, nodes: Vec::new(), size: style.size };
        let mut known = OctreeNodes::new(octree)?;
        let wanted = Selection { budget, order: style.order, min_node_pixels: style.min_node_pixels };
        let shown = visible_nodes(octree, &projection.viewpoint(), &wanted, |key| {
            known.load(octree, key)?;
            Ok(known.get(key).copied())
        })?;
        shown.iter().for_each(|node| source.add(node));
        Ok(source)
    }

    /// Nodes come in the order of the list.
    fn add(&mut self, shown: &VisibleNode) {
        let index = self.nodes.len() as u32;
        if let Some(parent) = shown.parent.and_then(|parent| self.nodes.get_mut(parent)) {
            parent.children[usize::from(shown.node.key.child_index())] = index;
        }
        let (node, points) = (shown.node, shown.points);
        self.nodes.push(Drawn { node, points, spacing: self.spacing(&node, points), children: [NONE; 8] });
    }

    /// Between points of a node and its ancestors: of an inner node what the level says; a leaf has whatever remained, in the
    /// best case spread over a face of its box.
    fn spacing(&self, node: &OctreeNode, points: u64) -> f32 {
        let info = self.octree.info();
        let of_level = info.spacing_at(node.key.level);
        if node.child_mask != 0 {
            return of_level as f32;
        }
        let side = info.node_box(node.key).extent()[0];
        (side / (points.max(1) as f64).sqrt()).min(LARGEST_IN_LEAF * of_level).max(of_level) as f32
    }

    /// The distance between points at a place: that of the deepest node drawn there, from a node that has it.
    fn spacing_at(&self, unit: usize, world: [f64; 3]) -> f32 {
        let Some(mut drawn) = self.nodes.get(unit) else { return 0.0 };
        let mut bounds = self.octree.info().node_box(drawn.node.key);
        loop {
            let middle = bounds.center();
            let is_high = [0, 1, 2].map(|a| world[a] >= middle[a]);
            let child = is_high.iter().fold(0, |index, high| index << 1 | usize::from(*high));
            match self.nodes.get(drawn.children[child] as usize) {
                Some(below) => drawn = below,
                None => return drawn.spacing,
            }
            for a in 0..3 {
                if is_high[a] {
                    bounds.min[a] = middle[a];
                } else {
                    bounds.max[a] = middle[a];
                }
            }
        }
    }
}

impl Source for OctreeSource<'_> {
    fn name(&self) -> String {
        self.octree.locate_index(&self.octree.root()).display().to_string()
    }

    fn len(&self) -> usize {
        self.nodes.len()
    }

    fn unit(&self, index: usize) -> Unit {
        let Some(Drawn { node, points, spacing, children }) = self.nodes.get(index) else { return Unit::new(0) };
        let info = self.octree.info();
        let size = match self.size {
            PointSize::Pixels(pixels) => UnitSize::Pixels(pixels),
            PointSize::World(size) => UnitSize::World(size),
            PointSize::Adaptive(factor) if children.iter().all(|child| *child == NONE) => {
                UnitSize::World(spacing * factor)
            }
            PointSize::Adaptive(_) => UnitSize::Each,
        };
        let bounds = Some(info.node_box(node.key));
        Unit { points: *points, level: node.key.level, bits: None, bounds, size }
    }

    fn attributes(&self, _unit: usize) -> Vec<Attribute> {
        self.octree.info().attributes.clone()
    }

    fn read(&self, unit: usize, _: &[&str], buffers: &mut Buffers, take: &mut Take<'_>) -> Result<u64, ReadError> {
        let Some(Drawn { node, .. }) = self.nodes.get(unit) else { return Ok(0) };
        self.octree.points(node, &mut buffers.node)?;
        let _ = take(Points::of_node(&buffers.node));
        Ok(buffers.node.stored_bytes().len() as u64)
    }

    fn size_at(&self, unit: usize, points: &Points<'_>, index: usize, _view: [f64; 3]) -> f32 {
        let PointSize::Adaptive(factor) = self.size else { return 0.0 };
        let Some(world) = points.world(index) else { return 0.0 };
        self.spacing_at(unit, world) * factor
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use pointmill_format::octree::OctreeInfo;
    use pointmill_format::{Aabb, NodeKey, NodePoints};

    use super::*;
    use crate::{Camera, Order, Size};

    /// All nodes of three levels, 10 points in each, in a cube of 8 units; the index says it at once.
    struct Full(OctreeInfo);

    impl Full {
        fn new() -> Self {
            Self(OctreeInfo::new("full", Aabb { min: [0.0; 3], max: [8.0; 3] }, 0.8, Vec::new()))
        }
    }

    impl Octree for Full {
        fn info(&self) -> &OctreeInfo {
            &self.0
        }

        fn root(&self) -> OctreeNode {
            let mut root = OctreeNode::new(NodeKey::ROOT);
            root.is_proxy = true;
            root
        }

        fn chunk(&self, _: &OctreeNode) -> Result<Vec<OctreeNode>, ReadError> {
            let mut nodes = vec![OctreeNode::new(NodeKey::ROOT)];
            let mut at = 0;
            while let Some(node) = nodes.get_mut(at) {
                let key = node.key;
                node.points = 10;
                if key.level < 2 {
                    node.child_mask = 0xff;
                    nodes.extend((0..8).filter_map(|child| key.child(child)).map(OctreeNode::new));
                }
                at += 1;
            }
            Ok(nodes)
        }

        fn count(&self, node: &OctreeNode) -> Result<u64, ReadError> {
            Ok(node.points)
        }

        fn points(&self, _: &OctreeNode, out: &mut NodePoints) -> Result<(), ReadError> {
            *out = NodePoints::default();
            Ok(())
        }

        fn locate_index(&self, _: &OctreeNode) -> PathBuf {
            "full".into()
        }
    }

    fn chosen(octree: &Full, camera: &Camera, style: &Style, budget: u64) -> Vec<String> {
        let projection = Projection::new(camera, Size::new(200, 200).unwrap()).unwrap();
        let source = OctreeSource::new(octree, &projection, style, budget).unwrap();
        source.nodes.iter().map(|drawn| drawn.node.key.to_string()).collect()
    }

    #[test]
    fn coarse_and_near_nodes_come_first_until_the_budget_is_used() {
        let (octree, camera) = (Full::new(), Camera::new([4.0, -20.0, 4.0], [4.0; 3]));
        let all = Style { min_node_pixels: 0.0, ..Style::plain() };
        assert_eq!(chosen(&octree, &camera, &all, u64::MAX).len(), 1 + 8 + 64);
        assert_eq!(chosen(&octree, &camera, &all, 0), ["r"]);
        // the near half has y below the middle, which is bit 1 of the child
        let mut near = chosen(&octree, &camera, &all, 50);
        near.sort();
        assert_eq!(near, ["r", "r0", "r1", "r4", "r5"]);
    }

    #[test]
    fn small_nodes_and_those_out_of_sight_are_left_out() {
        let (octree, camera) = (Full::new(), Camera::new([4.0, -20.0, 4.0], [4.0; 3]));
        let of =
            |min_node_pixels| chosen(&octree, &camera, &Style { min_node_pixels, ..Style::plain() }, u64::MAX).len();
        // radius 3.46 at about 22 to 26, focal length 173: 23 to 27 pixels, half of that one level below
        assert_eq!([of(18.0), of(40.0), of(1000.0)], [9, 1, 1]);
        let away = Camera::new([4.0, -20.0, 4.0], [4.0, -40.0, 4.0]);
        assert_eq!(chosen(&octree, &away, &Style::plain(), u64::MAX), [""; 0]);
    }

    #[test]
    fn the_angle_moves_nodes_aside_back() {
        // beside a corner of the cube, looking along its face: near nodes are aside, far ones ahead
        let (octree, camera) = (Full::new(), Camera::new([-1.0, -1.0, 4.0], [7.0, 7.0, 4.0]));
        let of = |order| {
            chosen(
                &octree,
                &Camera { vertical_fov: 100.0, ..camera },
                &Style { order, min_node_pixels: 0.0, ..Style::plain() },
                300,
            )
        };
        assert_ne!(of(Order::Radius), of(Order::RadiusAndAngle));
    }

    #[test]
    fn points_are_as_far_apart_as_in_the_deepest_node_drawn_there() {
        let octree = Full::new();
        let projection = Projection::new(&Camera::new([4.0, -20.0, 4.0], [4.0; 3]), Size::default()).unwrap();
        // the root and its near half
        let all = Style { min_node_pixels: 0.0, ..Style::default() };
        let source = OctreeSource::new(&octree, &projection, &all, 50).unwrap();
        let spacings = [[1.0, 1.0, 1.0], [1.0, 7.0, 1.0], [7.0, 3.9, 7.0]].map(|place| source.spacing_at(0, place));
        assert_eq!(spacings, [0.4, 0.8, 0.4]);
        // leaves of 10 points in cubes of 2: 2/√10
        let whole = OctreeSource::new(&octree, &projection, &all, u64::MAX).unwrap();
        let spacing = whole.spacing_at(0, [1.0; 3]);
        assert!((spacing - 2.0 / 10f32.sqrt()).abs() < 1e-6, "{spacing}");
    }
}
