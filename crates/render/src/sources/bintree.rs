//! What is drawn of a binary tree: the leaves in sight, each with its material.

use pointmill_format::bintree::{Bintree, INDEX_FILE, Material, distance_range, switch_distance};
use pointmill_format::{Attribute, AttributeType, ReadError};

use crate::projection::Projection;
use crate::vector::length;
use crate::{PointSize, Style};

use super::{Buffers, Points, Source, Take, Unit, UnitSize, surface_spacing};

/// A leaf that is drawn.
struct Leaf {
    index: u32,
    material: Material,
    /// Of its points near by, world units.
    diameter: f32,
    /// Where its points become single pixels, world units from the eye.
    switch: f64,
}

/// The chosen leaves of a binary tree.
pub(crate) struct BintreeSource<'a> {
    tree: &'a Bintree,
    leaves: Vec<Leaf>,
    size: PointSize,
    /// Every nth point is drawn.
    step: u64,
}

impl<'a> BintreeSource<'a> {
    /// All leaves in sight; thinned if they have more points than the budget.
    pub(crate) fn new(tree: &'a Bintree, projection: &Projection, style: &Style, budget: u64) -> Self {
        let seen = tree.leaves_in_frustum(&projection.frustum);
        let total = seen.iter().filter_map(|leaf| tree.node(*leaf)).fold(0u64, |sum, n| sum.saturating_add(n.count));
        let step = total.div_ceil(budget.max(1)).max(1);
        let fov = 2.0 * (f64::from(projection.size.height()) / 2.0 / projection.focal).atan();
        let leaf = |index: u32| {
            let node = tree.node(index)?;
            let diameter = match style.size {
                PointSize::Pixels(_) => 0.0,
                PointSize::World(diameter) => diameter,
                PointSize::Adaptive(factor) => surface_spacing(node.bounds.extent(), node.count / step) * factor,
            };
            let switch = switch_distance(f64::from(diameter) / 2.0, fov, projection.size.height().into());
            let material = Material::choose(distance_range(&node.bounds, projection.eye), switch);
            Some(Leaf { index, material, diameter, switch })
        };
        let leaves = seen.into_iter().filter_map(leaf).collect();
        Self { tree, leaves, size: style.size, step }
    }
}

impl Source for BintreeSource<'_> {
    fn name(&self) -> String {
        self.tree.locate(INDEX_FILE).display().to_string()
    }

    fn len(&self) -> usize {
        self.leaves.len()
    }

    fn unit(&self, index: usize) -> Unit {
        let Some(leaf) = self.leaves.get(index) else { return Unit::new(0) };
        let Some(node) = self.tree.node(leaf.index) else { return Unit::new(0) };
        let size = match (self.size, leaf.material) {
            (PointSize::Pixels(pixels), _) => UnitSize::Pixels(pixels),
            (_, Material::Far) => UnitSize::One,
            (_, Material::Near) => UnitSize::World(leaf.diameter),
            (_, Material::Both) => UnitSize::Each,
        };
        let level = self.tree.path(leaf.index).len().min(usize::from(u8::MAX)) as u8;
        Unit { points: node.count.div_ceil(self.step), level, bits: None, bounds: Some(node.bounds), size }
    }

    fn attributes(&self, _unit: usize) -> Vec<Attribute> {
        let class = Attribute::new("classification", AttributeType::Float32, 1);
        let extras = self.tree.header().record.extras();
        std::iter::once(class).chain(extras.iter().map(|extra| extra.attribute.clone())).collect()
    }

    fn read(&self, unit: usize, _: &[&str], buffers: &mut Buffers, take: &mut Take<'_>) -> Result<u64, ReadError> {
        let Some(leaf) = self.leaves.get(unit) else { return Ok(0) };
        self.tree.read_leaf(leaf.index, &mut buffers.node)?;
        let _ = take(Points::of_node(&buffers.node));
        Ok(buffers.node.stored_bytes().len() as u64)
    }

    fn keeps(&self, _unit: usize, _points: &Points<'_>, index: usize, _view: [f64; 3]) -> bool {
        (index as u64).is_multiple_of(self.step)
    }

    fn size_at(&self, unit: usize, _points: &Points<'_>, _index: usize, view: [f64; 3]) -> f32 {
        match self.leaves.get(unit) {
            Some(leaf) if length(view) <= leaf.switch => leaf.diameter,
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Size, View, render_bintree};

    fn tree() -> Bintree {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/bintree/packed");
        Bintree::open(folder).unwrap()
    }

    fn sizes(tree: &Bintree, camera: &Camera, size: PointSize) -> Vec<UnitSize> {
        let projection = Projection::new(camera, Size::default()).unwrap();
        let source = BintreeSource::new(tree, &projection, &Style { size, ..Style::default() }, u64::MAX);
        (0..source.len()).map(|leaf| source.unit(leaf).size).collect()
    }

    #[test]
    fn leaves_far_away_are_single_pixels() {
        let tree = tree();
        let bounds = tree.nodes()[0].bounds;
        let fit = Camera::fit(&bounds, View::South, Size::default());
        let distance = fit.target[1] - fit.eye[1];
        // the radius that becomes a pixel at that distance: 60 degrees are 1080 pixels
        let at = |part: f64| 2.0 * (distance * part * (60f64 / 1080.0).to_radians().tan()) as f32;
        let extent = length(bounds.extent()) / distance;
        assert!(sizes(&tree, &fit, PointSize::World(at(1.0 - extent))).iter().all(|s| *s == UnitSize::One));
        let near = at(1.0 + extent);
        assert!(sizes(&tree, &fit, PointSize::World(near)).iter().all(|s| *s == UnitSize::World(near)));
        let leaf = tree.node(tree.leaves().next().unwrap()).unwrap();
        let middle = distance_range(&leaf.bounds, fit.eye).iter().sum::<f64>() / 2.0;
        assert!(sizes(&tree, &fit, PointSize::World(at(middle / distance))).contains(&UnitSize::Each));
        assert!(sizes(&tree, &fit, PointSize::Pixels(2.0)).iter().all(|s| *s == UnitSize::Pixels(2.0)));
    }

    #[test]
    fn a_leaf_at_the_switch_decides_point_by_point() {
        let tree = tree();
        let fit = Camera::fit(&tree.nodes()[0].bounds, View::South, Size::default());
        let projection = Projection::new(&fit, Size::default()).unwrap();
        let style = Style { size: PointSize::World(0.1), ..Style::default() };
        let source = BintreeSource::new(&tree, &projection, &style, u64::MAX);
        let switch = switch_distance(f64::from(0.1f32) / 2.0, 60f64.to_radians(), 1080.0);
        let node = pointmill_format::NodePoints::default();
        let size = |depth| source.size_at(0, &Points::of_node(&node), 0, [0.0, 0.0, depth]);
        assert_eq!([size(switch * 0.999), size(switch * 1.001)], [0.1, 0.0]);
    }

    #[test]
    fn every_nth_point_is_drawn_within_the_budget() {
        let tree = tree();
        let size = Size::new(100, 100).unwrap();
        let camera = Camera::fit(&tree.nodes()[0].bounds, View::South, size);
        let drawn = |budget| render_bintree(&tree, &camera, size, &Style::plain(), budget, 1).unwrap().drawn.points;
        let leaves = tree.leaves().count() as u64;
        let all = drawn(u64::MAX);
        assert_eq!(all, tree.header().points);
        // each leaf begins with one
        assert!(drawn(all / 2) < all && drawn(all / 2) <= all / 2 + leaves && drawn(1) == leaves);
    }
}
