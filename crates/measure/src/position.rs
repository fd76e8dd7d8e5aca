//! How far the positions that a dataset decodes to are from those of the scans.

use rayon::prelude::*;
use serde::Serialize;

/// Differences of coordinates along one axis, world units.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AxisError {
    /// The largest.
    pub max: f64,
    /// Root of the mean of squares.
    pub rms: f64,
    /// 99.9 % of the points have no larger one.
    pub p999: f64,
}

/// The coordinates of a cloud along each axis, sorted.
///
/// Rounding to a lattice keeps the order of coordinates: the i-th coordinate of the scans became the i-th of the dataset,
/// so sorted lists give the error of every point, although nothing says which point is which. Rounding that does not keep the
/// order, as of batches whose boxes overlap, has an error that is at least this one: no matching of two lists of numbers has a
/// smaller sum of squares, nor a smaller largest difference, than the sorted one.
pub(crate) struct Sorted([Vec<f64>; 3]);

impl Sorted {
    pub(crate) fn new(xyz: &[Vec<f64>; 3]) -> Self {
        Self(xyz.each_ref().map(|axis| {
            let mut sorted = axis.clone();
            sorted.par_sort_unstable_by(f64::total_cmp);
            sorted
        }))
    }

    /// The errors by axis; `None` if the two do not have the same number of points.
    pub(crate) fn errors(&self, decoded: &[Vec<f64>; 3]) -> Option<[AxisError; 3]> {
        if self.0[0].len() != decoded[0].len() {
            return None;
        }
        let mut errors = [AxisError::default(); 3];
        for ((error, exact), decoded) in errors.iter_mut().zip(&self.0).zip(decoded) {
            let mut sorted = decoded.clone();
            sorted.par_sort_unstable_by(f64::total_cmp);
            sorted.par_iter_mut().zip(exact).for_each(|(d, e)| *d = (*d - e).abs());
            *error = of_differences(sorted);
        }
        Some(errors)
    }
}

fn of_differences(mut differences: Vec<f64>) -> AxisError {
    let count = differences.len();
    if count == 0 {
        return AxisError::default();
    }
    let squares: f64 = differences.par_chunks(1 << 16).map(|part| part.iter().map(|d| d * d).sum::<f64>()).sum();
    let max = differences.par_iter().copied().reduce(|| 0.0, f64::max);
    // the number of points that are at most as far off: 999 of 1000, rounded up
    let rank = (count * 999).div_ceil(1000) - 1;
    let (_, p999, _) = differences.select_nth_unstable_by(rank, f64::total_cmp);
    AxisError { max, rms: (squares / count as f64).sqrt(), p999: *p999 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_those_of_the_points_in_whatever_order() {
        let exact = [vec![3.0, 1.0, 2.0, 4.0], vec![0.0; 4], vec![-1.0, 1.0, 1.0, 1.0]];
        let decoded = [vec![4.5, 1.0, 3.0, 2.0], vec![0.25; 4], vec![1.0, 1.0, -1.0, 1.0]];
        let [x, y, z] = Sorted::new(&exact).errors(&decoded).unwrap();
        assert_eq!(x, AxisError { max: 0.5, rms: 0.25, p999: 0.5 });
        assert_eq!(y, AxisError { max: 0.25, rms: 0.25, p999: 0.25 });
        assert_eq!(z, AxisError::default());
        assert_eq!(Sorted::new(&exact).errors(&[vec![1.0], vec![1.0], vec![1.0]]), None);
        let nothing = [const { Vec::new() }; 3];
        assert_eq!(Sorted::new(&nothing).errors(&nothing), Some([AxisError::default(); 3]));
    }

    #[test]
    fn one_point_in_a_thousand_may_be_farther_off() {
        let exact: Vec<f64> = (0..2000).map(f64::from).collect();
        let off = |far: usize| (0..2000).map(|i| i as f64 + if i < far { 0.5 } else { 0.125 }).collect::<Vec<_>>();
        let p999 = |far: usize| {
            let sorted = Sorted([exact.clone(), Vec::new(), Vec::new()]);
            sorted.errors(&[off(far), Vec::new(), Vec::new()]).unwrap()[0].p999
        };
        assert_eq!((p999(2), p999(3)), (0.125, 0.5));
    }
}
