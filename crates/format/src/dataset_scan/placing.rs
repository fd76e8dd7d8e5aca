//! The positions of a node on the lattice of the whole scan.

use std::ops::Range;

use crate::{Lattice, NodePoints, Positions};

/// Puts the positions of some points of a node into `out`, which has the kind that the scan has. `None`: one of them is
/// beyond the integers of `lattice`.
pub(super) fn place(
    points: &NodePoints,
    range: Range<usize>,
    lattice: Option<&Lattice>,
    out: &mut Positions,
) -> Option<()> {
    match (lattice, out) {
        (Some(lattice), Positions::Quantized(axes)) => axes
            .iter_mut()
            .enumerate()
            .try_for_each(|(axis, out)| on_lattice(points, range.clone(), lattice, axis, out)),
        (_, Positions::World(axes)) => {
            axes.iter_mut().enumerate().for_each(|(axis, out)| in_world(points, range.clone(), axis, out));
            Some(())
        }
        (None, Positions::Quantized(_)) => None,
    }
}

fn in_world(points: &NodePoints, range: Range<usize>, axis: usize, out: &mut Vec<f64>) {
    let Lattice { scale, offset } = points.lattice();
    out.clear();
    match points.positions() {
        Positions::World(axes) => out.extend_from_slice(&axes[axis][range]),
        Positions::Quantized(axes) => {
            out.extend(axes[axis][range].iter().map(|v| f64::from(*v) * scale[axis] + offset[axis]));
        }
    }
}

fn on_lattice(
    points: &NodePoints,
    range: Range<usize>,
    lattice: &Lattice,
    axis: usize,
    out: &mut Vec<i32>,
) -> Option<()> {
    out.clear();
    let own = points.lattice();
    let axes = match points.positions() {
        Positions::Quantized(axes) => &axes[axis][range],
        Positions::World(axes) => {
            return extend(out, axes[axis][range].iter().map(|v| lattice.quantize(axis, *v)));
        }
    };
    if own.scale[axis] != lattice.scale[axis] {
        let world = |v: &i32| f64::from(*v) * own.scale[axis] + own.offset[axis];
        return extend(out, axes.iter().map(|v| lattice.quantize(axis, world(v))));
    }
    match steps_between(own, lattice, axis) {
        0 => out.extend_from_slice(axes),
        shift => return extend(out, axes.iter().map(|v| i64::from(*v).saturating_add(shift))),
    }
    Some(())
}

/// Steps from the 0 of `lattice` to the 0 of `own`, whose step is the same.
fn steps_between(own: &Lattice, lattice: &Lattice, axis: usize) -> i64 {
    lattice.quantize(axis, own.offset[axis])
}

fn extend(out: &mut Vec<i32>, values: impl ExactSizeIterator<Item = i64>) -> Option<()> {
    out.reserve_exact(values.len());
    for value in values {
        out.push(i32::try_from(value).ok()?);
    }
    Some(())
}

/// What is lost of a whole number by the rounding of doubles, in steps.
const WHOLE: f64 = 1e-3;

/// `lattice` with its 0 at `offset`, if that is a whole number of steps away and all of `bounds` (world units) fits 32 bits then.
pub(super) fn with_offset(lattice: &Lattice, offset: [f64; 3], bounds: &crate::Aabb) -> Option<Lattice> {
    let moved = Lattice { scale: lattice.scale, offset };
    let is_whole = |axis: usize| {
        let steps = (lattice.offset[axis] - offset[axis]) / lattice.scale[axis];
        (steps - steps.round()).abs() < WHOLE
    };
    (moved.is_valid() && (0..3).all(is_whole) && fits(&moved, bounds)).then_some(moved)
}

/// `lattice`, moved by whole steps where the integers of `bounds` would not fit 32 bits; `None`: they do not fit wherever it is.
pub(super) fn held(lattice: &Lattice, bounds: &crate::Aabb) -> Option<Lattice> {
    if fits(lattice, bounds) {
        return Some(*lattice);
    }
    let corner = std::array::from_fn(|axis| lattice.quantize(axis, bounds.min[axis]));
    with_offset(lattice, lattice.world(corner), bounds)
}

/// True if all of `bounds` (world units) has 32-bit coordinates.
fn fits(lattice: &Lattice, bounds: &crate::Aabb) -> bool {
    let is_i32 = |axis: usize, v: f64| i32::try_from(lattice.quantize(axis, v)).is_ok();
    (0..3).all(|axis| is_i32(axis, bounds.min[axis]) && is_i32(axis, bounds.max[axis]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;

    fn node(lattice: Lattice, x: Vec<i32>) -> NodePoints {
        let zeros = vec![0; x.len()];
        let mut points = NodePoints::default();
        points.lattice = lattice;
        points.positions = Positions::Quantized([x, zeros.clone(), zeros]);
        points
    }

    fn placed(points: &NodePoints, lattice: &Lattice) -> Option<Vec<i32>> {
        let mut out = Positions::Quantized(Default::default());
        place(points, 0..points.len(), Some(lattice), &mut out)?;
        let Positions::Quantized([x, ..]) = out else { return None };
        Some(x)
    }

    #[test]
    fn integers_are_moved_by_whole_steps_or_rounded_from_finer_ones() {
        let scan = Lattice { scale: [0.01; 3], offset: [500_000.0, 0.0, 0.0] };
        let same = node(scan, vec![-3, i32::MAX]);
        assert_eq!(placed(&same, &scan), Some(vec![-3, i32::MAX]));
        let moved = node(Lattice { offset: [500_000.07, 0.0, 0.0], ..scan }, vec![0, 5]);
        assert_eq!(placed(&moved, &scan), Some(vec![7, 12]));
        let beyond = node(Lattice { offset: [500_000.07, 0.0, 0.0], ..scan }, vec![i32::MAX]);
        assert_eq!(placed(&beyond, &scan), None);
        let finer = node(Lattice { scale: [0.000_01; 3], offset: [500_000.0, 0.0, 0.0] }, vec![1_000, 2_249]);
        assert_eq!(placed(&finer, &scan), Some(vec![1, 2]));
    }

    #[test]
    fn a_lattice_far_away_is_moved() {
        let far = Lattice { scale: [0.001; 3], offset: [0.0; 3] };
        let near = Aabb { min: [4_428_000.0; 3], max: [4_428_100.0; 3] };
        assert_eq!(held(&far, &near).map(|l| l.offset), Some([4_428_000.0; 3]));
        let wide = Aabb { min: [0.0; 3], max: [4_428_000.0; 3] };
        assert_eq!(held(&far, &wide), None);
        assert_eq!(held(&far, &Aabb { min: [0.0; 3], max: [1.0; 3] }), Some(far));
    }

    #[test]
    fn a_lattice_is_taken_that_is_whole_steps_away_and_holds_the_points() {
        let own = Lattice { scale: [0.001; 3], offset: [4_428_000.0; 3] };
        let bounds = Aabb { min: [4_428_000.0; 3], max: [4_428_100.0; 3] };
        assert_eq!(with_offset(&own, [4_427_999.999; 3], &bounds).map(|l| l.offset), Some([4_427_999.999; 3]));
        assert_eq!(with_offset(&own, [4_427_999.999_5; 3], &bounds), None, "half a step away");
        assert_eq!(with_offset(&own, [0.0; 3], &bounds), None, "4,428,000,000 steps");
    }
}
