//! How far decoded positions are from the points of the lattice.

use pointmill_format::{Deviations, NodeKey};
use serde::{Deserialize, Serialize};

use super::steps::Steps;
use crate::cloud::{Cloud, JobPoint, RecordFrame, position};
use crate::octree::FinishedNode;
use crate::outputs::octrees::half_ulp;
use crate::outputs::recovery::Recovery;
use crate::report::{FormatErrors, PositionErrors};

/// The errors of a dataset with these nodes.
pub(super) fn errors(cloud: &Cloud<'_>, steps: &Steps, nodes: &[FinishedNode], seen: &Seen) -> FormatErrors {
    let depth = nodes.iter().map(|node| node.key.level).max().unwrap_or(0);
    let rounding = rounding(cloud, steps, u32::from(depth));
    if steps.exact_level().is_none() {
        let errors = PositionErrors::bound(std::array::from_fn(|a| seen.largest[a] + rounding[a]));
        let is_certain = Recovery::new(cloud).is_certain(errors.max);
        return FormatErrors { errors, lost: seen.lost, merged: is_certain.then_some(0) };
    }
    let mut moved = Deviations::default();
    for node in nodes {
        add_node(&mut moved, steps.of(node.key).moved_by(node.key), node.points.into());
    }
    let errors = PositionErrors::rounding(rounding).after(&PositionErrors::measured(&moved));
    FormatErrors { errors, lost: 0, merged: Some(0) }
}

/// All points of a node are off by the same.
fn add_node(to: &mut Deviations, by: [f64; 3], points: u64) {
    let mut one = Deviations::default();
    one.add(by);
    one.points = points;
    for a in 0..3 {
        one.sum[a] *= points as f64;
        one.squares[a] *= points as f64;
    }
    to.merge(&one);
}

/// No two roundings of a position differ more, by axis: what `q · scale + offset` is rounded by where the lattice is decoded,
/// and `corner + X · scale` in the dataset, the corner by halving the cube once a level.
fn rounding(cloud: &Cloud<'_>, steps: &Steps, depth: u32) -> [f64; 3] {
    let (lattice, bounds, cube) = (&cloud.lattice.lattice, &cloud.stats.bounds, &cloud.frame.cube);
    if bounds.is_empty() {
        return [0.0; 3];
    }
    let corner = cube.offset(lattice);
    std::array::from_fn(|a| {
        let (scale, offset) = (lattice.scale[a], lattice.offset[a]);
        if steps.is_exact_in_doubles(scale, [corner[a], offset, corner[a] + cube.side], depth) {
            return 0.0;
        }
        let product = |q: i64| q as f64 * scale;
        let larger = |a: f64, b: f64| a.abs().max(b.abs());
        let job = larger(product(bounds.min[a]), product(bounds.max[a]));
        let world = larger(corner[a], corner[a] + cube.side).next_up();
        let plain = product(cube.min[a]) + offset;
        let moved = (corner[a] - plain).abs() + half_ulp(product(cube.min[a])) + half_ulp(plain);
        let levels = f64::from(depth);
        let sums = (3.0 + 2.0 * levels) * half_ulp(world) + (3.0 + levels) * half_ulp(cube.side);
        (half_ulp(job) + sums + moved) * (1.0 + 8.0 * f64::EPSILON)
    })
}

/// What a [`Meter`] has seen.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Seen {
    /// Largest error of positions by axis, world units.
    largest: [f64; 3],
    /// Points whose integers do not come back.
    lost: u64,
}

impl Seen {
    pub(super) fn merge(&mut self, other: &Self) {
        self.largest = std::array::from_fn(|a| self.largest[a].max(other.largest[a]));
        self.lost += other.lost;
    }
}

/// Looks at positions that are rounded to steps.
pub(super) struct Meter {
    frame: RecordFrame,
    /// World units of a step of each axis of the lattice, and of a step of the dataset.
    lattice: [f64; 3],
    scale: f64,
    corner: [f64; 3],
    /// `None`: all integers come back.
    recovery: Option<Recovery>,
}

impl Meter {
    /// `None`: positions are not rounded, or by an amount that depends on the node alone.
    pub(super) fn new(cloud: &Cloud<'_>, steps: &Steps) -> Option<Self> {
        if steps.exact_level().is_some() {
            return None;
        }
        let recovery = Recovery::new(cloud);
        let rounding = rounding(cloud, steps, u32::from(NodeKey::MAX_LEVEL));
        let is_certain = recovery.is_certain(rounding.map(|r| r + steps.scale / 2.0));
        Some(Self {
            frame: cloud.frame.clone(),
            lattice: cloud.lattice.lattice.scale,
            scale: steps.scale,
            corner: cloud.frame.cube.offset(&cloud.lattice.lattice),
            recovery: (!is_certain).then_some(recovery),
        })
    }

    /// Looks at some points.
    pub(super) fn look(&self, records: &[u8], seen: &mut Seen) {
        let Self { frame, lattice, scale, corner, recovery } = self;
        for record in records.chunks_exact(frame.stride) {
            let q = frame.origin.job(position(record));
            let nearest = frame.cube.nearest_tree(q).map(|steps| steps as f64 * scale);
            for a in 0..3 {
                let meant = (q[a] - frame.cube.min[a]) as f64 * lattice[a];
                seen.largest[a] = seen.largest[a].max((nearest[a] - meant).abs());
            }
            if let Some(recovery) = recovery {
                let world = std::array::from_fn(|a| corner[a] + nearest[a]);
                seen.lost += u64::from(JobPoint(recovery.integers(world)) != q);
            }
        }
    }
}
