//! What moving to the job lattice means for points: do their integers come back, and is it more than rounding?

use pointmill_format::Lattice;

use crate::cloud::{JobBounds, JobColumns};

/// By how much the points of a slice move on each axis: all by the same, or each by the value in a column.
pub(crate) type Change<'a> = [Result<f64, &'a [f64]>; 3];

/// Doubles of a size differ by up to this times the size after a few operations.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Moved by this part of a step, an integer does not come back: a position between two is neither's.
const HALF: f64 = 0.499_999;

/// Points whose integers on the lattice of their scan do not come back.
pub(super) fn integers_lost(change: &Change<'_>, source: &Lattice, points: usize) -> u64 {
    if change.iter().all(Result::is_ok) {
        return 0; // all points of the scan are points of the job lattice
    }
    let is_lost = |axis: usize, i: usize| change[axis].is_err_and(|c| c[i].abs() >= HALF * source.scale[axis]);
    (0..points).filter(|i| (0..3).any(|a| is_lost(a, *i))).count() as u64
}

/// True if a point moves by more than doubles of its coordinates are rounded.
pub(crate) fn is_more_than_rounding(change: &Change<'_>, q: &JobColumns, bounds: &JobBounds, job: &Lattice) -> bool {
    (0..3).any(|a| {
        let offset = job.offset[a];
        let size = |q: i64| (q as f64 * job.scale[a] + offset).abs().max(offset.abs());
        let least = if bounds.min[a] < 0 && bounds.max[a] > 0 || offset != 0.0 {
            offset.abs()
        } else {
            size(bounds.min[a]).min(size(bounds.max[a]))
        };
        match change[a] {
            Ok(by) => by.abs() > ROUNDING * size(bounds.min[a]).max(size(bounds.max[a])),
            Err(column) => {
                let largest = column.iter().fold(0.0, |max: f64, v| if v.abs() > max { v.abs() } else { max });
                let each = || column.iter().zip(&q.0[a]).any(|(v, q)| v.abs() > ROUNDING * size(*q));
                largest > ROUNDING * least && each()
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(offset: f64) -> Lattice {
        Lattice { scale: [0.01; 3], offset: [offset; 3] }
    }

    fn moves(column: &[f64], q: &[i64], offset: f64) -> bool {
        let columns = JobColumns([q.to_vec(), q.to_vec(), q.to_vec()]);
        let ends = |f: fn(i64, i64) -> i64| [q.iter().copied().reduce(f).unwrap(); 3];
        let bounds = JobBounds::new(ends(i64::min), ends(i64::max));
        is_more_than_rounding(&[Ok(0.0), Err(column), Ok(0.0)], &columns, &bounds, &job(offset))
    }

    #[test]
    fn each_point_is_judged_by_its_own_size_and_not_by_the_farthest() {
        assert!(!moves(&[0.0, 1e-17], &[0, 7], 0.0), "7 · 0.01 and 0.07");
        assert!(moves(&[1e-9, 0.0], &[1, 10_i64.pow(17)], 0.0), "one far away does not excuse the others");
        assert!(!moves(&[1e-10, 1e-10], &[540_000_000, 540_000_007], 0.0));
        assert!(!moves(&[1e-10, 0.0], &[-3, 3], 5_400_000.0) && moves(&[1e-8, 0.0], &[-3, 3], 5_400_000.0));
    }

    #[test]
    fn half_a_step_of_the_scan_loses_its_integer() {
        let source = Lattice { scale: [0.001; 3], offset: [0.0; 3] };
        let (x, z) = ([0.0005, 0.0, 0.0004], [0.0, -0.002, 0.0]);
        assert_eq!(integers_lost(&[Err(&x), Ok(0.0), Err(&z)], &source, 3), 2);
        assert_eq!(integers_lost(&[Ok(1e-9), Ok(0.0), Ok(0.0)], &source, 3), 0);
    }
}
