//! Points grouped by cell, in time proportional to their number.

use std::collections::HashMap;

/// Hashes cell codes. They come from the grid, not from an adversary, and one multiplication spreads them.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CellHasher(u64);

pub(crate) type CellHash = std::hash::BuildHasherDefault<CellHasher>;

impl std::hash::Hasher for CellHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.write_u64(u64::from(*b)));
    }

    #[inline]
    fn write_u64(&mut self, v: u64) {
        let p = u128::from(self.0 ^ v) * 0x9e37_79b9_7f4a_7c15;
        self.0 = (p as u64) ^ (p >> 64) as u64;
    }

    #[inline]
    fn finish(&self) -> u64 {
        self.0
    }
}

/// Groups points by cell: a counting sort over the few cells that a batch of points touches.
#[derive(Default)]
pub(crate) struct Grouping {
    /// Indices of the points, cell by cell.
    pub(crate) order: Vec<u32>,
    /// Where each point is in `order`; empty if all are where they were.
    pub(crate) places: Vec<u32>,
    /// Cell and number of points, in the order of `order`.
    pub(crate) groups: Vec<(u64, u32)>,
    local: HashMap<u64, u32, CellHash>,
    ids: Vec<u32>,
    seen: Vec<(u64, u32)>,
    by_cell: Vec<(u64, u32)>,
    starts: Vec<u32>,
}

impl Grouping {
    /// Counts the points of each cell: `groups` are known then, in order of appearance. [`Self::arrange`] or
    /// [`Self::leave`] must follow.
    pub(crate) fn count(&mut self, cells: &[u64]) {
        self.local.clear();
        self.groups.clear();
        self.ids.clear();
        let (mut last, mut id) = (None, 0);
        for &cell in cells {
            // Neighbours in a scan mostly share their cell.
            if last != Some(cell) {
                last = Some(cell);
                id = *self.local.entry(cell).or_insert_with(|| {
                    self.groups.push((cell, 0));
                    (self.groups.len() - 1) as u32
                });
            }
            self.ids.push(id);
            self.groups[id as usize].1 += 1;
        }
    }

    /// Puts the counted points in order: cell by cell, cells in ascending order of `rank`.
    pub(crate) fn arrange(&mut self, rank: impl Fn(u64) -> u64) {
        // Cells next to each other in space lie next to each other in the block.
        self.by_cell.clear();
        self.by_cell.extend(self.groups.iter().zip(0..).map(|((cell, _), id)| (rank(*cell), id)));
        self.by_cell.sort_unstable();
        self.starts.clear();
        self.starts.resize(self.groups.len(), 0);
        self.seen.clear();
        let mut start = 0;
        for (_, id) in &self.by_cell {
            let group = self.groups[*id as usize];
            self.starts[*id as usize] = start;
            self.seen.push(group);
            start += group.1;
        }
        std::mem::swap(&mut self.groups, &mut self.seen);
        self.order.clear();
        self.order.resize(self.ids.len(), 0);
        self.places.clear();
        self.places.reserve(self.ids.len());
        let mut i = 0;
        for run in self.ids.chunk_by(|a, b| a == b) {
            let start = &mut self.starts[run[0] as usize];
            let places = *start..*start + run.len() as u32;
            *start = places.end;
            self.order[places.start as usize..places.end as usize].iter_mut().zip(i..).for_each(|(to, i)| *to = i);
            self.places.extend(places);
            i += run.len() as u32;
        }
    }

    /// Keeps points of no known cell in the order in which they came.
    pub(crate) fn keep(&mut self, points: usize) {
        self.groups.clear();
        self.places.clear();
        self.order.clear();
        self.order.extend(0..points as u32);
    }

    /// Leaves the counted points in the order in which they came.
    pub(crate) fn leave(&mut self) {
        self.places.clear();
        self.order.clear();
        self.order.extend(0..self.ids.len() as u32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grouping_keeps_every_point_once_and_cells_together_in_input_order() {
        let mut g = Grouping::default();
        g.count(&[7, 7, 3, 7, 1, 3]);
        g.arrange(|cell| cell);
        assert!(g.order.iter().zip(0..).all(|(i, place)| g.places[*i as usize] == place));
        let mut seen = 0;
        for &(cell, count) in &g.groups {
            let members = &g.order[seen..seen + count as usize];
            assert!(members.is_sorted());
            assert!(members.iter().all(|i| [7, 7, 3, 7, 1, 3][*i as usize] == cell));
            seen += count as usize;
        }
        assert_eq!(seen, 6);
        assert_eq!(g.groups, [(1, 1), (3, 2), (7, 3)]);
        g.count(&[4, 4, 2]);
        g.leave();
        assert!(g.places.is_empty());
        assert_eq!((&g.groups[..], &g.order[..]), (&[(4, 2), (2, 1)][..], &[0, 1, 2][..]));
        g.keep(2);
        assert!(g.groups.is_empty() && g.order == [0, 1]);
    }
}
