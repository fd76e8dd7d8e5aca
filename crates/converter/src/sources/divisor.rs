//! What the integers of scans have in common: a file with steps of 1e-7 may hold millimetres.

use std::ops::ControlFlow;

use pointmill_format::{Aabb, AxisGrid, Lattice, PointBatch, Positions, Scan, Scratch, Wanted};

use super::decimals::{PARTS_OF_EXTENT, tidy_product};
use super::open_scans::OpenScans;
use super::source::Source;
use super::survey::Fineness;
use crate::error::ConvertError;

/// Integers of 32 bits have no larger power of ten in common.
const MOST_TENS: u64 = 1_000_000_000;

/// Scans that are looked at, evenly spread.
const SCANS: usize = 16;

/// Scans with more steps than this from end to end may well have finer ones than they need: others are not looked at.
const MANY_STEPS: f64 = (1 << 22) as f64;

/// Scans with at most this many points are looked at whatever their extent: that costs nothing.
const FEW_POINTS: u64 = 10_000;

/// Integers of the sample of one scan, on one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Integers {
    scale: f64,
    offset: f64,
    first: i32,
    min: i32,
    max: i32,
    /// The largest power of ten that divides all differences; [`MOST_TENS`] if there are none.
    tens: u64,
}

/// The coarsest decimal steps that hold all integers of a sample, by step of the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Divisors(Vec<[Integers; 3]>);

impl Divisors {
    /// Looks at the first points of some of the scans.
    pub(super) fn of(sources: &[Source], open: &OpenScans) -> Result<Self, ConvertError> {
        let with_lattice: Vec<usize> = (0..sources.len()).filter(|i| is_worth_a_look(&sources[*i])).collect();
        let step = with_lattice.len().div_ceil(SCANS).max(1);
        let mut samples = Vec::new();
        for i in with_lattice.into_iter().step_by(step) {
            samples.extend(sample(&*open.get(i, &sources[i])?));
        }
        Ok(Self(samples))
    }

    /// How finely coordinates on a lattice are stored, on each axis.
    pub(super) fn fineness(&self, lattice: &Lattice) -> [Fineness; 3] {
        std::array::from_fn(|a| {
            let grid = AxisGrid { step: lattice.scale[a], offset: lattice.offset[a] };
            let coarser = self.grid(a, grid);
            Fineness::Grid { grid: coarser.unwrap_or(grid), is_claim: coarser.is_some() }
        })
    }

    /// The coarser grid that the integers of files with that `grid` lie on, if there is one.
    fn grid(&self, axis: usize, grid: AxisGrid) -> Option<AxisGrid> {
        let same = || self.0.iter().filter(|s| s.iter().any(|i| i.scale == grid.step));
        // one step for all axes that have one in the file, or the cube would be skewed
        let all = || same().flatten().filter(|i| i.scale == grid.step);
        let mut tens = all().map(|i| i.tens).min()?;
        let widest = all().map(|i| f64::from(i.max) - f64::from(i.min)).fold(0.0, f64::max);
        while tens > 1 && widest / (tens as f64) < PARTS_OF_EXTENT {
            tens /= 10;
        }
        let on_axis = same().map(|s| s[axis]).next()?;
        let offset = f64::from(on_axis.first) * on_axis.scale + on_axis.offset;
        // the coordinate nearest to the offset of the file
        let steps = ((offset - grid.offset) / (grid.step * tens as f64)).round();
        let step = tidy_product(grid.step, tens as f64);
        (tens > 1).then_some(AxisGrid { step, offset: offset - steps * step })
    }
}

fn is_worth_a_look(source: &Source) -> bool {
    let Some(lattice) = source.stored.lattice else { return false };
    let many = |b: Aabb| (0..3).any(|a| (b.max[a] - b.min[a]) / lattice.scale[a] > MANY_STEPS);
    source.points_declared <= FEW_POINTS || source.bounds_declared.is_none_or(many)
}

/// The first batch of a scan.
fn sample(scan: &dyn Scan) -> Option<[Integers; 3]> {
    let lattice = scan.info().lattice?;
    let mut found = None;
    let wanted = Wanted::positions(scan.info());
    // a piece that cannot be decoded is reported later
    let _ = scan.decode(0, &wanted, &mut Scratch::default(), &mut |batch: &PointBatch| {
        if let Positions::Quantized(columns) = &batch.positions {
            let of_axis = |a: usize| integers(&columns[a], lattice.scale[a], lattice.offset[a]);
            found = of_axis(0).zip(of_axis(1)).zip(of_axis(2)).map(|((x, y), z)| [x, y, z]);
        }
        ControlFlow::Break(())
    });
    found
}

fn integers(values: &[i32], scale: f64, offset: f64) -> Option<Integers> {
    let first = *values.first()?;
    let mut tens = MOST_TENS;
    for v in values {
        let difference = u64::from(v.abs_diff(first));
        while !difference.is_multiple_of(tens) {
            tens /= 10;
        }
    }
    let (min, max) = values.iter().fold((first, first), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    Some(Integers { scale, offset, first, min, max, tens })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(axes: [&[i32]; 3], scale: f64, offset: f64, axis: usize) -> Option<AxisGrid> {
        let [x, y, z] = axes.map(|v| integers(v, scale, offset).unwrap());
        Divisors(vec![[x, y, z]]).grid(axis, AxisGrid { step: scale, offset })
    }

    #[test]
    fn integers_that_share_powers_of_ten_lie_on_a_coarser_grid() {
        let many = [0, 10_000, 250_000, 1_000_000_000];
        let found = grid([&many, &[30_000, 50_000], &[7, 7]], 1e-7, 100.0, 0).unwrap();
        assert_eq!((found.step, found.offset), (0.001, 100.0));
        let flat = grid([&many, &[30_000, 50_000], &[7, 7]], 1e-7, 100.0, 2).unwrap();
        assert!((flat.offset - 100.000_000_7).abs() < 1e-12, "{flat:?}");
    }

    #[test]
    fn few_points_far_apart_are_no_coarse_grid_and_odd_ones_none() {
        assert_eq!(grid([&[0, 1_000_000], &[0, 0], &[0, 0]], 0.001, 0.0, 0).unwrap().step, 0.1);
        assert_eq!(grid([&[0, 1_000_001, 2_000_000], &[0, 0], &[0, 0]], 0.001, 0.0, 0), None);
        assert_eq!(grid([&[5], &[5], &[5]], 0.001, 0.0, 0), None);
    }
}
