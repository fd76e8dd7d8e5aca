//! A maximal Poisson-disk sample: no two points closer than the spacing, and every candidate closer than the spacing
//! to one that was taken. By greedy choice in a fixed order.
//!
//! Candidates come in Morton order, so those of a cube are one run, and so are the points taken from it. The node is
//! walked in *tiles* of four units, each a spacing or a little more. When a tile's run begins, the few taken points around it that can conflict
//! (closer than the spacing to the tile's box) are copied into a small array, found through *cells* of two units;
//! each candidate is then compared with that array alone, eight points at a time, and joins it if it is taken.
//!
//! Within a tile the candidates are visited in a scattered order. Any sweep (along the Morton curve, outwards from a
//! centre) packs each point against the ones before: nearest neighbours are then 1.04 to 1.08 spacings apart on a dense
//! plane. Scattered, they are 1.09 to 1.12 apart, with a sixth fewer points and no hole larger.
//!
//! Distances are compared in `f32`, in units from the corner of the tile (-1 to 5, so a coordinate is off by 2^-22 at
//! most): a pair conflicts below the spacing plus a margin, which is more than all rounding together. So no pair is ever
//! closer than the spacing, exactly; and a candidate that was omitted lies within 1.00002 spacings of one that was not
//! (`MARGIN`, and the same rounding once more).
//!
//! What neighbours have taken over the border of the node ([`OverBorder`]) is among the points around a tile, and is kept
//! at the same distance.

use super::neighbours::{OverBorder, TILE_BITS, tile_code};
use super::spacing::Spacing;
use crate::cloud::TreePoint;
use crate::cloud::morton::interleave;

/// A cell is `2^CELL_BITS` units wide; a tile is two cells wide.
const CELL_BITS: u32 = TILE_BITS - 1;

/// Added to the squared spacing (at least a quarter of a squared unit): coordinates carry an error of 2^-22, differences
/// of 2^-21, squared distances near 1 of 2·√3·2^-21 + rounding < 1.9e-6.
const MARGIN: f32 = 3e-6;

const LANES: usize = 8;

