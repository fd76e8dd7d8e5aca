//! The cube that the octree divides, on the job lattice.
//!
//! Every position becomes integers on the job lattice once, and stays so. The octree works in *tree coordinates*: 31-bit
//! fractions of the root cube, equal steps on all axes, so that the cell at level `l` is `t >> (31 - l)`, spacing is a
//! power of two, and octants and Morton order are exact.

use pointmill_format::{Lattice, NodeKey};

use super::frames::{JobBounds, JobPoint, TreePoint};

/// Bits of a tree coordinate; also the deepest level.
pub(crate) const TREE_BITS: u32 = NodeKey::MAX_LEVEL as u32;

/// The anchor of the cube is a multiple of `side / 2^ANCHOR_BITS`. Cells of a partition that is at least this fine are
/// therefore octree nodes, whatever the final bounds turn out to be.
pub(crate) const ANCHOR_BITS: u32 = 4;

/// The same for the largest cube, which cannot grow to hold what its anchor leaves out: more extents fit this way.
pub(crate) const LARGEST_ANCHOR_BITS: u32 = 6;

/// The largest extent, in steps, that a cube holds.
pub(crate) const MOST_STEPS: f64 = ((1u64 << TREE_BITS) - 1) as f64;

/// The smallest cube is this many bits wide: a root spacing (side / 128) below the lattice step would mean nothing.
const MIN_CUBE_BITS: u32 = 7;

/// The root cube on the job lattice, and the way from lattice integers to tree coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cube {
    /// The lower corner; integers of octree formats are relative to it.
    pub(crate) min: JobPoint,
    /// Side in world units.
    pub(crate) side: f64,
    /// Side is `2^bits` steps of the reference axis.
    pub(crate) bits: u32,
    step: Step,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    /// Scales that are equal, or powers of two apart: `t = (q - min) << shift`, by axis.
    Shift([u32; 3]),
    /// Other scales: `t = (q - min) · factor >> 64`.
    Factor([u128; 3]),
}

/// The extent does not fit the integers of the format; a lattice this many times coarser, by axis, would do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TooFine {
    pub(crate) coarser_by: [f64; 3],
}

impl Cube {
    /// The cube of a cloud with these exact bounds: a function of nothing else.
    pub(crate) fn around(bounds: &JobBounds, lattice: &Lattice) -> Result<Self, TooFine> {
        let too_fine = [0, 1, 2].map(|a| (bounds.extent(a) as f64 / MOST_STEPS).max(1.0));
        if too_fine.iter().any(|f| *f > 1.0) {
            return Err(TooFine { coarser_by: too_fine });
        }
        match binary_exponents(lattice.scale).and_then(|e| Self::around_shifted(bounds, lattice.scale, e)) {
            Some(cube) => Ok(cube),
            None => Self::around_unequal(bounds, lattice.scale),
        }
    }

    /// Scales that are `2^exponent` of the coarsest one, exponents ≤ 0; `None` if such a cube is too large for them.
    fn around_shifted(bounds: &JobBounds, scale: [f64; 3], exponents: [u32; 3]) -> Option<Self> {
        // bits of the extent in units of the coarsest step
        let units = |a: usize| bounds.extent(a) >> exponents[a];
        let extent = (0..3).map(units).max().unwrap_or(0);
        let mut bits = (u64::BITS - extent.leading_zeros()).max(MIN_CUBE_BITS);
        let finest = exponents.into_iter().max().unwrap_or(0);
        let coarsest = (0..3).find(|a| exponents[*a] == 0)?;
        loop {
            if bits + finest > TREE_BITS {
                return None;
            }
            let own = exponents.map(|e| bits + e);
            let min = JobPoint(std::array::from_fn(|a| anchor(bounds.min[a], own[a], anchor_bits(bits))));
            if (0..3).all(|a| fits(min[a], bounds.max[a], own[a])) {
                let side = 2f64.powi(bits as i32) * scale[coarsest];
                return Some(Self { min, side, bits, step: Step::Shift(own.map(|b| TREE_BITS - b)) });
            }
            bits += 1;
        }
    }

