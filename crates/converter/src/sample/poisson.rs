//! A maximal Poisson-disk sample: no two points closer than the spacing, and every candidate closer than the spacing
//! to one that was taken. By greedy choice in Morton order.
//!
//! Candidates come in Morton order, so those of a cube are one run, and so are the points taken from it. The node is
//! walked in *tiles* of four spacings. When a tile's run begins, the few taken points around it that can conflict
//! (closer than the spacing to the tile's box) are copied into a small array, found through *cells* of two spacings;
//! each candidate is then compared with that array alone, eight points at a time, and joins it if it is taken.
//!
//! Distances are compared in `f32`, in units of the spacing from the node's corner (0 to 128, so a coordinate is off by
//! 2^-18 at most): a pair conflicts below `1 + MARGIN`, which is more than all rounding together. So no pair is ever
//! closer than the spacing, exactly; and a candidate that was left out lies within 1.00002 spacings of one that was not.

use super::{SPACING_BITS, cell_shift};
use crate::grid::TREE_BITS;
use crate::morton::interleave;

/// A cell is `2^CELL_BITS` spacings wide; a tile is two cells wide.
const CELL_BITS: u32 = 1;
const GRID_BITS: u32 = SPACING_BITS - CELL_BITS;
const GRID_SIZE: u32 = 1 << GRID_BITS;
const CELL_SPACINGS: f32 = (1 << CELL_BITS) as f32;

/// Squared distances (units of the squared spacing) below this conflict. Coordinates below 128 carry an error of 2^-18,
/// differences of 2^-17, squared distances near 1 of 2·√3·2^-17 + rounding < 2.8e-5.
const CONFLICT_BELOW: f32 = 1.0 + 4e-5;

const LANES: usize = 8;

/// The grid, kept from node to node; all empty in between.
pub(super) struct Poisson {
    /// Range in `taken` of each cell, by Morton code of the cell: neighbours in space are near in memory.
    ranges: Vec<Range>,
    touched: Vec<u32>,
    /// In spacings from the corner of the node.
    taken: Vec<[f32; 3]>,
    near: Near,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Range {
    start: u32,
    end: u32,
}

const EMPTY: Range = Range { start: 0, end: 0 };

/// Points that a candidate may conflict with, eight to a block; unused lanes are infinitely far away.
#[derive(Debug, Default)]
struct Near {
    blocks: Vec<Block>,
    len: usize,
}

#[derive(Debug, Clone, Copy)]
struct Block {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
}

const FAR: Block = Block { x: [f32::INFINITY; LANES], y: [f32::INFINITY; LANES], z: [f32::INFINITY; LANES] };

impl Near {
    fn clear(&mut self) {
        self.blocks.clear();
        self.len = 0;
    }

    #[inline]
    fn push(&mut self, p: [f32; 3]) {
        let lane = self.len % LANES;
        if lane == 0 {
            self.blocks.push(FAR);
        }
        if let Some(block) = self.blocks.last_mut() {
            block.x[lane] = p[0];
            block.y[lane] = p[1];
            block.z[lane] = p[2];
        }
        self.len += 1;
    }

