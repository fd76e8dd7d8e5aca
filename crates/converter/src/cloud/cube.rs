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
    /// Equal scales: `t = (q - min) << shift`.
    Shift(u32),
    /// Different scales: `t = (q - min) · factor >> 64`.
    Factor([u128; 3]),
}

/// The extent does not fit the integers of the format; a lattice `2^coarser_by` times coarser would do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TooFine {
    pub(crate) coarser_by: u32,
}

impl Cube {
    /// The cube of a cloud with these exact bounds: a function of nothing else.
    pub(crate) fn around(bounds: &JobBounds, lattice: &Lattice) -> Result<Self, TooFine> {
        let scale = lattice.scale;
        let equal = scale[0] == scale[1] && scale[1] == scale[2];
        if equal { Self::around_equal(bounds, scale[0]) } else { Self::around_unequal(bounds, scale) }
    }

    fn around_equal(bounds: &JobBounds, scale: f64) -> Result<Self, TooFine> {
        let extent = (0..3).map(|a| bounds.extent(a)).max().unwrap_or(0);
        let mut bits = (u64::BITS - extent.leading_zeros()).max(MIN_CUBE_BITS);
        let min = loop {
            let min = JobPoint(std::array::from_fn(|a| anchor(bounds.min[a], bits)));
            if (0..3).all(|a| fits(min[a], bounds.max[a], bits)) {
                break min;
            }
            bits += 1;
        };
        if bits > TREE_BITS {
            return Err(TooFine { coarser_by: bits - TREE_BITS });
        }
        Ok(Self { min, side: 2f64.powi(bits as i32) * scale, bits, step: Step::Shift(TREE_BITS - bits) })
    }

    /// The axis with the largest world extent gives the power of two; the other axes start at their minimum.
    fn around_unequal(bounds: &JobBounds, scale: [f64; 3]) -> Result<Self, TooFine> {
        let world = |a: usize| bounds.extent(a) as f64 * scale[a];
        let reference = (1..3).fold(0, |best, a| if world(a) > world(best) { a } else { best });
        let mut bits = (u64::BITS - bounds.extent(reference).leading_zeros()).max(MIN_CUBE_BITS);
        // A step of any axis must fit the cube too, or a flat cloud with one coarse axis would have no cells there.
        let coarsest = scale.iter().copied().fold(0.0, f64::max);
        while 2f64.powi(bits as i32) * scale[reference] < 2.0 * coarsest {
            bits += 1;
        }
        while !fits(anchor(bounds.min[reference], bits), bounds.max[reference], bits) {
            bits += 1;
        }
        let mut min = bounds.min;
        min[reference] = anchor(bounds.min[reference], bits);
        let widest = (0..3).map(|a| u64::BITS - bounds.max[a].abs_diff(min[a]).leading_zeros()).max().unwrap_or(0);
        let needed = bits.max(widest);
        if needed > TREE_BITS {
            return Err(TooFine { coarser_by: needed - TREE_BITS });
        }
        let side = 2f64.powi(bits as i32) * scale[reference];
        let factor = std::array::from_fn(|a| (scale[a] / side * 2f64.powi(TREE_BITS as i32) * 2f64.powi(64)) as u128);
        Ok(Self { min, side, bits, step: Step::Factor(factor) })
    }

    /// Tree coordinates of a lattice point inside the cube.
    #[inline]
    pub(crate) fn tree(&self, q: JobPoint) -> TreePoint {
        TreePoint(match self.step {
            Step::Shift(shift) => std::array::from_fn(|a| ((q[a] - self.min[a]) as u32) << shift),
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
                Step::Shift(shift) => (first >> shift, (end - 1) >> shift),
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

    /// True if lattice integers shifted by a power of two are cells of the octree (equal scales).
    pub(crate) fn is_aligned(&self) -> bool {
        matches!(self.step, Step::Shift(_))
    }

    /// Levels below which no two different lattice points share a cell.
    pub(crate) fn resolved_level(&self) -> u32 {
        match self.step {
            Step::Shift(_) => self.bits,
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

fn anchor(min: i64, bits: u32) -> i64 {
    let grain = bits - ANCHOR_BITS;
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
        assert_eq!(Cube::around(&bounds, &lattice([1.0; 3])), Err(TooFine { coarser_by: 1 }));
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
        for scale in [[1e-7, 1e-7, 0.01], [0.01; 3], [0.3, 0.001, 7.0]] {
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
