//! Where the points of a scene are, from some of them.

mod scans;

use std::collections::HashSet;

use pointmill_format::batches::{BatchScratch, Batches, Precision};
use pointmill_format::bintree::Bintree;
use pointmill_format::octree::{Octree, OctreeNodes};
use pointmill_format::{Aabb, NodeKey, NodePoints, ReadError};

use crate::vector::plus;
use crate::{Camera, Canvas, Size, Style};

pub(crate) use scans::of_scans;

/// About this many points are a sample.
const WANTED: usize = 60_000;

/// Leaves, batches or pieces that are sampled, evenly spread.
const UNITS: usize = 64;

/// The middle of the order of coordinates, on each axis, which decides what is far away.
const MIDDLE: [f64; 2] = [0.005, 0.995];

/// A box that is this many times larger than the middle of the points has points far from all others.
const FAR: f64 = 4.0;

/// Width of the pictures that are compared, pixels.
const SMALL: u32 = 192;

/// Some points of a scene.
#[derive(Debug, Clone)]
pub(crate) struct Sample {
    positions: Vec<[f64; 3]>,
    /// Where the points are but those far from all others.
    pub(crate) bounds: Aabb,
}

impl Sample {
    /// `bounds`: of all points, if that is known.
    fn new(mut positions: Vec<[f64; 3]>, bounds: Option<Aabb>) -> Self {
        positions.retain(|p| p.iter().all(|c| c.is_finite()));
        let mut sampled = Aabb::EMPTY;
        positions.iter().for_each(|p| sampled.grow(*p));
        let all = bounds.filter(|b| !b.is_empty()).map_or(sampled, |b| b.union(&sampled));
        let bounds = if positions.is_empty() { all } else { without_far(all, &positions) };
        let nothing = Aabb { min: [0.0; 3], max: [0.0; 3] };
        Self { positions, bounds: if bounds.is_empty() { nothing } else { bounds } }
    }

    /// The camera that shows the most: see [`crate::Scene::best_view`].
    pub(crate) fn best_view(&self, size: Size) -> Camera {
        let height = (f64::from(SMALL) / size.aspect()).round().clamp(1.0, f64::from(SMALL) * 4.0) as u32;
        let small = Size::new(SMALL, height).unwrap_or(size);
        let inside: Vec<_> = self.positions.iter().copied().filter(|p| self.bounds.contains(*p)).collect();
        let around = (0..8).map(|eighth| {
            // from the south first, then from the south-east
            let angle = std::f64::consts::FRAC_PI_4 * f64::from(eighth);
            let (sideways, down) = (30f64.to_radians().cos(), 30f64.to_radians().sin());
            let direction = [-angle.sin() * sideways, angle.cos() * sideways, -down];
            Camera::fit_points(&inside, &self.bounds, direction, size)
        });
        let covered = |camera: &Camera| {
            let colours = vec![[0; 3]; self.positions.len()];
            Canvas::new(small, camera, &Style::plain()).map_or(0, |canvas| {
                canvas.add(&self.positions, &colours);
                canvas.finish().covered()
            })
        };
        let mut best: Option<(usize, Camera)> = None;
        for camera in around {
            let count = covered(&camera);
            if best.is_none_or(|(most, _)| count > most) {
                best = Some((count, camera));
            }
        }
        best.map_or_else(
            || Camera::new(plus(self.bounds.max, [1.0; 3], 1.0), self.bounds.center()),
            |(_, camera)| camera,
        )
    }

    /// The distance between points of a cloud of `total` points that covers what the sample covers, world units: the area of
    /// the cells that it touches, shared out. `None` without extent.
    pub(crate) fn spacing(&self, total: u64) -> Option<f32> {
        let longest = self.bounds.extent().into_iter().fold(0.0, f64::max);
        let cells = if self.positions.len() > 10_000 { 64.0 } else { 16.0 };
        let side = longest / cells;
        if side.is_nan() || side <= 0.0 || total == 0 {
            return None;
        }
        let inside = self.positions.iter().filter(|p| self.bounds.contains(**p));
        let cell =
            |p: &[f64; 3]| -> [i32; 3] { std::array::from_fn(|a| ((p[a] - self.bounds.min[a]) / side).floor() as i32) };
        let touched: HashSet<[i32; 3]> = inside.map(cell).collect();
        Some((side * (touched.len() as f64 / total as f64).sqrt()) as f32)
    }
}

/// The box without points that are far from all others.
fn without_far(all: Aabb, positions: &[[f64; 3]]) -> Aabb {
    let mut bounds = all;
    for axis in 0..3 {
        let mut values: Vec<f64> = positions.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let last = values.len() - 1;
        let [low, high] = MIDDLE.map(|part| values[(part * last as f64).round() as usize]);
        let middle = high - low;
        if all.max[axis] - all.min[axis] > FAR * middle && middle > 0.0 {
            bounds.min[axis] = all.min[axis].max(low - middle / 10.0);
            bounds.max[axis] = all.max[axis].min(high + middle / 10.0);
        }
    }
    bounds
}

