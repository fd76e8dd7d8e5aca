//! A maximal Poisson-disk sample: no two points closer than the spacing, and every candidate closer than the spacing
//! to one that was taken. By greedy choice in a fixed order.
//!
//! Candidates come in Morton order, so those of a cube are one run, and so are the points taken from it. The node is
//! walked in *tiles* of four units, each a spacing or a little more. When a tile's run begins, the few points around it
//! that can conflict (closer than the spacing to the tile's box) are found by [`Taken`]; then [`Tile`] chooses among
//! the candidates of the run.
//!
//! Within a tile the candidates are visited in a scattered order. Any sweep (along the Morton curve, outwards from a
//! centre) packs each point against the ones before: nearest neighbours are then 1.04 to 1.08 spacings apart on a dense
//! plane. Scattered, they are 1.09 to 1.12 apart, with a sixth fewer points and no hole larger.
//!
//! Distances are compared in `f32`, in units from the corner of the tile (-1 to 5, so a coordinate is off by 2^-22 at
//! most): a pair conflicts below the spacing plus a margin, which is more than all rounding together. So no pair is
//! ever closer than the spacing, exactly; and a candidate that was omitted lies within 1.00002 spacings of one that was
//! not (`MARGIN`, and the same rounding once more).
//!
//! What neighbours have taken over the border of the node ([`OverBorder`]) is among the points around a tile, and is
//! kept at the same distance.

use super::neighbours::{OverBorder, TILE_BITS};
use super::spacing::Spacing;
use super::taken::Taken;
use super::tile::Tile;
use crate::cloud::TreePoint;
#[cfg(target_arch = "x86_64")]
use crate::runtime::Avx2;
use crate::runtime::{Compare, Portable, Vectors};

/// Added to the squared spacing (at least a quarter of a squared unit): coordinates carry an error of 2^-22,
/// differences of 2^-21, squared distances near 1 of 2·√3·2^-21 + rounding < 1.9e-6.
const MARGIN: f32 = 3e-6;

/// What a thread needs to choose, kept from node to node.
pub(super) struct Poisson {
    vectors: Vectors,
    /// Squared distances (in squared units) below this conflict.
    conflict_below: f32,
    /// More points of a node cannot be that far apart: spheres as dense as they can be packed, and some over the
    /// border.
    most_taken: u64,
    taken: Taken,
    tile: Tile,
}

/// A part of the candidates of a node.
struct Part<'a> {
    unit_bits: u32,
    /// The lower corner of the node.
    corner: TreePoint,
    candidates: &'a [TreePoint],
    over_border: &'a mut OverBorder,
    accepted: &'a mut [bool],
}

impl Poisson {
    pub(super) fn new(spacing: Spacing, vectors: Vectors) -> Self {
        let reach = spacing.in_units();
        Self {
            vectors,
            conflict_below: (reach * reach) as f32 + MARGIN,
            most_taken: (2f64.sqrt() * (spacing.divisor() + 2.0).powi(3)) as u64,
            taken: Taken::new(spacing),
            tile: Tile::new(),
        }
    }

    /// Forgets what was taken for the last node.
    pub(super) fn begin(&mut self) {
        self.taken.clear();
    }

    /// Memory that the points taken of so many candidates need at most, bytes.
    pub(super) fn expected_bytes(&self, candidates: u64) -> u64 {
        candidates.min(self.most_taken) * size_of::<TreePoint>() as u64
    }

    /// Makes room for what a node may take of so many candidates, so that the list never moves: what is not touched
    /// costs no memory.
    pub(super) fn expect(&mut self, candidates: u64) {
        self.taken.reserve(candidates.min(self.most_taken) as usize);
    }

