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
    /// Cell and number of points, in the order of `order`.
    pub(crate) groups: Vec<(u64, u32)>,
    local: HashMap<u64, u32, CellHash>,
    ids: Vec<u32>,
    seen: Vec<(u64, u32)>,
    starts: Vec<u32>,
}

impl Grouping {
    /// Groups points, given the cell of each; cells come in ascending order of `rank`.
    pub(crate) fn group(&mut self, cells: &[u64], rank: impl Fn(u64) -> u64) {
        self.local.clear();
        self.seen.clear();
        self.ids.clear();
        let (mut last, mut id) = (None, 0);
        for &cell in cells {
            // Neighbours in a scan mostly share their cell.
            if last != Some(cell) {
                last = Some(cell);
                id = *self.local.entry(cell).or_insert_with(|| {
                    self.seen.push((cell, 0));
                    (self.seen.len() - 1) as u32
                });
            }
            self.ids.push(id);
            self.seen[id as usize].1 += 1;
        }
        // Cells next to each other in space lie next to each other in the block.
        let mut by_cell: Vec<u32> = (0..self.seen.len() as u32).collect();
        by_cell.sort_unstable_by_key(|&id| rank(self.seen[id as usize].0));
        self.starts.clear();
        self.starts.resize(self.seen.len(), 0);
        self.groups.clear();
        let mut start = 0;
        for &id in &by_cell {
            self.starts[id as usize] = start;
            self.groups.push(self.seen[id as usize]);
            start += self.seen[id as usize].1;
        }
        self.order.clear();
        self.order.resize(cells.len(), 0);
        for (i, &id) in self.ids.iter().enumerate() {
            let at = &mut self.starts[id as usize];
            self.order[*at as usize] = i as u32;
            *at += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grouping_keeps_every_point_once_and_cells_together_in_input_order() {
        let mut g = Grouping::default();
        g.group(&[7, 7, 3, 7, 1, 3], |cell| cell);
        let mut seen = 0;
        for &(cell, count) in &g.groups {
            let members = &g.order[seen..seen + count as usize];
            assert!(members.is_sorted());
            assert!(members.iter().all(|i| [7, 7, 3, 7, 1, 3][*i as usize] == cell));
            seen += count as usize;
        }
        assert_eq!(seen, 6);
        assert_eq!(g.groups, [(1, 1), (3, 2), (7, 3)]);
    }
}
