//! Which points of a scan the filter keeps for their position: "Bounds" and "Points at the scanner's origin" of
//! docs/inputs.md, in code of our own.

use pointmill_format::{Lattice, PointBatch, Positions, Resolution, ScanInfo};

use super::rules::Rules;

/// The filter in the terms of one scan.
#[derive(Debug)]
pub(super) struct Selection {
    /// On each axis the least and the greatest coordinate, in steps of the scan's lattice if it has one.
    ranges: Option<[(f64, f64); 3]>,
    /// First point and origin of each part of the file, if points there are skipped.
    origins: Vec<(u64, [f64; 3])>,
    lattice: Option<Lattice>,
}

impl Selection {
    pub(super) fn new(info: &ScanInfo, rules: &Rules) -> Self {
        let range = |axis: usize, min: f64, max: f64| match &info.lattice {
            Some(lattice) => (steps(lattice, axis, min).0, steps(lattice, axis, max).1),
            None => reals(info.resolution[axis], min, max),
        };
        let ranges = rules.bounds.map(|b| [0, 1, 2].map(|axis| range(axis, b.min[axis], b.max[axis])));
        let mut origins = Vec::new();
        if rules.skips_origin {
            let present = info.parts.iter().filter(|part| !part.range.is_empty());
            origins.extend(present.map(|part| (part.range.start, part.translation)));
            if info.parts.is_empty() {
                origins.push((0, [0.0; 3]));
            }
        }
        Self { ranges, origins, lattice: info.lattice }
    }

    /// Clears the marks of points that the filter drops; `keep` are those of the points from `start` on.
    pub(super) fn apply(&self, batch: &PointBatch, start: usize, keep: &mut [bool]) {
        if let Some(ranges) = &self.ranges {
            for (axis, (min, max)) in ranges.iter().enumerate() {
                let inside = |v: f64| *min <= v && v <= *max;
                match &batch.positions {
                    Positions::Quantized(p) => {
                        keep.iter_mut().zip(&p[axis][start..]).for_each(|(keep, v)| *keep &= inside(f64::from(*v)));
                    }
                    Positions::World(p) => {
                        keep.iter_mut().zip(&p[axis][start..]).for_each(|(keep, v)| *keep &= inside(*v));
                    }
                }
            }
        }
        if !self.origins.is_empty() {
            for (i, keep) in (start..).zip(keep) {
                *keep &= !self.is_at_origin(batch, i);
            }
        }
    }

    fn is_at_origin(&self, batch: &PointBatch, i: usize) -> bool {
        let index = batch.first_point + i as u64;
        let Some((_, origin)) = self.origins.iter().rev().find(|(first, _)| *first <= index) else { return false };
        (0..3).all(|axis| match (&batch.positions, &self.lattice) {
            (Positions::Quantized(p), Some(lattice)) => {
                let (scale, offset) = (lattice.scale[axis], lattice.offset[axis]);
                let found = f64::from(p[axis][i]) * scale + offset;
                (found - origin[axis]).abs() <= rounding(origin[axis].abs() + offset.abs())
            }
            (Positions::Quantized(p), None) => f64::from(p[axis][i]) == origin[axis],
            (Positions::World(p), _) => p[axis][i] == origin[axis],
        })
    }
}

/// What the rounding of coordinates of that size can come to.
fn rounding(size: f64) -> f64 {
    4.0 * f64::EPSILON * size
}

/// The least lattice coordinate that is not below `world`, and the greatest that is not above. Within a millionth of a
/// step, or what rounding can come to, a border is on a lattice point.
fn steps(lattice: &Lattice, axis: usize, world: f64) -> (f64, f64) {
    let (scale, offset) = (lattice.scale[axis], lattice.offset[axis]);
    let exact = (world - offset) / scale;
    let slack = (rounding(world.abs() + offset.abs()) / scale).max(1e-6);
    match exact.round() {
        on if (exact - on).abs() <= slack => (on, on),
        _ => (exact.ceil(), exact.floor()),
    }
}

/// Borders for coordinates that are stored as numbers of that resolution.
fn reals(resolution: Resolution, min: f64, max: f64) -> (f64, f64) {
    let slack = |v: f64| match resolution {
        Resolution::Grid(grid) => rounding(v.abs() + grid.offset.abs()).max(1e-6 * grid.step),
        Resolution::Step(step) => rounding(v.abs()).max(1e-6 * step),
        _ => rounding(v.abs()),
    };
    match resolution {
        Resolution::Single => (f64::from(min as f32), f64::from(max as f32)),
        _ => (min - slack(min), max + slack(max)),
    }
}