    /// Memory of the points taken so far, bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.taken.bytes()
    }

    /// Gives back the memory of the points taken.
    pub(super) fn release(&mut self) {
        self.taken.release();
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
        let part = Part { unit_bits, corner, candidates, over_border, accepted };
        match self.vectors {
            Vectors::Portable => self.choose_tiles(Portable, part),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the processor has these instructions, or there were no `detected`.
            Vectors::Avx2(detected) => unsafe { self.choose_avx2(Avx2::new(detected), part) },
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn choose_avx2(&mut self, compare: Avx2, part: Part<'_>) {
        self.choose_tiles(compare, part);
    }

    #[inline(always)]
    fn choose_tiles(&mut self, compare: impl Compare, part: Part<'_>) {
        let Part { unit_bits, corner, candidates, over_border, accepted } = part;
        let tile_shift = unit_bits + TILE_BITS;
        let mut at = 0;
        while let Some(&first) = candidates.get(at) {
            let is_in_tile = |t: &TreePoint| (0..3).fold(0, |other, a| other | (t[a] ^ first[a])) >> tile_shift == 0;
            let run = candidates[at..].iter().take_while(|t| is_in_tile(t)).count();
            self.tile.begin(first.cell(tile_shift), unit_bits, self.conflict_below);
            self.taken.around(first, unit_bits, &mut self.tile);
            if !over_border.is_done() {
                let code = self.taken.tile_code(first, corner, tile_shift);
                over_border.of_tile(code).iter().for_each(|(_, p)| self.tile.push_near(*p));
            }
            let (candidates, accepted) = (&candidates[at..at + run], &mut accepted[at..at + run]);
            at += run;
            self.tile.choose(compare, candidates, accepted);
            self.taken.note(candidates, accepted, unit_bits);
        }
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
        let mut found: Option<Vec<bool>> = None;
        let mut count = 0;
        for vectors in Vectors::all() {
            let mut poisson = Poisson::new(spacing, vectors);
            let mut accepted = vec![false; candidates.len()];
            poisson.begin();
            poisson.choose(unit_bits, TreePoint([0; 3]), &points, &mut OverBorder::default(), &mut accepted);
            let others = found.get_or_insert_with(|| accepted.clone());
            assert_eq!(*others, accepted, "{vectors:?}");
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
        // A crowd in a tile and a half: many more than are decided together.
        let crowd: Vec<[u32; 3]> = (0..4000).map(|_| [(next() * 3) >> 6, next() >> 5, next() >> 5]).collect();
        let taken = check(128.0, 14, crowd);
        assert!(taken > 30 && taken < 400, "{taken}");
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
        let mut poisson = Poisson::new(Spacing::default(), Vectors::Portable);
        let corner = TreePoint([0; 3]);
        poisson.choose(24, corner, &candidates.map(TreePoint), &mut OverBorder::default(), &mut accepted);
        assert_eq!(accepted, [true, false, true, true]);
    }

    #[test]
    fn pairs_a_hair_below_the_spacing_conflict_and_pairs_a_hair_above_do_not() {
        let spacing = Spacing::default();
        let (side, unit_bits) = (1u64 << 24, 24);
        let mut random = Random::new(8);
        for vectors in Vectors::all() {
            let mut poisson = Poisson::new(spacing, vectors);
            let mut taken = |a: [u32; 3], b: [u32; 3]| {
                let mut pair = [a, b];
                pair.sort_unstable_by(|a, b| crate::cloud::morton::compare(*a, *b));
                let (mut accepted, mut none) = ([false; 2], OverBorder::default());
                poisson.begin();
                poisson.choose(unit_bits, TreePoint([0; 3]), &pair.map(TreePoint), &mut none, &mut accepted);
                accepted.iter().filter(|a| **a).count()
            };
            for _ in 0..3000 {
                let a: [u32; 3] = std::array::from_fn(|_| (1 << 25) + random.below(1 << 29) as u32);
                let (x, y) = (random.below(side * 7 / 10), random.below(side * 7 / 10));
                // the longest third side with which the distance is below the spacing
                let z = (side * side - 1 - x * x - y * y).isqrt();
                let b = [a[0] - x as u32, a[1] + y as u32, a[2] - z as u32];
                assert!(squared(a, b) < side * side);
                assert_eq!(taken(a, b), 1, "{a:?} {b:?}");
                // 1.00002 spacings: no candidate is omitted for that
                let z = ((side * side) as f64 * 1.00002f64.powi(2) - (x * x + y * y) as f64).sqrt() as u64 + 1;
                assert_eq!(taken(a, [b[0], b[1], a[2] - z as u32]), 2, "{a:?} {b:?}");
            }
        }
    }
}
