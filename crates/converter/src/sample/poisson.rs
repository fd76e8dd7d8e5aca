//! A maximal Poisson-disk sample: no two points closer than the spacing, and every candidate closer than the spacing
//! to one that was taken. By greedy choice in Morton order.
//!
//! Candidates come in Morton order, so those of a cell are one run, and so are the points taken from it. A cell is two
//! spacings wide. When its run begins, the few taken points around it that can conflict (closer than the spacing to
//! the cell's box) are copied into a small array; each candidate is then compared with that array alone, without
//! branches, and joins it if it is taken.

use super::{SPACING_BITS, cell_shift};
use crate::morton::interleave;

/// Bits of a cell coordinate: cells are two spacings wide.
const GRID_BITS: u32 = SPACING_BITS - 1;
const GRID_MAX: u32 = (1 << GRID_BITS) - 1;

/// The grid, kept from node to node; all empty in between.
pub(super) struct Poisson {
    /// Range in `taken` of each cell, by Morton code of the cell: neighbours in space are near in memory.
    ranges: Vec<Range>,
    touched: Vec<u32>,
    taken: Vec<[u32; 3]>,
    near: Near,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Range {
    start: u32,
    end: u32,
}

const EMPTY: Range = Range { start: 0, end: 0 };

/// Points that a candidate may conflict with, relative to the lower corner of its cell. All numbers are whole; `f64`
/// holds them and the squares that matter (up to the squared spacing, 2^48) exactly, and compares two at a time.
#[derive(Debug, Default)]
struct Near {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

impl Near {
    fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
    }

    #[inline]
    fn push(&mut self, p: [f64; 3]) {
        self.x.push(p[0]);
        self.y.push(p[1]);
        self.z.push(p[2]);
    }

    /// True if a point is nearer to `p` than the square root of `min_squared`.
    #[inline]
    fn conflicts(&self, p: [f64; 3], min_squared: f64) -> bool {
        const LANES: usize = 4;
        let (x, x_rest) = self.x.as_chunks::<LANES>();
        let (y, y_rest) = self.y.as_chunks::<LANES>();
        let (z, z_rest) = self.z.as_chunks::<LANES>();
        let squared = |x: f64, y: f64, z: f64| {
            let (dx, dy, dz) = (x - p[0], y - p[1], z - p[2]);
            dx * dx + dy * dy + dz * dz
        };
        // Newest first: what was taken last is nearest in Morton order.
        if x_rest.iter().zip(y_rest).zip(z_rest).any(|((x, y), z)| squared(*x, *y, *z) < min_squared) {
            return true;
        }
        x.iter().zip(y).zip(z).rev().any(|((x, y), z)| {
            let mut hit = false;
            for i in 0..LANES {
                hit |= squared(x[i], y[i], z[i]) < min_squared;
            }
            hit
        })
    }
}

impl Default for Poisson {
    fn default() -> Self {
        let ranges = vec![EMPTY; 1 << (3 * GRID_BITS)];
        Self { ranges, touched: Vec::new(), taken: Vec::new(), near: Near::default() }
    }
}

impl Poisson {
    pub(super) fn choose(&mut self, level: u8, candidates: &[[u32; 3]], accepted: &mut [bool]) {
        let shift = cell_shift(level);
        let spacing = f64::from(1u32 << shift);
        let min_squared = spacing * spacing;
        let cell_bits = shift + 1;
        let mut at = 0;
        while at < candidates.len() {
            let cell = candidates[at].map(|t| t >> cell_bits);
            let corner = cell.map(|c| f64::from(c << cell_bits));
            let in_node = cell.map(|c| c & GRID_MAX);
            let start = self.taken.len() as u32;
            self.collect_near(in_node, corner, spacing);
            while let Some(t) = candidates.get(at).filter(|t| t.map(|t| t >> cell_bits) == cell) {
                let p = std::array::from_fn(|a| f64::from(t[a]) - corner[a]);
                if !self.near.conflicts(p, min_squared) {
                    accepted[at] = true;
                    self.near.push(p);
                    self.taken.push(*t);
                }
                at += 1;
            }
            let end = self.taken.len() as u32;
            if end > start {
                let code = interleave(in_node) as u32;
                self.ranges[code as usize] = Range { start, end };
                self.touched.push(code);
            }
        }
        for cell in self.touched.drain(..) {
            self.ranges[cell as usize] = EMPTY;
        }
        self.taken.clear();
    }

