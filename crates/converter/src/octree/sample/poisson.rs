//! A maximal Poisson-disk sample: no two points closer than the spacing, and every candidate closer than the spacing
//! to one that was taken. By greedy choice in a fixed order.
//!
//! Candidates come in Morton order, so those of a cube are one run, and so are the points taken from it. The node is
//! walked in *tiles* of four spacings. When a tile's run begins, the few taken points around it that can conflict
//! (closer than the spacing to the tile's box) are copied into a small array, found through *cells* of two spacings;
//! each candidate is then compared with that array alone, eight points at a time, and joins it if it is taken.
//!
//! Within a tile the candidates are visited in a scattered order. Any sweep (along the Morton curve, outwards from a
//! centre) packs each point against the ones before: nearest neighbours are then 1.04 to 1.08 spacings apart on a dense
//! plane. Scattered, they are 1.09 to 1.12 apart, with a sixth fewer points and no hole larger.
//!
//! Distances are compared in `f32`, in units of the spacing from the node's corner (0 to 128, so a coordinate is off by
//! 2^-18 at most): a pair conflicts below `1 + MARGIN`, which is more than all rounding together. So no pair is ever
//! closer than the spacing, exactly; and a candidate that was omitted lies within 1.00004 spacings of one that was not
//! (`CONFLICT_BELOW`, and the same rounding once more).

use super::spacing::{SPACING_BITS, cell_shift};
use crate::cloud::morton::interleave;
use crate::cloud::{TREE_BITS, TreePoint};

/// A cell is `2^CELL_BITS` spacings wide; a tile is two cells wide.
const CELL_BITS: u32 = 1;

/// A tile is `2^TILE_BITS` spacings wide.
pub(super) const TILE_BITS: u32 = CELL_BITS + 1;

const GRID_BITS: u32 = SPACING_BITS - CELL_BITS;
const GRID_SIZE: u32 = 1 << GRID_BITS;
const CELL_SPACINGS: f32 = (1 << CELL_BITS) as f32;

/// Squared distances (units of the squared spacing) below this conflict. Coordinates below 128 carry an error of 2^-18,
/// differences of 2^-17, squared distances near 1 of 2·√3·2^-17 + rounding < 2.8e-5.
const CONFLICT_BELOW: f32 = 1.0 + 4e-5;

const LANES: usize = 8;

/// More points of a node cannot be that far apart: spheres as dense as they can be packed, and some over the border.
const MOST_TAKEN: u64 = 3_200_000;

/// The grid, kept from node to node; all empty in between.
pub(super) struct Poisson {
    /// One bit for each cell from which a point was taken, a word for each column of cells: bit z of word (x, y).
    occupied: Vec<u64>,
    /// Range in `taken` of each occupied cell, by Morton code of the cell: neighbours in space are near in memory.
    ranges: Vec<Range>,
    /// In spacings from the corner of the node.
    taken: Vec<[f32; 3]>,
    near: Near,
}

#[derive(Debug, Clone, Copy, Default)]
struct Range {
    start: u32,
    end: u32,
}

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
        self.blocks.push(FAR);
        self.len = 0;
    }

    #[inline]
    fn push(&mut self, p: [f32; 3]) {
        self.push_if(true, p);
    }

    /// Adds the point, or nothing. Whether a candidate is taken cannot be predicted, so there is no branch: a point that
    /// is not taken is written as one infinitely far away, where the next will be written over it.
    #[inline]
    fn push_if(&mut self, taken: bool, p: [f32; 3]) {
        let p = if taken { p } else { [f32::INFINITY; 3] };
        let lane = self.len % LANES;
        if let Some(block) = self.blocks.last_mut() {
            block.x[lane] = p[0];
            block.y[lane] = p[1];
            block.z[lane] = p[2];
        }
        self.len += usize::from(taken);
        if self.len == self.blocks.len() * LANES {
            self.blocks.push(FAR);
        }
    }

    /// True if a point is too near to `p`.
    #[inline]
    fn conflicts(&self, p: [f32; 3]) -> bool {
        // Early exits are for crowds only: in the usual two blocks a branch would cost more than it saves.
        self.blocks.chunks(4).any(|blocks| {
            let mut hits = [0u32; LANES];
            for block in blocks {
                for (i, hit) in hits.iter_mut().enumerate() {
                    let (dx, dy, dz) = (block.x[i] - p[0], block.y[i] - p[1], block.z[i] - p[2]);
                    *hit |= u32::from(dx * dx + dy * dy + dz * dz < CONFLICT_BELOW);
                }
            }
            hits.iter().fold(0, |any, hit| any | hit) != 0
        })
    }
}

