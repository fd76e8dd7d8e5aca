//! Which points do not come back from what a format stores of them.

use std::cmp::Ordering;

use pointmill_format::Lattice;
use serde::{Deserialize, Serialize};

use crate::cloud::{BigSort, Cloud};
use crate::error::ConvertError;
use crate::runtime::Runtime;

/// Points that do not come back.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Lost {
    /// Points whose decoded position is rounded to other integers than their own.
    pub(super) points: u64,
    /// Points whose decoded position is that of a point with other integers too.
    pub(super) merged: u64,
}

impl Lost {
    pub(super) fn merge(&mut self, other: Self) {
        self.points += other.points;
        self.merged += other.merged;
    }
}

/// How decoded positions become integers of the lattice again.
#[derive(Debug, Clone, Copy)]
pub(super) struct Recovery {
    lattice: Lattice,
    /// Errors below these cannot change an integer.
    safe: [f64; 3],
}

impl Recovery {
    pub(super) fn new(cloud: &Cloud<'_>) -> Self {
        let (lattice, bounds) = (cloud.lattice.lattice, &cloud.stats.bounds);
        let farthest = |a: usize| {
            let ends = [bounds.min[a], bounds.max[a]].map(|q| q as f64 * lattice.scale[a] + lattice.offset[a]);
            ends.iter().fold(lattice.offset[a].abs(), |far, v| far.max(v.abs()))
        };
        Self::within(lattice, std::array::from_fn(farthest))
    }

    /// `farthest`: the largest coordinate, without its sign.
    fn within(lattice: Lattice, farthest: [f64; 3]) -> Self {
        // the sum that is decoded, the difference from the offset and the quotient are rounded
        let safe = std::array::from_fn(|a| lattice.scale[a] * 0.499_999 - farthest[a] * 8.0 * f64::EPSILON);
        Self { lattice, safe }
    }

    /// True if points that are off by at most `max` come back, and none falls together with another.
    pub(super) fn is_certain(&self, max: [f64; 3]) -> bool {
        (0..3).all(|a| max[a] <= self.safe[a])
    }

    /// The integers that a position is rounded to.
    pub(super) fn integers(&self, world: [f64; 3]) -> [i64; 3] {
        std::array::from_fn(|a| self.lattice.quantize(a, world[a]))
    }

    /// Counts what does not come back, of points that are decoded to one system of coordinates: decoded positions and
    /// integers of the lattice.
    pub(super) fn count(&self, points: impl Iterator<Item = ([f64; 3], [i64; 3])>) -> Lost {
        let mut keyed: Vec<([u64; 3], [i64; 3])> = Vec::with_capacity(points.size_hint().0);
        let mut lost = Lost::default();
        for (decoded, q) in points {
            lost.points += u64::from(self.integers(decoded) != q);
            // adding 0 makes −0 the 0 that it equals
            keyed.push((decoded.map(|v| (v + 0.0).to_bits()), q));
        }
        keyed.sort_unstable();
        for run in keyed.chunk_by(|a, b| a.0 == b.0) {
            let is_one_place = run.first().map(|p| p.1) == run.last().map(|p| p.1);
            lost.merged += if is_one_place { 0 } else { run.len() as u64 };
        }
        lost
    }
}

type Compare = fn(&[u8], &[u8]) -> Ordering;

/// [`Recovery::count`] for more points than memory holds.
pub(super) struct LostSort<'a> {
    recovery: Recovery,
    sort: BigSort<'a, Compare>,
    points: u64,
}

/// Decoded position and integers, three words each.
const ENTRY_BYTES: usize = 48;
const DECODED_BYTES: usize = 24;

impl<'a> LostSort<'a> {
    /// In `memory_bytes` of memory.
    pub(super) fn new(rt: &'a Runtime<'a>, memory_bytes: u64, recovery: Recovery) -> Self {
        let compare: Compare = |a, b| a.cmp(b);
        Self { recovery, sort: BigSort::new(rt, ENTRY_BYTES, memory_bytes, compare), points: 0 }
    }

    /// Adds a point.
    pub(super) fn add(&mut self, decoded: [f64; 3], q: [i64; 3]) -> Result<(), ConvertError> {
        self.points += u64::from(self.recovery.integers(decoded) != q);
        // adding 0 makes −0 the 0 that it equals
        let words = decoded.map(|v| (v + 0.0).to_bits()).into_iter().chain(q.map(i64::cast_unsigned));
        self.sort.records().extend(words.flat_map(u64::to_le_bytes));
        self.sort.settle()
    }

    /// What does not come back.
    pub(super) fn finish(self) -> Result<Lost, ConvertError> {
        let mut lost = Lost { points: self.points, merged: 0 };
        let (mut run, mut last, mut is_one_place) = (0u64, Vec::new(), true);
        self.sort.finish(|entry| {
            if last.get(..DECODED_BYTES) != entry.get(..DECODED_BYTES) {
                lost.merged += if is_one_place { 0 } else { run };
                (run, is_one_place) = (0, true);
            } else if last != entry {
                is_one_place = false;
            }
            run += 1;
            last.clear();
            last.extend_from_slice(entry);
            Ok(())
        })?;
        lost.merged += if is_one_place { 0 } else { run };
        Ok(lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_lost_by_other_integers_and_merged_by_one_position() {
        let recovery = Recovery::within(Lattice { scale: [0.5; 3], offset: [10.0; 3] }, [20.0; 3]);
        assert!(recovery.is_certain([0.2; 3]) && !recovery.is_certain([0.2, 0.25, 0.2]));
        let points = [
            ([11.0, 10.0, 10.0], [2, 0, 0]),
            ([11.0, 10.0, 10.0], [2, 0, 0]), // the same point twice is no loss
            ([12.2, 10.0, 10.0], [4, 0, 0]),
            ([13.0, 10.0, 10.0], [6, 0, 0]),
            ([13.0, 10.0, 10.0], [7, 0, 0]), // fell to its neighbour
        ];
        assert_eq!(recovery.count(points.into_iter()), Lost { points: 1, merged: 2 });
    }

    #[test]
    fn far_from_the_origin_of_the_world_rounding_counts() {
        let lattice = Lattice { scale: [1e-9; 3], offset: [0.0; 3] };
        assert!(Recovery::within(lattice, [1.0; 3]).is_certain([4.9e-10; 3]));
        assert!(!Recovery::within(lattice, [1e6; 3]).is_certain([1e-10; 3]));
    }
}