    /// True if a point is too near to `p`. Newest first: what was taken last is nearest in Morton order.
    #[inline]
    fn conflicts(&self, p: [f32; 3]) -> bool {
        self.blocks.iter().rev().any(|block| {
            let mut hits = [false; LANES];
            for (i, hit) in hits.iter_mut().enumerate() {
                let (dx, dy, dz) = (block.x[i] - p[0], block.y[i] - p[1], block.z[i] - p[2]);
                *hit = dx * dx + dy * dy + dz * dz < CONFLICT_BELOW;
            }
            hits.iter().fold(false, |any, hit| any | hit)
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
        let Some(first) = candidates.first() else { return };
        let shift = cell_shift(level);
        let cell_shift = shift + CELL_BITS;
        let tile_shift = cell_shift + 1;
        let node_bits = TREE_BITS - u32::from(level).min(TREE_BITS);
        let corner = first.map(|t| t >> node_bits << node_bits);
        // A power of two, so nothing is lost by it.
        let unit = 1.0 / (1u32 << shift) as f32;
        let mut at = 0;
        while let Some(&first) = candidates.get(at) {
            self.collect_near(first.map(|t| t >> tile_shift << 1 & (GRID_SIZE - 1)));
            let mut cell_start = self.taken.len() as u32;
            let mut previous = first;
            while let Some(&t) = candidates.get(at) {
                let change = (t[0] ^ previous[0]) | (t[1] ^ previous[1]) | (t[2] ^ previous[2]);
                if change >> cell_shift != 0 {
                    cell_start = self.close_cell(previous.map(|t| t >> cell_shift), cell_start);
                    if change >> tile_shift != 0 {
                        break;
                    }
                }
                previous = t;
                let p: [f32; 3] = std::array::from_fn(|a| (t[a] - corner[a]) as i32 as f32 * unit);
                if !self.near.conflicts(p) {
                    accepted[at] = true;
                    self.near.push(p);
                    self.taken.push(p);
                }
                at += 1;
            }
            self.close_cell(previous.map(|t| t >> cell_shift), cell_start);
        }
        for cell in self.touched.drain(..) {
            self.ranges[cell as usize] = EMPTY;
        }
        self.taken.clear();
    }

    /// Notes which points were taken from a cell whose run has ended.
    #[inline]
    fn close_cell(&mut self, cell: [u32; 3], start: u32) -> u32 {
        let end = self.taken.len() as u32;
        if end > start {
            let code = interleave(cell.map(|c| c & (GRID_SIZE - 1))) as u32;
            self.ranges[code as usize] = Range { start, end };
            self.touched.push(code);
        }
        end
    }

    /// Gathers the taken points that lie closer than the spacing to a tile; `cell` is the tile's lowest cell.
    fn collect_near(&mut self, cell: [u32; 3]) {
        self.near.clear();
        // Rounding moves a coordinate by less than a ten-thousandth of a spacing.
        let low: [f32; 3] = cell.map(|c| c as f32 * CELL_SPACINGS - 1.0001);
        let high: [f32; 3] = cell.map(|c| (c + 2) as f32 * CELL_SPACINGS + 1.0001);
        // The cells around the tile: four an axis, of which the middle two are the tile's own.
        let along = |c: u32, axis: usize| -> [Option<u64>; 4] {
            std::array::from_fn(|i| {
                let mut v = [0; 3];
                v[axis] = (c + i as u32).checked_sub(1).filter(|v| *v < GRID_SIZE)?;
                Some(interleave(v))
            })
        };
        let (xs, ys, zs) = (along(cell[0], 0), along(cell[1], 1), along(cell[2], 2));
        let is_own = |i: usize| i == 1 || i == 2;
        for (i, x) in xs.into_iter().enumerate() {
            let Some(x) = x else { continue };
            for (j, y) in ys.into_iter().enumerate() {
                let Some(y) = y else { continue };
                let step = if is_own(i) && is_own(j) { 3 } else { 1 };
                for z in zs.iter().step_by(step).flatten() {
                    let range = self.ranges[(x | y | z) as usize];
                    if range == EMPTY {
                        continue;
                    }
                    for p in &self.taken[range.start as usize..range.end as usize] {
                        let inside = (p[0] > low[0])
                            & (p[0] < high[0])
                            & (p[1] > low[1])
                            & (p[1] < high[1])
                            & (p[2] > low[2])
                            & (p[2] < high[2]);
                        if inside {
                            self.near.push(*p);
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
            let near = (spacing as f64 * 1.00003).powi(2).max(1.0);
            for c in &candidates {
                assert!(taken.iter().any(|t| (squared(*c, *t) as f64) < near));
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
    fn the_whole_range_of_coordinates_is_safe_at_the_root() {
        let spacing = 1u32 << 24;
        let far = (1u32 << 31) - 1;
        // Two pairs whose distance is one unit short of, and a little above, the spacing.
        let candidates = vec![[0, 0, 0], [spacing - 1, 0, 0], [far, far, far - spacing - 1000], [far, far, far]];
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
