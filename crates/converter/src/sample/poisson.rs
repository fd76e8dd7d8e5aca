//! A maximal Poisson-disk sample: no two points closer than the spacing, and every candidate closer than the spacing
//! to one that was taken. By greedy choice in a fixed order, with a grid of cells as wide as the spacing, so that only
//! the 27 cells around a candidate can hold a conflict.

use super::{SPACING_BITS, cell_shift};
use crate::morton::interleave;

const GRID_BITS: u32 = SPACING_BITS;
const NONE: u32 = u32::MAX;

/// The grid, kept from node to node; all empty in between.
pub(super) struct Poisson {
    /// First taken point of each cell, by Morton code of the cell: neighbours in space are near in memory.
    heads: Vec<u32>,
    /// The next taken point of the same cell.
    next: Vec<u32>,
    taken: Vec<[u32; 3]>,
    touched: Vec<u32>,
}

impl Default for Poisson {
    fn default() -> Self {
        Self { heads: vec![NONE; 1 << (3 * GRID_BITS)], next: Vec::new(), taken: Vec::new(), touched: Vec::new() }
    }
}

impl Poisson {
    pub(super) fn choose(&mut self, level: u8, candidates: &[[u32; 3]], accepted: &mut [bool]) {
        let shift = cell_shift(level);
        let spacing = 1u64 << shift;
        let min_squared = spacing * spacing;
        for (t, accepted) in candidates.iter().zip(accepted) {
            let cell = t.map(|t| t >> shift & ((1 << GRID_BITS) - 1));
            if !self.conflicts(*t, cell, min_squared) {
                *accepted = true;
                self.take(*t, cell);
            }
        }
        for cell in self.touched.drain(..) {
            self.heads[cell as usize] = NONE;
        }
        self.next.clear();
        self.taken.clear();
    }

    #[inline]
    fn take(&mut self, t: [u32; 3], cell: [u32; 3]) {
        let at = interleave(cell) as u32;
        let head = &mut self.heads[at as usize];
        if *head == NONE {
            self.touched.push(at);
        }
        self.next.push(*head);
        *head = self.taken.len() as u32;
        self.taken.push(t);
    }

    #[inline]
    fn conflicts(&self, t: [u32; 3], cell: [u32; 3], min_squared: u64) -> bool {
        // The last points taken are near in Morton order, so most conflicts are found at once.
        if self.taken.iter().rev().take(2).any(|o| squared(t, *o) < min_squared) {
            return true;
        }
        let range = |c: u32| c.saturating_sub(1)..=(c + 1).min((1 << GRID_BITS) - 1);
        for x in range(cell[0]) {
            for y in range(cell[1]) {
                for z in range(cell[2]) {
                    let mut at = self.heads[interleave([x, y, z]) as usize];
                    while at != NONE {
                        if squared(t, self.taken[at as usize]) < min_squared {
                            return true;
                        }
                        at = self.next[at as usize];
                    }
                }
            }
        }
        false
    }
}

#[inline]
fn squared(a: [u32; 3], b: [u32; 3]) -> u64 {
    (0..3).map(|i| u64::from(a[i].abs_diff(b[i])).pow(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_taken_are_closer_than_the_spacing_and_no_candidate_is_farther_from_all() {
        let level = 14u8;
        let spacing = 1u64 << cell_shift(level);
        let mut state = 3u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 47) as u32
        };
        // One node of that level, a slab of it, with repeated points.
        let mut candidates: Vec<[u32; 3]> = (0..6000).map(|_| [next(), next(), next() >> 5]).collect();
        candidates.extend_from_within(0..500);
        candidates.sort_unstable_by(|a, b| crate::morton::compare(*a, *b));
        let mut poisson = Poisson::default();
        for _ in 0..2 {
            let mut accepted = vec![false; candidates.len()];
            poisson.choose(level, &candidates, &mut accepted);
            let taken: Vec<_> = candidates.iter().zip(&accepted).filter(|(_, a)| **a).map(|(t, _)| *t).collect();
            for (i, a) in taken.iter().enumerate() {
                assert!(taken[..i].iter().all(|b| squared(*a, *b) >= spacing * spacing));
            }
            for c in &candidates {
                assert!(taken.iter().any(|t| squared(*c, *t) < spacing * spacing));
            }
            assert!(taken.len() > 100 && taken.len() < candidates.len());
        }
    }

    #[test]
    fn below_the_resolution_only_repeated_places_conflict() {
        let candidates = [[5, 5, 5], [5, 5, 5], [5, 5, 6]];
        let mut accepted = [false; 3];
        Poisson::default().choose(30, &candidates, &mut accepted);
        assert_eq!(accepted, [true, false, true]);
    }
}
