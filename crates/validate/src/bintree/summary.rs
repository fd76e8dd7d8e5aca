//! What splits above a node need to know of its points.

/// Extremes, exact sums and counts of the lattice integers of a node's points, by axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Summary {
    pub(super) count: u64,
    pub(super) min: [i64; 3],
    pub(super) max: [i64; 3],
    /// 2⁶⁴ points of 63 bits would fit.
    pub(super) sum: [i128; 3],
    /// Points whose coordinate is `max`: they identify a median that falls on the largest value.
    pub(super) at_max: [u64; 3],
}

impl Summary {
    /// Of one axis after the other; `None` without points.
    pub(super) fn of(steps: &[Vec<i64>; 3]) -> Option<Self> {
        let min = [steps[0].iter().min()?, steps[1].iter().min()?, steps[2].iter().min()?].map(|v| *v);
        let max = [steps[0].iter().max()?, steps[1].iter().max()?, steps[2].iter().max()?].map(|v| *v);
        Some(Self {
            count: steps[0].len() as u64,
            min,
            max,
            sum: [0, 1, 2].map(|a| steps[a].iter().map(|v| i128::from(*v)).sum()),
            at_max: [0, 1, 2].map(|a| steps[a].iter().filter(|v| **v == max[a]).count() as u64),
        })
    }

    /// Of the points of both.
    pub(super) fn union(&self, other: &Self) -> Self {
        let max = [0, 1, 2].map(|a| self.max[a].max(other.max[a]));
        let at = |of: &Self, a: usize| if of.max[a] == max[a] { of.at_max[a] } else { 0 };
        Self {
            count: self.count + other.count,
            min: [0, 1, 2].map(|a| self.min[a].min(other.min[a])),
            max,
            sum: [0, 1, 2].map(|a| self.sum[a] + other.sum[a]),
            at_max: [0, 1, 2].map(|a| at(self, a) + at(other, a)),
        }
    }

    /// All points at one place.
    pub(super) fn is_one_place(&self) -> bool {
        self.min == self.max
    }

    /// The axis of the largest extent, of equal ones the lowest, and the three extents in world units.
    pub(super) fn longest_axis(&self, scale: [f64; 3]) -> (usize, [f64; 3]) {
        let steps = [0, 1, 2].map(|a| (i128::from(self.max[a]) - i128::from(self.min[a])) as f64);
        let extents = [0, 1, 2].map(|a| steps[a] * scale[a]);
        let axis = (1..3).fold(0, |best, a| if extents[a] > extents[best] { a } else { best });
        (axis, extents)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_union_of_summaries_is_the_summary_of_the_union() {
        let xs: Vec<i64> = vec![3, 9, -4, 9, 9, 0, 2, 9];
        let steps = |xs: &[i64]| [xs.to_vec(), xs.iter().map(|x| -x).collect(), vec![5; xs.len()]];
        for cut in 1..xs.len() {
            let (a, b) = xs.split_at(cut);
            let union = Summary::of(&steps(a)).unwrap().union(&Summary::of(&steps(b)).unwrap());
            assert_eq!(union, Summary::of(&steps(&xs)).unwrap());
        }
        assert_eq!(Summary::of(&steps(&[])), None);
    }

    #[test]
    fn sums_of_far_coordinates_are_exact() {
        let far = vec![9_000_000_000_000_001; 4000];
        let summary = Summary::of(&[far.clone(), far.clone(), far]).unwrap();
        assert_eq!(summary.sum[0], 36_000_000_000_000_004_000);
    }

    #[test]
    fn of_equal_extents_the_lowest_axis_is_the_longest() {
        let summary = Summary::of(&[vec![0, 5], vec![1, 6], vec![0, 4]]).unwrap();
        assert_eq!(summary.longest_axis([1.0; 3]).0, 0);
        assert_eq!(summary.longest_axis([1.0, 2.0, 2.5]).0, 1);
        assert_eq!(summary.longest_axis([1.0, 1.0, 1.3]).0, 2);
    }
}