    /// The axis with the largest world extent gives the power of two; the other axes start at their minimum. Serves for
    /// extents that take all 31 bits, too.
    fn around_unequal(bounds: &JobBounds, scale: [f64; 3]) -> Result<Self, TooFine> {
        let world = |a: usize| bounds.extent(a) as f64 * scale[a];
        let reference = (1..3).fold(0, |best, a| if world(a) > world(best) { a } else { best });
        let mut bits = (u64::BITS - bounds.extent(reference).leading_zeros()).max(MIN_CUBE_BITS);
        // A step of any axis must fit the cube too, or a flat cloud with one coarse axis would have no cells there.
        let coarsest = scale.iter().copied().fold(0.0, f64::max);
        while 2f64.powi(bits as i32) * scale[reference] < 2.0 * coarsest {
            bits += 1;
        }
        let start = |bits| anchor(bounds.min[reference], bits, anchor_bits(bits));
        while bits < TREE_BITS && !fits(start(bits), bounds.max[reference], bits) {
            bits += 1;
        }
        let mut min = bounds.min;
        if fits(start(bits), bounds.max[reference], bits) {
            min[reference] = start(bits); // else every bit is needed: the cube starts where the points do
        }
        if bits > TREE_BITS {
            let mut coarser_by = [1.0; 3];
            coarser_by[reference] = 2f64.powi((bits - TREE_BITS) as i32);
            return Err(TooFine { coarser_by });
        }
        let side = 2f64.powi(bits as i32) * scale[reference];
        let factor = std::array::from_fn(|a| (scale[a] / side * 2f64.powi(TREE_BITS as i32) * 2f64.powi(64)) as u128);
        Ok(Self { min, side, bits, step: Step::Factor(factor) })
    }

    /// Tree coordinates of a lattice point inside the cube.
    #[inline]
    pub(crate) fn tree(&self, q: JobPoint) -> TreePoint {
        TreePoint(match self.step {
            Step::Shift(shift) => std::array::from_fn(|a| ((q[a] - self.min[a]) as u32) << shift[a]),
            Step::Factor(factor) => std::array::from_fn(|a| {
                let t = ((q[a] - self.min[a]) as u128).wrapping_mul(factor[a]) >> 64;
                (t as u64).min((1 << TREE_BITS) - 1) as u32
            }),
        })
    }

    /// A box of the lattice that holds every point of a node: exact with equal scales, else a step wider.
    pub(crate) fn bounds_of(&self, node: NodeKey) -> JobBounds {
        let level = u32::from(node.level);
        let mut bounds = JobBounds::EMPTY;
        for (a, cell) in [node.x, node.y, node.z].into_iter().enumerate() {
            let [first, end] = [cell, cell + 1].map(|c| u64::from(c) << (TREE_BITS - level));
            let (min, max) = match self.step {
                Step::Shift(shift) => (first >> shift[a], (end - 1) >> shift[a]),
                Step::Factor(factor) => {
                    let step = |t: u64| ((u128::from(t) << 64) / factor[a].max(1)).min(1 << TREE_BITS) as u64;
                    // what lies beyond the last tree coordinate counts as on it
                    let max = if end >> TREE_BITS > 0 { u64::from(u32::MAX) } else { step(end) + 1 };
                    (step(first).saturating_sub(1), max)
                }
            };
            bounds.min[a] = self.min[a].saturating_add_unsigned(min);
            bounds.max[a] = self.min[a].saturating_add_unsigned(max);
        }
        bounds
    }

    /// By axis, the bits of lattice integers that a cell of the octree's level spans, where shifted integers are cells
    /// (scales that are equal, or powers of two apart).
    pub(crate) fn aligned_shift(&self, level: u32) -> Option<[u32; 3]> {
        match self.step {
            Step::Shift(shift) => Some(shift.map(|s| (TREE_BITS - s).saturating_sub(level))),
            Step::Factor(_) => None,
        }
    }

    /// [`Self::aligned_shift`] of the largest cube of a lattice, for a cloud of which no cube is known.
    pub(crate) fn largest_shift(lattice: &Lattice, level: u32) -> [u32; 3] {
        let exponents = binary_exponents(lattice.scale).unwrap_or([0; 3]);
        let finest = exponents.into_iter().max().unwrap_or(0);
        exponents.map(|e| (TREE_BITS + e).saturating_sub(finest + level))
    }

    /// The level of cells that span that many bits of lattice integers.
    pub(crate) fn level_of(&self, cell_bits: [u32; 3]) -> u32 {
        match self.step {
            Step::Shift(shift) => (TREE_BITS - shift[0]).saturating_sub(cell_bits[0]),
            Step::Factor(_) => 0,
        }
    }