    /// Gathers the taken points of the cells around that lie closer than `spacing` to the cell's box.
    fn collect_near(&mut self, cell: [u32; 3], corner: [f64; 3], spacing: f64) {
        self.near.clear();
        let around = |c: u32| c.saturating_sub(1)..=(c + 1).min(GRID_MAX);
        for x in around(cell[0]) {
            let x = interleave([x, 0, 0]);
            for y in around(cell[1]) {
                let xy = x | interleave([0, y, 0]);
                for z in around(cell[2]) {
                    let range = self.ranges[(xy | interleave([0, 0, z])) as usize];
                    for t in &self.taken[range.start as usize..range.end as usize] {
                        let p: [f64; 3] = std::array::from_fn(|a| f64::from(t[a]) - corner[a]);
                        let is_near = |v: f64| v > -spacing && v < 3.0 * spacing;
                        if is_near(p[0]) && is_near(p[1]) && is_near(p[2]) {
                            self.near.push(p);
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn squared(a: [u32; 3], b: [u32; 3]) -> u64 {
        (0..3).map(|i| u64::from(a[i].abs_diff(b[i])).pow(2)).sum()
    }

    fn check(level: u8, mut candidates: Vec<[u32; 3]>) -> usize {
        let spacing = 1u64 << cell_shift(level);
        candidates.sort_unstable_by(|a, b| crate::morton::compare(*a, *b));
        let mut poisson = Poisson::default();
        let mut count = 0;
        for _ in 0..2 {
            let mut accepted = vec![false; candidates.len()];
            poisson.choose(level, &candidates, &mut accepted);
            let taken: Vec<_> = candidates.iter().zip(&accepted).filter(|(_, a)| **a).map(|(t, _)| *t).collect();
            for (i, a) in taken.iter().enumerate() {
                assert!(taken[..i].iter().all(|b| squared(*a, *b) >= spacing * spacing));
            }
            for c in &candidates {
                assert!(taken.iter().any(|t| squared(*c, *t) < (spacing * spacing).max(1)));
            }
            count = taken.len();
        }
        count
    }

    #[test]
    fn no_two_taken_are_closer_than_the_spacing_and_no_candidate_is_farther_from_all() {
        let mut state = 3u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 47) as u32
        };
        // One node of level 14, a slab of it, with repeated points; then a volume.
        let mut slab: Vec<[u32; 3]> = (0..6000).map(|_| [next(), next(), next() >> 9]).collect();
        slab.extend_from_within(0..500);
        let taken = check(14, slab);
        assert!(taken > 1000 && taken < 6000, "{taken}");
        let volume: Vec<[u32; 3]> = (0..4000).map(|_| [next() >> 3, next() >> 3, next() >> 3]).collect();
        let taken = check(14, volume);
        assert!(taken > 500 && taken < 4000, "{taken}");
    }

    #[test]
    fn the_whole_range_of_coordinates_is_exact_at_the_root() {
        let spacing = 1u32 << 24;
        let far = (1u32 << 31) - 1;
        // Two pairs whose distance is one unit short of, and exactly, the spacing.
        let candidates = vec![[0, 0, 0], [spacing - 1, 0, 0], [far, far, far - spacing], [far, far, far]];
        let mut accepted = [false; 4];
        Poisson::default().choose(0, &candidates, &mut accepted);
        assert_eq!(accepted, [true, false, true, true]);
    }

    #[test]
    fn below_the_resolution_only_repeated_places_conflict() {
        let candidates = [[5, 5, 5], [5, 5, 5], [5, 5, 6]];
        let mut accepted = [false; 3];
        Poisson::default().choose(30, &candidates, &mut accepted);
        assert_eq!(accepted, [true, false, true]);
    }
}
