//! How many points there are in each cell of the partition, whatever the order in which they come.

use std::collections::HashMap;

use super::partition::{Partition, coarser};
use crate::cloud::{CellHash, CensusCell, Cube, morton, xyz};

/// A finer census is not kept: cells of twice the width take its place. A cube of level 6 has no more cells, so those of a
/// finer level are the nodes of every octree that the partition fits ([`crate::cloud::ANCHOR_BITS`]).
const MOST_CELLS: usize = 1 << 18;

/// Points by cell. The width of the cells depends on the points alone: the least at which there are [`MOST_CELLS`] at most.
#[derive(Debug, Default)]
pub(super) struct Counts {
    counts: HashMap<u64, u64, CellHash>,
    /// Levels by which its cells are wider than those of the partition.
    wider: u32,
}

impl Counts {
    /// Adds points of a cell of the partition.
    pub(super) fn add(&mut self, cell: u64, points: u64) {
        *self.counts.entry(coarser(cell, self.wider)).or_default() += points;
        if self.counts.len() > MOST_CELLS {
            self.widen(self.wider + 1);
        }
    }

    /// Adds what another thread has counted.
    pub(super) fn merge(&mut self, mut other: Self) {
        let wider = self.wider.max(other.wider);
        self.widen(wider);
        other.widen(wider);
        for (cell, points) in other.counts {
            *self.counts.entry(coarser(cell, self.wider - wider)).or_default() += points;
            if self.counts.len() > MOST_CELLS {
                self.widen(self.wider + 1); // what is still to come is `wider`, as before
            }
        }
    }

    fn widen(&mut self, wider: u32) {
        let by = wider - self.wider;
        if by > 0 {
            let finer = std::mem::take(&mut self.counts);
            for (cell, points) in finer {
                *self.counts.entry(coarser(cell, by)).or_default() += points;
            }
            self.wider = wider;
        }
    }

    /// Memory that it takes, bytes.
    pub(super) fn bytes(&self) -> u64 {
        (self.counts.capacity() * (size_of::<(u64, u64)>() + 1)) as u64
    }

    /// The cells, in Morton order.
    pub(super) fn finish(self, partition: &Partition, cube: &Cube) -> Vec<CensusCell> {
        let Self { counts, wider } = self;
        let cell = |(cell, points)| CensusCell { key: partition.node(cell, wider, cube), points, repeats: 0 };
        let mut cells: Vec<CensusCell> = counts.into_iter().map(cell).collect();
        cells.sort_unstable_by(|a, b| morton::compare(xyz(a.key), xyz(b.key)));
        cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gather::partition::pack;

    fn count(cells: impl Iterator<Item = u64>) -> (u32, Vec<(u64, u64)>) {
        let mut census = Counts::default();
        cells.for_each(|cell| census.add(cell, 1));
        let mut counts: Vec<_> = census.counts.into_iter().collect();
        counts.sort_unstable();
        (census.wider, counts)
    }

    #[test]
    fn too_many_cells_become_wider_ones_whatever_their_order_and_the_threads() {
        let at = |i: u64| pack([i / 6400, i / 80 % 80, i % 80]);
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
        let mut merged: Vec<_> = few.counts.into_iter().collect();
        merged.sort_unstable();
        assert_eq!((few.wider, merged), forwards);
        assert_eq!(count(cells.iter().take(1000).copied()).0, 0);
    }
}