/// The grid, kept from node to node; all empty in between.
pub(super) struct Poisson {
    /// Squared distances (in squared units) below this conflict.
    conflict_below: f32,
    /// Of the spacing, in units; at most 1.
    reach: f64,
    /// More points of a node cannot be that far apart: spheres as dense as they can be packed, and some over the border.
    most_taken: u64,
    /// A node has `2^grid_bits` cells along each axis.
    grid_bits: u32,
    /// One bit for each cell from which a point was taken, a word for each column of cells: bit z of word (x, y).
    occupied: Vec<u64>,
    /// Range in `taken` of each occupied cell, by Morton code of the cell: neighbours in space are near in memory.
    ranges: Vec<Range>,
    taken: Vec<TreePoint>,
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
    fn conflicts(&self, p: [f32; 3], below: f32) -> bool {
        // Early exits are for crowds only: in the usual two blocks a branch would cost more than it saves.
        self.blocks.chunks(4).any(|blocks| {
            let mut hits = [0u32; LANES];
            for block in blocks {
                for (i, hit) in hits.iter_mut().enumerate() {
                    let (dx, dy, dz) = (block.x[i] - p[0], block.y[i] - p[1], block.z[i] - p[2]);
                    *hit |= u32::from(dx * dx + dy * dy + dz * dz < below);
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

impl Poisson {
    pub(super) fn new(spacing: Spacing) -> Self {
        let grid_bits = spacing.bits() - CELL_BITS;
        let reach = spacing.in_units();
        Self {
            conflict_below: (reach * reach) as f32 + MARGIN,
            reach,
            most_taken: (2f64.sqrt() * (spacing.divisor() + 2.0).powi(3)) as u64,
            grid_bits,
            occupied: vec![0; 1 << (2 * grid_bits)],
            ranges: vec![Range::default(); 1 << (3 * grid_bits)],
            taken: Vec::new(),
            near: Near::default(),
        }
    }

    /// Forgets what was taken for the last node.
    pub(super) fn begin(&mut self) {
        self.occupied.fill(0);
        self.taken.clear();
    }

    /// Memory that the points taken of so many candidates need at most, bytes.
    pub(super) fn expected_bytes(&self, candidates: u64) -> u64 {
        candidates.min(self.most_taken) * size_of::<TreePoint>() as u64
    }

    /// Makes room for what a node may take of so many candidates, so that the list never moves: what is not touched costs
    /// no memory.
    pub(super) fn expect(&mut self, candidates: u64) {
        self.taken.reserve_exact(candidates.min(self.most_taken) as usize);
    }

    /// Memory of the points taken so far, bytes.
    pub(super) fn bytes(&self) -> u64 {
        (self.taken.len() * size_of::<TreePoint>()) as u64
    }

    /// Gives back the memory of the points taken.
    pub(super) fn release(&mut self) {
        self.taken = Vec::new();
    }

    /// Chooses among the next candidates of a node; a part ends where a tile ends.
    pub(super) fn choose(
        &mut self,
        unit_bits: u32,
        corner: TreePoint,
        candidates: &[TreePoint],
        over_border: &mut OverBorder,
        accepted: &mut [bool],
    ) {
        let tile_shift = unit_bits + TILE_BITS;
        // A power of two, so nothing is lost by it.
        let unit = 1.0 / (1u32 << unit_bits) as f32;
        let below = self.conflict_below;
        let mut at = 0;
        while let Some(&first) = candidates.get(at) {
            let tile = first.cell(tile_shift);
            let run = candidates[at..].iter().take_while(|t| t.cell(tile_shift) == tile).count();
            let place = |t: TreePoint| -> [f32; 3] {
                std::array::from_fn(|a| t[a].wrapping_sub(tile[a] << tile_shift) as i32 as f32 * unit)
            };
            self.collect_near(tile, unit_bits, place);
            for (_, p) in over_border.of_tile(tile_code(first, corner, tile_shift)) {
                self.near.push(place(*p));
            }
            let (candidates, accepted) = (&candidates[at..at + run], &mut accepted[at..at + run]);
            at += run;
            for i in scattered(run) {
                let p = place(candidates[i]);
                let taken = !self.near.conflicts(p, below);
                accepted[i] = taken;
                self.near.push_if(taken, p);
            }
            self.note_taken(candidates, accepted, unit_bits + CELL_BITS);
        }
    }

    /// Notes which points were taken from a tile, cell by cell.
    #[inline]
    fn note_taken(&mut self, candidates: &[TreePoint], accepted: &[bool], cell_shift: u32) {
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
            self.taken.push(*t);
        }
        self.close_cell(open);
    }

    #[inline]
    fn close_cell(&mut self, open: Option<([u32; 3], u32)>) {
        let Some((cell, start)) = open else { return };
        let cell = cell.map(|c| c & self.last_cell());
        self.ranges[interleave(cell) as usize] = Range { start, end: self.taken.len() as u32 };
        let column = self.column(cell[0], cell[1]);
        self.occupied[column] |= 1 << cell[2];
    }

    /// Gathers the taken points of the node that lie closer than the spacing to a tile.
    fn collect_near(&mut self, tile: [u32; 3], unit_bits: u32, place: impl Fn(TreePoint) -> [f32; 3]) {
        self.near.clear();
        let reach = (self.reach * f64::from(1u32 << unit_bits)).ceil() as u32;
        // modulo 2^32: a tile and its surroundings are less than that
        let low = tile.map(|c| (c << (unit_bits + TILE_BITS)).wrapping_sub(reach));
        let width = (1u32 << (unit_bits + TILE_BITS)) + 2 * reach;
        let cell = tile.map(|c| c << 1 & self.last_cell());
        // From the cell before the tile to the one behind it: four an axis. The tile's own are not occupied yet.
        let around = |c: u32| c.saturating_sub(1)..(c + 3).min(1 << self.grid_bits);
        let four = ((0b1111u128 << cell[2]) >> 1) as u64;
        for x in around(cell[0]) {
            for y in around(cell[1]) {
                let mut cells = self.occupied[self.column(x, y)] & four;
                while cells != 0 {
                    let z = cells.trailing_zeros();
                    cells &= cells - 1;
                    let range = self.ranges[interleave([x, y, z]) as usize];
                    for p in &self.taken[range.start as usize..range.end as usize] {
                        if (0..3).all(|a| p[a].wrapping_sub(low[a]) <= width) {
                            self.near.push(place(*p));
                        }
                    }
                }
            }
        }
    }

    /// Word of `occupied` for a column of cells.
    #[inline]
    fn column(&self, x: u32, y: u32) -> usize {
        (x << self.grid_bits | y) as usize
    }

    #[inline]
    fn last_cell(&self) -> u32 {
        (1 << self.grid_bits) - 1
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn squared(a: [u32; 3], b: [u32; 3]) -> u64 {
        (0..3).map(|i| u64::from(a[i].abs_diff(b[i])).pow(2)).sum()
    }

    fn check(divisor: f64, level: u8, mut candidates: Vec<[u32; 3]>) -> usize {
        let spacing = Spacing::new(divisor);
        let unit_bits = spacing.unit_bits(level).unwrap();
        let squared_spacing = spacing.squared(level);
        candidates.sort_unstable_by(|a, b| crate::cloud::morton::compare(*a, *b));
        let points: Vec<TreePoint> = candidates.iter().copied().map(TreePoint).collect();
        let mut poisson = Poisson::new(spacing);
        let mut count = 0;
        for _ in 0..2 {
            let mut accepted = vec![false; candidates.len()];
            poisson.begin();
            poisson.choose(unit_bits, TreePoint([0; 3]), &points, &mut OverBorder::default(), &mut accepted);
            let taken: Vec<_> = candidates.iter().zip(&accepted).filter(|(_, a)| **a).map(|(t, _)| *t).collect();
            for (i, a) in taken.iter().enumerate() {
                assert!(taken[..i].iter().all(|b| squared(*a, *b) as f64 >= squared_spacing));
            }
            let near = (squared_spacing * 1.00002f64.powi(2)).max(1.0);
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
        let taken = check(128.0, 14, slab);
        assert!(taken > 1000 && taken < 6000, "{taken}");
        // Layers at the lower and upper end of each axis, where there are no cells beyond.
        for axis in 0..3 {
            for end in [0, (1 << 17) - 1500] {
                let mut layer: Vec<[u32; 3]> = (0..6000).map(|_| [next(), next(), next()]).collect();
                layer.iter_mut().for_each(|t| t[axis] = end + t[axis] % 1500);
                let taken = check(128.0, 14, layer);
                assert!(taken > 1000 && taken < 6000, "{taken}");
            }
        }
        let volume: Vec<[u32; 3]> = (0..4000).map(|_| [next() >> 3, next() >> 3, next() >> 3]).collect();
        let taken = check(128.0, 14, volume);
        assert!(taken > 500 && taken < 4000, "{taken}");
        for divisor in [40.0, 100.0, 181.0, 255.0] {
            let slab: Vec<[u32; 3]> = (0..6000).map(|_| [next(), next(), next() >> 9]).collect();
            let taken = check(divisor, 14, slab);
            assert!(taken > 100 && taken < 6000, "{taken}");
        }
    }

    #[test]
    fn the_whole_range_of_coordinates_is_safe_at_the_root() {
        let spacing = 1u32 << 24;
        let far = (1u32 << 31) - 1;
        // Two pairs whose distance is one unit short of, and a little above, the spacing.
        let candidates = [[0, 0, 0], [spacing - 1, 0, 0], [far, far, far - spacing - 100], [far, far, far]];
        let mut accepted = [false; 4];
        let mut poisson = Poisson::new(Spacing::default());
        let corner = TreePoint([0; 3]);
        poisson.choose(24, corner, &candidates.map(TreePoint), &mut OverBorder::default(), &mut accepted);
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
}