/// The numbers below `n`, each once, every one far from those before: multiples of the golden ratio modulo a power of
/// two (an odd factor reaches every residue).
#[inline]
fn scattered(n: usize) -> impl Iterator<Item = usize> {
    let size = n.next_power_of_two();
    let step = ((size as u64 * 0x9e37_79b9) >> 32) as usize | 1;
    (0..size).map(move |i| i.wrapping_mul(step) & (size - 1)).filter(move |i| *i < n)
}

impl Default for Poisson {
    fn default() -> Self {
        let occupied = vec![0; (GRID_SIZE * GRID_SIZE) as usize];
        let ranges = vec![Range::default(); 1 << (3 * GRID_BITS)];
        Self { occupied, ranges, taken: Vec::new(), near: Near::default() }
    }
}

impl Poisson {
    /// Forgets what was taken for the last node.
    pub(super) fn begin(&mut self) {
        self.occupied.fill(0);
        self.taken.clear();
    }

    /// Makes room for what a node may take of so many candidates, so that the list never moves: what is not touched costs
    /// no memory.
    pub(super) fn expect(&mut self, candidates: u64) {
        self.taken.reserve_exact(candidates.min(MOST_TAKEN) as usize);
    }

    /// Memory of the points taken so far, bytes.
    pub(super) fn bytes(&self) -> u64 {
        (self.taken.len() * size_of::<[f32; 3]>()) as u64
    }

    /// Chooses among the next candidates of a node; a part ends where a tile ends.
    pub(super) fn choose(&mut self, level: u8, candidates: &[TreePoint], accepted: &mut [bool]) {
        let Some(first) = candidates.first() else { return };
        if u32::from(level) > TREE_BITS - SPACING_BITS {
            // The spacing is less than one unit: only repeated places conflict, and they are neighbours in Morton order.
            for (i, accepted) in accepted.iter_mut().enumerate() {
                *accepted = i == 0 || candidates[i] != candidates[i - 1];
            }
            return;
        }
        let shift = cell_shift(level);
        let cell_shift = shift + CELL_BITS;
        let tile_shift = shift + TILE_BITS;
        let node_bits = TREE_BITS - u32::from(level).min(TREE_BITS);
        let corner = first.cell(node_bits).map(|c| c << node_bits);
        // A power of two, so nothing is lost by it.
        let unit = 1.0 / (1u32 << shift) as f32;
        let mut at = 0;
        while let Some(&first) = candidates.get(at) {
            self.collect_near(first.cell(tile_shift).map(|c| c << 1 & (GRID_SIZE - 1)));
            let tile = first.cell(tile_shift);
            let run = candidates[at..].iter().take_while(|t| t.cell(tile_shift) == tile).count();
            let place = |t: TreePoint| -> [f32; 3] { std::array::from_fn(|a| (t[a] - corner[a]) as i32 as f32 * unit) };
            let (candidates, accepted) = (&candidates[at..at + run], &mut accepted[at..at + run]);
            at += run;
            for i in scattered(run) {
                let p = place(candidates[i]);
                let taken = !self.near.conflicts(p);
                accepted[i] = taken;
                self.near.push_if(taken, p);
            }
            self.note_taken(candidates, accepted, cell_shift, place);
        }
    }

    /// Notes which points were taken from a tile, cell by cell.
    #[inline]
    fn note_taken(
        &mut self,
        candidates: &[TreePoint],
        accepted: &[bool],
        cell_shift: u32,
        place: impl Fn(TreePoint) -> [f32; 3],
    ) {
        let mut open: Option<([u32; 3], u32)> = None;
        for (t, _) in candidates.iter().zip(accepted).filter(|(_, taken)| **taken) {
            let cell = t.cell(cell_shift);
            match open {
                Some((c, _)) if c == cell => {}
                _ => {
                    self.close_cell(open);
                    open = Some((cell, self.taken.len() as u32));
                }
            }
            self.taken.push(place(*t));
        }
        self.close_cell(open);
    }

    #[inline]
    fn close_cell(&mut self, open: Option<([u32; 3], u32)>) {
        let Some((cell, start)) = open else { return };
        let cell = cell.map(|c| c & (GRID_SIZE - 1));
        self.ranges[interleave(cell) as usize] = Range { start, end: self.taken.len() as u32 };
        self.occupied[column(cell[0], cell[1])] |= 1 << cell[2];
    }

