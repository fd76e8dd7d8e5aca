//! The greedy choice among the candidates of one tile.

use std::ops::Range;

use crate::cloud::TreePoint;
use crate::runtime::{Compare, LANES};

/// Candidates that are decided together: a bit of a word each.
const BLOCK: usize = 64;

/// Candidates of a tile, in the order in which they are visited, and the taken points that they may conflict with.
///
/// The taken points are few: each strikes out all candidates near to it, eight at a time; the next that is left is
/// taken, and strikes out in turn. So the only branches are one for each point that is taken, and no candidate waits
/// for the one before.
pub(super) struct Tile {
    /// The lower corner, in tree coordinates.
    corner: [u32; 3],
    /// The width of a tree coordinate in units: a power of two, so nothing is lost by it.
    unit: f32,
    conflict_below: f32,
    /// Taken points, in units from the corner; the first `near_count` count.
    near: Vec<[f32; 3]>,
    near_count: usize,
    block: Box<Block>,
    /// `orders[n][..n]`: the order in which `n` candidates are visited.
    orders: Box<[[u8; BLOCK]]>,
}

/// Up to [`BLOCK`] candidates, in units from the corner of the tile.
#[derive(Debug, Clone)]
#[repr(align(32))]
struct Block {
    axes: [[f32; BLOCK]; 3],
    /// The same in tree coordinates.
    raw: [[i32; BLOCK]; 3],
    /// Their indices in the run.
    rows: [u32; BLOCK],
}

/// The numbers below `n`, each once, every one far from those before: multiples of the golden ratio modulo a power of
/// two (an odd factor reaches every residue).
#[derive(Debug, Clone, Copy)]
struct Scattered {
    n: u32,
    size: u32,
    step: u32,
    at: u32,
}

impl Scattered {
    #[inline(always)]
    fn new(n: usize) -> Self {
        let size = n.next_power_of_two() as u64;
        let step = (size * 0x9e37_79b9) >> 32 | 1;
        Self { n: n as u32, size: size as u32, step: step as u32, at: 0 }
    }

    /// Writes the next numbers; returns how many, 0 once none are left.
    #[inline(always)]
    fn fill(&mut self, out: &mut [u32; BLOCK]) -> usize {
        let mut count = 0;
        while self.at < self.size && count < BLOCK {
            let i = self.at.wrapping_mul(self.step) & (self.size - 1);
            // no branch: what is too large is written over
            out[count] = i;
            count += usize::from(i < self.n);
            self.at += 1;
        }
        count
    }
}

impl Tile {
    pub(super) fn new() -> Self {
        let mut orders = vec![[0; BLOCK]; BLOCK + 1];
        for (n, order) in orders.iter_mut().enumerate() {
            let mut rows = [0; BLOCK];
            Scattered::new(n).fill(&mut rows);
            order.iter_mut().zip(rows).for_each(|(to, i)| *to = i as u8);
        }
        Self {
            corner: [0; 3],
            unit: 0.0,
            conflict_below: 0.0,
            near: Vec::new(),
            near_count: 0,
            block: Box::new(Block { axes: [[0.0; BLOCK]; 3], raw: [[0; BLOCK]; 3], rows: [0; BLOCK] }),
            orders: orders.into_boxed_slice(),
        }
    }

    /// Begins with the tile number `tile` on each axis; nothing is near.
    #[inline(always)]
    pub(super) fn begin(&mut self, tile: [u32; 3], unit_bits: u32, conflict_below: f32) {
        self.corner = tile.map(|c| c << (unit_bits + super::neighbours::TILE_BITS));
        self.unit = 1.0 / (1u32 << unit_bits) as f32;
        self.conflict_below = conflict_below;
        self.near_count = 0;
    }

    /// Makes room for so many more points around the tile.
    #[inline(always)]
    pub(super) fn reserve_near(&mut self, more: usize) {
        if self.near.len() < self.near_count + more {
            self.near.resize(2 * (self.near_count + more), [0.0; 3]);
        }
    }

    /// Adds a taken point around the tile if `is_near`: without a branch, since nobody can predict it. There must be
    /// room.
    #[inline(always)]
    pub(super) fn push_near_if(&mut self, is_near: bool, point: TreePoint) {
        if let Some(slot) = self.near.get_mut(self.near_count) {
            *slot = std::array::from_fn(|a| point[a].wrapping_sub(self.corner[a]) as i32 as f32 * self.unit);
            self.near_count += usize::from(is_near);
        }
    }

