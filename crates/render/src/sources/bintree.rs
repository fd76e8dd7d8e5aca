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