/// Numbers of at most [`UNITS`] of that many, evenly spread.
fn spread(count: usize) -> impl Iterator<Item = usize> {
    let taken = count.min(UNITS);
    (0..taken).map(move |i| i * count / taken)
}

/// Adds every nth point of a node, `most` at most.
fn add(points: &NodePoints, most: usize, positions: &mut Vec<[f64; 3]>) {
    let step = points.len().div_ceil(most.max(1)).max(1);
    positions.extend((0..points.len()).step_by(step).filter_map(|i| points.world(i)));
}

/// The coarse nodes of an octree: they are spread over all of it.
///
/// # Errors
/// Those of reading it.
pub(crate) fn of_octree(octree: &dyn Octree) -> Result<Sample, ReadError> {
    let mut nodes = OctreeNodes::new(octree)?;
    let (mut points, mut positions) = (NodePoints::default(), Vec::new());
    let mut waiting = std::collections::VecDeque::from([NodeKey::ROOT]);
    let mut read = 0;
    while let Some(key) = waiting.pop_front()
        && read < UNITS
        && positions.len() < WANTED / 2
    {
        nodes.load(octree, key)?;
        waiting.extend(nodes.children(key).map(|child| child.key));
        if let Some(node) = nodes.get(key) {
            octree.points(node, &mut points)?;
            add(&points, WANTED / 2, &mut positions);
        }
        read += 1;
    }
    Ok(Sample::new(positions, None))
}

/// # Errors
/// Those of reading leaves.
pub(crate) fn of_bintree(tree: &Bintree) -> Result<Sample, ReadError> {
    let leaves: Vec<u32> = tree.leaves().collect();
    let (mut points, mut positions) = (NodePoints::default(), Vec::new());
    for i in spread(leaves.len()) {
        if let Some(leaf) = leaves.get(i) {
            tree.read_leaf(*leaf, &mut points)?;
            add(&points, WANTED / UNITS, &mut positions);
        }
    }
    Ok(Sample::new(positions, tree.node(0).map(|root| root.bounds)))
}

/// # Errors
/// Those of reading batches.
pub(crate) fn of_batches<B: AsRef<[u8]>>(batches: &Batches<B>) -> Result<Sample, ReadError> {
    let (mut scratch, mut points, mut positions) = (BatchScratch::default(), NodePoints::default(), Vec::new());
    for slot in spread(batches.header().batches as usize) {
        batches.read_batch(slot as u32, Precision::Ten, &mut scratch, &mut points)?;
        add(&points, WANTED / UNITS, &mut positions);
    }
    let tight = (batches.header().points > 0).then_some(batches.header().tight);
    Ok(Sample::new(positions, tight))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall that faces east and west: 100 x 100 points, 20 long and 10 high.
    fn wall() -> Vec<[f64; 3]> {
        (0..10_000).map(|i| [5e5, f64::from(i % 100) * 0.2, f64::from(i / 100) * 0.1]).collect()
    }

    #[test]
    fn a_wall_is_looked_at_from_the_side_that_shows_it() {
        let camera = Sample::new(wall(), None).best_view(Size::new(400, 300).unwrap());
        let [x, y, z] = std::array::from_fn(|a| camera.eye[a] - camera.target[a]);
        assert!(x.abs() > 3.0 * y.abs() && z > 0.0, "{camera:?}");
    }

    #[test]
    fn the_spacing_of_a_surface_is_that_of_its_points() {
        let flat: Vec<[f64; 3]> = (0..10_000).map(|i| [f64::from(i % 100), f64::from(i / 100), 0.0]).collect();
        let spacing = Sample::new(flat, None).spacing(10_000).unwrap();
        // cells of 99/16 on 17 x 17 of them, the border included: 105.2 wide where the points have 100
        assert!((spacing - 1.052).abs() < 0.001, "{spacing}");
        assert_eq!(Sample::new(vec![[1.0; 3]], None).spacing(1), None);
    }

    #[test]
    fn one_point_far_away_does_not_make_the_scene_small() {
        let mut points = wall();
        points.push([-7e6, 0.0, 0.0]);
        points.push([5e5, 1e9, f64::NAN]);
        points.iter_mut().take(9000).for_each(|p| p[0] += p[1] / 100.0);
        let bounds = Sample::new(points, None).bounds;
        assert!(bounds.min[0] > 499_999.0 && bounds.max[1] < 20.0, "{bounds:?}");
        let declared = Aabb { min: [499_999.9, -1.0, -1.0], max: [500_000.1, 21.0, 11.0] };
        assert_eq!(Sample::new(wall(), Some(declared)).bounds, declared);
    }

    #[test]
    fn nothing_is_somewhere() {
        let sample = Sample::new(Vec::new(), Some(Aabb::EMPTY));
        assert_eq!(sample.bounds, Aabb { min: [0.0; 3], max: [0.0; 3] });
        assert!(sample.best_view(Size::default()).axes().is_ok());
    }
}
