//! Exact sums and extremes of positions: what the upper splits of a binary tree need to know of a cell.

use serde::{Deserialize, Serialize};

use super::frames::{JobBounds, JobColumns, JobPoint};

/// Of the points of a cell, on the job lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Moments {
    /// Exact: 2^64 points of 63 bits fit.
    pub(crate) sum: [i128; 3],
    pub(crate) bounds: JobBounds,
}

impl Default for Moments {
    fn default() -> Self {
        Self { sum: [0; 3], bounds: JobBounds::EMPTY }
    }
}

impl Moments {
    /// True if so many points within these bounds can have them.
    pub(crate) fn can_be_of(&self, points: u64, all: &JobBounds) -> bool {
        (0..3).all(|a| {
            let (min, max, points) = (self.bounds.min[a], self.bounds.max[a], i128::from(points));
            let is_inside = all.min[a] <= min && min <= max && max <= all.max[a];
            is_inside && (i128::from(min) * points..=i128::from(max) * points).contains(&self.sum[a])
        })
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for a in 0..3 {
            self.sum[a] += other.sum[a];
        }
        self.bounds.union(&other.bounds);
    }

    /// Adds points, given as three columns and the rows to take.
    pub(crate) fn add_rows(&mut self, q: &JobColumns, rows: &[u32]) {
        for (a, column) in q.0.iter().enumerate() {
            let (mut sum, mut min, mut max) = (0i128, i64::MAX, i64::MIN);
            for &row in rows {
                let v = column[row as usize];
                sum += i128::from(v);
                min = min.min(v);
                max = max.max(v);
            }
            self.sum[a] += sum;
            self.bounds.min[a] = self.bounds.min[a].min(min);
            self.bounds.max[a] = self.bounds.max[a].max(max);
        }
    }

    /// Adds one point.
    #[inline]
    pub(crate) fn add(&mut self, q: JobPoint) {
        for (a, v) in q.0.into_iter().enumerate() {
            self.sum[a] += i128::from(v);
            self.bounds.min[a] = self.bounds.min[a].min(v);
            self.bounds.max[a] = self.bounds.max[a].max(v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_exact_where_doubles_and_64_bits_are_not() {
        let far = i64::MAX / 2;
        let q = JobColumns([vec![far; 5], vec![-far; 5], vec![1, 2, 3, 4, 5]]);
        let mut m = Moments::default();
        m.add_rows(&q, &[0, 1, 2, 3]);
        let mut last = Moments::default();
        last.add(JobPoint([far, -far, 5]));
        m.merge(&last);
        assert_eq!(m.sum, [5 * i128::from(far), -5 * i128::from(far), 15]);
        assert_eq!(m.bounds, JobBounds::new([far, -far, 1], [far, -far, 5]));
    }

    /// 4096 coordinates around `middle` on each axis, the second mirrored, and their sums.
    fn some(middle: i64) -> (JobColumns, [i128; 3]) {
        let x: Vec<i64> = (0..4096).map(|i| middle + i * i * 7 - 1_000_003 * i).collect();
        let sum = 4096 * i128::from(middle) + (0..4096i128).map(|i| i * i * 7 - 1_000_003 * i).sum::<i128>();
        let mirrored = x.iter().map(|v| -v).collect();
        (JobColumns([x, mirrored, (0..4096).collect()]), [sum, -sum, 4095 * 2048])
    }

    #[test]
    fn sums_of_a_thousand_million_coordinates_are_exact_wherever_they_are() {
        for middle in [0, 5_400_000_000, -(1 << 62), (1 << 62) - 1] {
            let (q, sum) = some(middle);
            let mut m = Moments::default();
            m.add_rows(&q, &(0..4096).collect::<Vec<u32>>());
            (0..18).for_each(|_| m.merge(&m.clone())); // 2^30 points
            assert_eq!(m.sum, sum.map(|v| v << 18), "{middle}");
        }
    }

    #[test]
    #[ignore = "long: each is added by itself"]
    fn so_are_those_of_points_one_by_one() {
        let (q, sum) = some((1 << 62) - 1);
        let mut m = Moments::default();
        (0..1u64 << 18).for_each(|_| (0..4096).for_each(|row| m.add(q.point(row))));
        assert_eq!(m.sum, sum.map(|v| v << 18));
    }
}
