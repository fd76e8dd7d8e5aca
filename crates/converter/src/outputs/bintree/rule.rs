//! Axis and plane of a node, from exact integers (`docs/formats/bintree.md`, section 6.2).

use pointmill_format::bintree::SplitRule;

use crate::cloud::{JobBounds, Moments};

/// At this depth and below the median is used, or outliers would make trees without end.
const MEDIAN_DEPTH: usize = 64;

/// The rule of a node at `depth` (root: 0).
pub(super) fn rule_at(rule: SplitRule, depth: usize) -> SplitRule {
    if depth >= MEDIAN_DEPTH { SplitRule::Median } else { rule }
}

/// The axis of the largest extent, ties to the lowest; `None` if all points share one place.
pub(super) fn longest_axis(bounds: &JobBounds, scale: [f64; 3]) -> Option<usize> {
    let steps = |a: usize| bounds.extent(a);
    let extent = |a: usize| steps(a) as f64 * scale[a];
    let longest = (1..3).fold(0, |best, a| if extent(a) > extent(best) { a } else { best });
    // Extents of different axes may underflow to the same double; one with points apart is there if any is.
    if steps(longest) > 0 { Some(longest) } else { (0..3).find(|a| steps(*a) > 0) }
}

/// The plane's integer by mean or midpoint: the low side is what is not above it. `None` for the median.
pub(super) fn plane(rule: SplitRule, moments: &Moments, points: u64, axis: usize) -> Option<i64> {
    let (min, max) = (moments.bounds.min[axis], moments.bounds.max[axis]);
    match rule {
        SplitRule::Mean => Some(moments.sum[axis].div_euclid(i128::from(points)) as i64),
        SplitRule::Midpoint => Some(((i128::from(min) + i128::from(max)) >> 1) as i64),
        SplitRule::Median => None,
    }
}

/// True for the low side: a plane's own points belong to it. Stored integers or those of the run, both of one kind.
#[inline(always)]
pub(super) fn is_low<T: Ord + Copy>(value: T, plane: T) -> bool {
    value <= plane
}

/// Rank of the median, from 0.
pub(super) fn median_rank(points: u64) -> u64 {
    points.saturating_sub(1) / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::JobPoint;

    fn moments(values: &[i64]) -> Moments {
        let mut m = Moments::default();
        values.iter().for_each(|v| m.add(JobPoint([*v, 0, 0])));
        m
    }

    #[test]
    fn the_mean_is_rounded_towards_minus_infinity_and_below_the_maximum() {
        let at = |v: &[i64]| plane(SplitRule::Mean, &moments(v), v.len() as u64, 0).unwrap();
        assert_eq!((at(&[1, 2]), at(&[-1, -2]), at(&[-1, 0]), at(&[5, 5, 6])), (1, -2, -1, 5));
        assert_eq!(at(&[i64::MAX / 2, i64::MAX / 2 + 1]), i64::MAX / 2);
        let mid = |v: &[i64]| plane(SplitRule::Midpoint, &moments(v), v.len() as u64, 0).unwrap();
        assert_eq!((mid(&[-3, 0]), mid(&[0, 0, 9])), (-2, 4));
    }

    #[test]
    fn the_longest_axis_is_that_of_the_world_and_ties_go_to_the_lowest() {
        let b = |max: [i64; 3]| JobBounds::new([0; 3], max);
        assert_eq!(longest_axis(&b([5, 7, 7]), [1.0; 3]), Some(1));
        assert_eq!(longest_axis(&b([5, 7, 7]), [1.0, 0.1, 1.0]), Some(2));
        assert_eq!(longest_axis(&b([100, 7, 7]), [0.01, 1.0, 1.0]), Some(1));
        assert_eq!(longest_axis(&b([0; 3]), [1.0; 3]), None);
        assert_eq!(longest_axis(&b([0, 1, 0]), [1.0, 0.0, 1.0]), Some(1));
        // equal in single precision
        assert_eq!(longest_axis(&b([1 << 25, (1 << 25) + 1, 0]), [1.0; 3]), Some(1));
        assert_eq!(longest_axis(&b([1 << 25, 1 << 25, (1 << 25) + 1]), [0.001; 3]), Some(2));
    }

    #[test]
    fn a_planes_own_points_are_on_its_low_side() {
        assert_eq!([-3, -2, -1].map(|v| is_low(v, -2)), [true, true, false]);
    }
}
