//! How many points there are in each cell of a level of the octree, whatever the order in which they come.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use crate::cloud::{CellHash, CensusCell, node};

/// A finer census is not kept: cells of twice the width take its place. A cube has no more cells of level 6.
const MOST_CELLS: usize = 1 << 18;

/// Points by Morton code of the cell. The width of the cells depends on the points alone: the least at which there are
/// [`MOST_CELLS`] at most.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Counts {
    counts: HashMap<u64, u64, CellHash>,
    /// Levels by which its cells are wider than those that are counted.
    wider: u32,
}

impl Counts {
    /// Adds points of a cell.
    pub(super) fn add(&mut self, code: u64, points: u64) {
        *self.counts.entry(coarser(code, self.wider)).or_default() += points;
        while self.counts.len() > MOST_CELLS {
            self.widen(self.wider + 1);
        }
    }

    /// Adds what another thread has counted.
    pub(super) fn merge(&mut self, mut other: Self) {
        let wider = self.wider.max(other.wider);
        self.widen(wider);
        other.widen(wider);
        for (code, points) in other.counts {
            *self.counts.entry(coarser(code, self.wider - wider)).or_default() += points;
            while self.counts.len() > MOST_CELLS {
                self.widen(self.wider + 1); // what is still to come is `wider`, as before
            }
        }
    }

    fn widen(&mut self, wider: u32) {
        let by = wider - self.wider;
        if by > 0 {
            let finer = std::mem::take(&mut self.counts);
            for (code, points) in finer {
                *self.counts.entry(coarser(code, by)).or_default() += points;
            }
            self.wider = wider;
        }
    }

    /// True if it can be of so many points in cells of a level.
    pub(super) fn can_be_of(&self, points: u64, level: u32) -> bool {
        let all = self.counts.values().try_fold(0u64, |all, points| all.checked_add(*points));
        let is_cell = |code: &u64| code >> (3 * (level - self.wider)) == 0;
        self.wider <= level && all == Some(points) && self.counts.keys().all(is_cell)
    }

    /// Memory that it takes, bytes.
    pub(super) fn bytes(&self) -> u64 {
        (self.counts.capacity() * (size_of::<(u64, u64)>() + 1)) as u64
    }

    /// The cells, in Morton order; `level`: of those that were counted.
    pub(super) fn finish(self, level: u32) -> Vec<CensusCell> {
        let Self { counts, wider } = self;
        let mut counts: Vec<(u64, u64)> = counts.into_iter().collect();
        counts.sort_unstable();
        let cell = |(code, points)| CensusCell { key: node(code, level - wider), points, repeats: 0 };
        counts.into_iter().map(cell).collect()
    }
}

/// The cell `wider` levels above one.
fn coarser(code: u64, wider: u32) -> u64 {
    code >> (3 * wider)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{morton, xyz};

    fn count(cells: impl Iterator<Item = u64>) -> (u32, Vec<(u64, u64)>) {
        let mut census = Counts::default();
        cells.for_each(|cell| census.add(cell, 1));
        let mut counts: Vec<_> = census.counts.into_iter().collect();
        counts.sort_unstable();
        (census.wider, counts)
    }

    #[test]
    fn too_many_cells_become_wider_ones_whatever_their_order_and_the_threads() {
        let at = |i: u32| morton::interleave([i / 6400, i / 80 % 80, i % 80]);
        let cells: Vec<u64> = (0..80 * 80 * 80).map(at).collect();
        let forwards = count(cells.iter().copied());
        let scattered = count((0..cells.len()).map(|i| cells[i * 7919 % cells.len()]));
        assert_eq!(forwards, scattered);
        assert_eq!((forwards.0, forwards.1.len()), (1, 40 * 40 * 40));
        assert!(forwards.1.iter().all(|(_, points)| *points == 8));
        let mut halves = [Counts::default(), Counts::default()];
        cells.iter().enumerate().for_each(|(i, cell)| halves[usize::from(i > 1000)].add(*cell, 1));
        let [mut few, many] = halves;
        few.merge(many);
        let finished = few.finish(8);
        assert!(finished.is_sorted_by(|a, b| morton::compare(xyz(a.key), xyz(b.key)).is_lt()));
        assert!(finished.iter().all(|cell| cell.key.level == 7 && cell.points == 8));
        assert_eq!(finished.len(), forwards.1.len());
        assert_eq!(count(cells.iter().take(1000).copied()).0, 0);
    }
}