    /// True if the anchor lies on cells of that many bits, by axis.
    pub(crate) fn is_anchored_on(&self, cell_bits: [u32; 3]) -> bool {
        match self.step {
            Step::Shift(shift) => {
                let grain = shift.map(|s| TREE_BITS - s - anchor_bits(self.bits));
                (0..3).all(|a| cell_bits[a] <= grain[a])
            }
            Step::Factor(_) => false,
        }
    }

    /// Levels below which no two different lattice points share a cell.
    pub(crate) fn resolved_level(&self) -> u32 {
        match self.step {
            Step::Shift(shift) => TREE_BITS - shift.into_iter().min().unwrap_or(0),
            Step::Factor(_) => TREE_BITS,
        }
    }

    /// World coordinates of the lower corner: a lattice point, computed so that tidy decimals stay tidy.
    pub(crate) fn offset(&self, lattice: &Lattice) -> [f64; 3] {
        std::array::from_fn(|a| tidy_world(self.min[a], lattice.scale[a], lattice.offset[a]))
    }
}

/// `q · scale + offset`; where the scale is the reciprocal of a whole number (0.01, 0.001) by one correctly rounded
/// division, so that 47600123 steps of 0.01 print as 476001.23.
pub(crate) fn tidy_world(q: i64, scale: f64, offset: f64) -> f64 {
    let plain = q as f64 * scale + offset;
    let steps = (1.0 / scale).round();
    if steps >= 1.0 && 1.0 / steps == scale {
        let whole = offset * steps;
        let sum = whole + q as f64;
        let tidy = sum / steps;
        if whole.fract() == 0.0 && sum.abs() < 2f64.powi(53) && (tidy - plain).abs() <= scale * 1e-6 {
            return tidy;
        }
    }
    plain
}

/// Exponents `e` such that each scale is the coarsest divided by `2^e`, if they are that.
fn binary_exponents(scale: [f64; 3]) -> Option<[u32; 3]> {
    let coarsest = scale.iter().copied().fold(0.0, f64::max);
    let mut exponents = [0; 3];
    for (exponent, scale) in exponents.iter_mut().zip(scale) {
        let ratio = (coarsest / scale).log2().round();
        if !(0.0..f64::from(TREE_BITS)).contains(&ratio) || scale * ratio.exp2() != coarsest {
            return None;
        }
        *exponent = ratio as u32;
    }
    Some(exponents)
}

fn anchor_bits(bits: u32) -> u32 {
    if bits == TREE_BITS { LARGEST_ANCHOR_BITS } else { ANCHOR_BITS }
}

fn anchor(min: i64, bits: u32, anchor_bits: u32) -> i64 {
    let grain = bits - anchor_bits;
    if grain >= 63 { i64::MIN } else { min >> grain << grain }
}