    /// Gathers the taken points that lie closer than the spacing to a tile; `cell` is the tile's lowest cell.
    fn collect_near(&mut self, cell: [u32; 3]) {
        self.near.clear();
        // Rounding moves a coordinate by less than a ten-thousandth of a spacing.
        let low: [f32; 3] = cell.map(|c| c as f32 * CELL_SPACINGS - 1.0001);
        let high: [f32; 3] = cell.map(|c| (c + 2) as f32 * CELL_SPACINGS + 1.0001);
        // From the cell before the tile to the one behind it: four an axis. The tile's own are not occupied yet.
        let around = |c: u32| c.saturating_sub(1)..(c + 3).min(GRID_SIZE);
        let four = ((0b1111u128 << cell[2]) >> 1) as u64;
        for x in around(cell[0]) {
            for y in around(cell[1]) {
                let mut cells = self.occupied[column(x, y)] & four;
                while cells != 0 {
                    let z = cells.trailing_zeros();
                    cells &= cells - 1;
                    let range = self.ranges[interleave([x, y, z]) as usize];
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

/// Word of `occupied` for a column of cells.
#[inline]
fn column(x: u32, y: u32) -> usize {
    (x << GRID_BITS | y) as usize
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn squared(a: [u32; 3], b: [u32; 3]) -> u64 {
        (0..3).map(|i| u64::from(a[i].abs_diff(b[i])).pow(2)).sum()
    }

    fn check(level: u8, mut candidates: Vec<[u32; 3]>) -> usize {
        let spacing = 1u64 << cell_shift(level);
        candidates.sort_unstable_by(|a, b| crate::cloud::morton::compare(*a, *b));
        let points: Vec<TreePoint> = candidates.iter().copied().map(TreePoint).collect();
        let mut poisson = Poisson::default();
        let mut count = 0;
        for _ in 0..2 {
            let mut accepted = vec![false; candidates.len()];
            poisson.begin();
            poisson.choose(level, &points, &mut accepted);
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
        let mut random = Random::new(3);
        let mut next = || random.below(1 << 17) as u32;
        // One node of level 14, a slab of it, with repeated points; then a volume.
        let mut slab: Vec<[u32; 3]> = (0..6000).map(|_| [next(), next(), next() >> 9]).collect();
        slab.extend_from_within(0..500);
        let taken = check(14, slab);
        assert!(taken > 1000 && taken < 6000, "{taken}");
        // Layers at the lower and upper end of each axis, where there are no cells beyond.
        for axis in 0..3 {
            for end in [0, (1 << 17) - 1500] {
                let mut layer: Vec<[u32; 3]> = (0..6000).map(|_| [next(), next(), next()]).collect();
                layer.iter_mut().for_each(|t| t[axis] = end + t[axis] % 1500);
                let taken = check(14, layer);
                assert!(taken > 1000 && taken < 6000, "{taken}");
            }
        }
        let volume: Vec<[u32; 3]> = (0..4000).map(|_| [next() >> 3, next() >> 3, next() >> 3]).collect();
        let taken = check(14, volume);
        assert!(taken > 500 && taken < 4000, "{taken}");
    }

    #[test]
    fn the_whole_range_of_coordinates_is_safe_at_the_root() {
        let spacing = 1u32 << 24;
        let far = (1u32 << 31) - 1;
        // Two pairs whose distance is one unit short of, and a little above, the spacing.
        let candidates = [[0, 0, 0], [spacing - 1, 0, 0], [far, far, far - spacing - 1000], [far, far, far]];
        let mut accepted = [false; 4];
        Poisson::default().choose(0, &candidates.map(TreePoint), &mut accepted);
        assert_eq!(accepted, [true, false, true, true]);
    }

    #[test]
    fn scattered_visits_each_once() {
        for n in [0, 1, 2, 3, 7, 8, 100, 1000] {
            let mut seen: Vec<usize> = scattered(n).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..n).collect::<Vec<_>>());
        }
    }

    #[test]
    fn below_the_resolution_only_repeated_places_conflict() {
        let candidates = [[5, 5, 5], [5, 5, 5], [5, 5, 6]];
        let mut accepted = [false; 3];
        Poisson::default().choose(30, &candidates.map(TreePoint), &mut accepted);
        assert_eq!(accepted, [true, false, true]);
    }
}