    /// Adds a taken point around the tile.
    #[inline(always)]
    pub(super) fn push_near(&mut self, point: TreePoint) {
        self.reserve_near(1);
        self.push_near_if(true, point);
    }

    /// Decides which candidates of the tile, one run in Morton order, are taken.
    #[inline(always)]
    pub(super) fn choose<C: Compare>(&mut self, compare: C, candidates: &[TreePoint], accepted: &mut [bool]) {
        let n = candidates.len();
        if n <= BLOCK {
            self.block.rows.iter_mut().zip(&self.orders[n]).for_each(|(row, i)| *row = u32::from(*i));
            self.choose_block(compare, n, candidates, accepted);
            return;
        }
        let mut order = Scattered::new(n);
        loop {
            let count = order.fill(&mut self.block.rows);
            if count == 0 {
                break;
            }
            self.reserve_near(count);
            self.choose_block(compare, count, candidates, accepted);
        }
    }

    /// Decides about the first `count` candidates of the block. Those that are taken are near from then on, if there is
    /// room for them.
    #[inline(always)]
    fn choose_block<C: Compare>(&mut self, compare: C, count: usize, candidates: &[TreePoint], accepted: &mut [bool]) {
        let Self { corner, unit, conflict_below, near, near_count, block, .. } = self;
        block.load(count, *corner, *unit, candidates);
        let vectors = count.div_ceil(LANES);
        let mut left = u64::MAX >> (BLOCK - count);
        for point in &near[..*near_count] {
            left &= !block.conflicts(compare, 0..vectors, *point, *conflict_below);
            if left == 0 {
                return;
            }
        }
        while left != 0 {
            let first = left.trailing_zeros() as usize;
            let point = block.point(first);
            accepted[block.rows[first] as usize] = true;
            if let Some(slot) = near.get_mut(*near_count) {
                *slot = point;
                *near_count += 1;
            }
            left &= left - 1;
            left &= !block.conflicts(compare, first / LANES..vectors, point, *conflict_below);
        }
    }
}

impl Block {
    #[inline(always)]
    fn load(&mut self, count: usize, corner: [u32; 3], unit: f32, candidates: &[TreePoint]) {
        let Self { axes, raw, rows } = self;
        for (lane, row) in rows[..count].iter().enumerate() {
            let t = candidates[*row as usize];
            for a in 0..3 {
                raw[a][lane] = t[a].wrapping_sub(corner[a]) as i32;
            }
        }
        let vectors = count.div_ceil(LANES);
        for (axis, raw) in axes.iter_mut().zip(raw) {
            let lanes = axis.as_chunks_mut::<LANES>().0.iter_mut().zip(raw.as_chunks::<LANES>().0);
            for (lanes, raw) in lanes.take(vectors) {
                for i in 0..LANES {
                    lanes[i] = raw[i] as f32 * unit;
                }
            }
        }
    }

    #[inline(always)]
    fn point(&self, lane: usize) -> [f32; 3] {
        std::array::from_fn(|a| self.axes[a][lane % BLOCK])
    }

    /// A bit for each candidate of some vectors of lanes that is too near to `point`.
    #[inline(always)]
    fn conflicts(&self, compare: impl Compare, vectors: Range<usize>, point: [f32; 3], below: f32) -> u64 {
        let [x, y, z] = [0, 1, 2].map(|a| self.axes[a].as_chunks::<LANES>().0);
        let mut bits = 0;
        for v in vectors {
            bits |= u64::from(compare.nearer([&x[v], &y[v], &z[v]], point, below)) << (v * LANES);
        }
        bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scattered_visits_each_once() {
        for n in [0, 1, 2, 3, 7, 8, 63, 64, 65, 100, 1000] {
            let (mut order, mut rows, mut seen) = (Scattered::new(n), [0; BLOCK], Vec::new());
            loop {
                match order.fill(&mut rows) {
                    0 => break,
                    count => seen.extend_from_slice(&rows[..count]),
                }
            }
            seen.sort_unstable();
            assert_eq!(seen, (0..n as u32).collect::<Vec<_>>());
        }
    }
}