fn fits(min: i64, max: i64, bits: u32) -> bool {
    bits >= u64::BITS || max.abs_diff(min) < 1 << bits
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn lattice(scale: [f64; 3]) -> Lattice {
        Lattice { scale, offset: [0.0; 3] }
    }

    #[test]
    fn the_cube_holds_the_bounds_and_lies_on_its_own_grain() {
        for (min, max) in [(0, 0), (-5, 1000), (123_456, 9_876_543), (-2_000_000_000, 40), (7, 7 + (1 << 30))] {
            let bounds = JobBounds::new([min, 0, min], [max, 1, max]);
            let cube = Cube::around(&bounds, &lattice([0.01; 3])).unwrap();
            for a in 0..3 {
                assert!(cube.min[a] <= bounds.min[a] && bounds.max[a] < cube.min[a] + (1 << cube.bits));
                assert_eq!(cube.min[a].rem_euclid(1 << (cube.bits - ANCHOR_BITS)), 0);
            }
        }
    }

    #[test]
    fn an_extent_beyond_31_bits_asks_for_a_coarser_lattice() {
        let bounds = JobBounds::new([i64::from(i32::MIN); 3], [i64::from(i32::MAX); 3]);
        let Err(too_fine) = Cube::around(&bounds, &lattice([1.0; 3])) else { panic!("a cube of 33 bits") };
        assert!(too_fine.coarser_by.iter().all(|f| (2.0..2.001).contains(f)), "{too_fine:?}");
        let corridor = JobBounds::new([i64::from(i32::MIN), 0, 0], [i64::from(i32::MAX), 9, 9]);
        let Err(too_fine) = Cube::around(&corridor, &lattice([1.0; 3])) else { panic!("a cube of 33 bits") };
        assert_eq!(too_fine.coarser_by[1..], [1.0; 2], "the short axes fit");
    }

    #[test]
    fn all_31_bits_fit_wherever_they_start() {
        let most = MOST_STEPS as i64;
        let grained = most - (1 << 25);
        for (min, extent) in [(0, most), (1, most), (-7, grained), (123_456_789, most), (-1_987_654_321, grained)] {
            let cube = Cube::around(&JobBounds::new([min; 3], [min + extent; 3]), &lattice([0.001; 3])).unwrap();
            assert_eq!(cube.bits, TREE_BITS);
            assert!((0..3).all(|a| cube.min[a] <= min && min + extent < cube.min[a] + (1 << 31)));
            assert_eq!(cube.aligned_shift(0).is_some(), extent == grained || min == 0);
            let ends = [min, min + extent].map(|v| i64::from(cube.tree(JobPoint([v; 3]))[0]));
            assert_eq!(ends[1] - ends[0], extent, "a unit of the tree is a step");
        }
        let flat = JobBounds::new([-5, 3, 7], [-5 + most, most, 100]);
        let cube = Cube::around(&flat, &lattice([1e-8, 1e-8, 0.001])).unwrap();
        assert!(cube.side >= most as f64 * 1e-8);
    }

    #[test]
    fn scales_that_are_powers_of_two_apart_are_shifted() {
        let scale = [0.25, 2.0, 0.125];
        let bounds = JobBounds::new([-4000, 100, 7], [80_000, 20_000, 90_000]);
        let cube = Cube::around(&bounds, &lattice(scale)).unwrap();
        assert_eq!(cube.aligned_shift(0), Some([cube.bits + 3, cube.bits, cube.bits + 4]));
        let side = 2f64.powi(cube.bits as i32) * 2.0;
        assert!(cube.side == side && (39_800.0..=4.0 * 39_800.0).contains(&side));
        let t = cube.tree(bounds.max).0.map(|t| f64::from(t) / 2f64.powi(31) * cube.side);
        for a in 0..3 {
            assert_eq!(t[a], (bounds.max[a] - cube.min[a]) as f64 * scale[a]);
        }
    }

    #[test]
    fn unequal_scales_give_one_cube_and_points_inside_it() {
        let bounds = JobBounds::new([-1_220_000_000, 450_000_000, 0], [-1_219_900_000, 450_100_000, 30_000]);
        let l = lattice([1e-7, 1e-7, 0.01]);
        let cube = Cube::around(&bounds, &l).unwrap();
        assert!(cube.side >= 300.0 && cube.side < 1200.0);
        let t = cube.tree(bounds.max);
        let half = f64::from(1u32 << 30);
        assert!((f64::from(t[2]) / half / 2.0 * cube.side - (bounds.max[2] - cube.min[2]) as f64 * 0.01).abs() < 1e-6);
        assert!((f64::from(t[0]) / half / 2.0 * cube.side - 0.01).abs() < 1e-6);
    }

    #[test]
    fn the_box_of_a_node_holds_its_points() {
        let bounds = JobBounds::new([-1_220_000_000, 450_000_000, 0], [-1_219_900_000, 450_100_000, 30_000]);
        for scale in [[1e-7, 1e-7, 0.01], [0.01; 3], [0.3, 0.001, 7.0], [0.5, 0.25, 1.0]] {
            let Ok(cube) = Cube::around(&bounds, &lattice(scale)) else { continue };
            let mut random = Random::new(1);
            for _ in 0..2000 {
                let q = JobPoint(std::array::from_fn(|a| {
                    let range = bounds.max[a] - bounds.min[a] + 1;
                    bounds.min[a] + random.below(range as u64) as i64
                }));
                for level in [0u8, 4, 9] {
                    let [x, y, z] = cube.tree(q).cell(TREE_BITS - u32::from(level));
                    let b = cube.bounds_of(NodeKey { level, x, y, z });
                    assert!((0..3).all(|a| b.min[a] <= q[a] && q[a] <= b.max[a]), "{scale:?} {level} {q:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn whole_decimals_stay_whole() {
        assert_eq!(tidy_world(123, 0.01, 476_000.0), 476_001.23);
        assert_eq!(tidy_world(-7, 0.001, 0.0), -0.007);
        assert_eq!(tidy_world(3, 0.3, 1.0), 3.0 * 0.3 + 1.0);
    }
}
