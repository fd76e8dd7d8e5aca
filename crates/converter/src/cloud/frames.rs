//! The coordinate frames that a point passes through, as types, so that no two can be mixed up:
//!
//! ```text
//! source lattice ──SourceMap──▶ job lattice ──StoredOrigin──▶ stored records
//!  (reader's columns)            JobPoint  ◀──────────────     StoredPoint
//!                                   │ Cube
//!                                   ▼
//!                                tree coordinates ──interleave──▶ Morton order
//!                                TreePoint
//! ```
//!
//! Each is a plain array of integers; the compiler sees through them.

use std::ops::{Index, IndexMut};

use serde::{Deserialize, Serialize};

/// Integers on the lattice of the run: `world = q · scale + offset`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[repr(transparent)]
pub(crate) struct JobPoint(pub(crate) [i64; 3]);

/// Integers as records store them: those of the job lattice, counted from [`StoredOrigin`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[repr(transparent)]
pub(crate) struct StoredPoint(pub(crate) [i32; 3]);

/// 31-bit fractions of the root cube: the cell at level `l` is `t >> (31 - l)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[repr(transparent)]
pub(crate) struct TreePoint(pub(crate) [u32; 3]);

impl TreePoint {
    /// The cell that is `2^shift` units wide.
    #[inline]
    pub(crate) fn cell(self, shift: u32) -> [u32; 3] {
        self.0.map(|t| t >> shift)
    }
}

/// The job point that is stored as zeros.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct StoredOrigin(pub(crate) JobPoint);

impl StoredOrigin {
    /// From stored to job coordinates.
    #[inline]
    pub(crate) fn job(self, stored: StoredPoint) -> JobPoint {
        JobPoint(std::array::from_fn(|a| i64::from(stored.0[a]) + self.0.0[a]))
    }

    /// From job to stored coordinates, which must fit.
    #[inline]
    pub(crate) fn stored(self, job: JobPoint) -> StoredPoint {
        StoredPoint(std::array::from_fn(|a| (job.0[a] - self.0.0[a]) as i32))
    }
}

/// Points on the job lattice, one column per axis.
#[derive(Debug, Default)]
pub(crate) struct JobColumns(pub(crate) [Vec<i64>; 3]);

impl JobColumns {
    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.0[0].len()
    }

    /// The point of a row.
    #[cfg(test)]
    pub(crate) fn point(&self, row: usize) -> JobPoint {
        JobPoint([self.0[0][row], self.0[1][row], self.0[2][row]])
    }
}

/// Bounds on the job lattice, closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct JobBounds {
    pub(crate) min: JobPoint,
    pub(crate) max: JobPoint,
}

impl JobBounds {
    pub(crate) const EMPTY: Self = Self { min: JobPoint([i64::MAX; 3]), max: JobPoint([i64::MIN; 3]) };

    pub(crate) fn new(min: [i64; 3], max: [i64; 3]) -> Self {
        Self { min: JobPoint(min), max: JobPoint(max) }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.min[0] > self.max[0]
    }

    pub(crate) fn union(&mut self, other: &Self) {
        for a in 0..3 {
            self.min[a] = self.min[a].min(other.min[a]);
            self.max[a] = self.max[a].max(other.max[a]);
        }
    }

    /// Steps from the least to the greatest coordinate.
    pub(crate) fn extent(&self, axis: usize) -> u64 {
        self.max[axis].abs_diff(self.min[axis])
    }
}

macro_rules! by_axis {
    ($($point:ty => $value:ty),*) => {$(
        impl Index<usize> for $point {
            type Output = $value;

            #[inline]
            fn index(&self, axis: usize) -> &$value {
                &self.0[axis]
            }
        }

        impl IndexMut<usize> for $point {
            #[inline]
            fn index_mut(&mut self, axis: usize) -> &mut $value {
                &mut self.0[axis]
            }
        }
    )*};
}
by_axis!(JobPoint => i64, StoredPoint => i32, TreePoint => u32);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_points_come_back_and_bounds_grow() {
        let origin = StoredOrigin(JobPoint([1 << 40, -5, 0]));
        let p = JobPoint([(1 << 40) - 7, 2_000_000_000, -3]);
        assert_eq!(origin.stored(p), StoredPoint([-7, 2_000_000_005, -3]));
        assert_eq!(origin.job(origin.stored(p)), p);
        let mut bounds = JobBounds::EMPTY;
        bounds.union(&JobBounds { min: p, max: p });
        bounds.union(&JobBounds::new([0; 3], [0; 3]));
        assert_eq!((bounds.min[1], bounds.max[1], bounds.extent(2)), (0, 2_000_000_000, 3));
    }
}
