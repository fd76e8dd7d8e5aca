//! The cube that the octree divides, on the job lattice.
//!
//! Every position becomes integers on the job lattice once, and stays so. The octree works in *tree coordinates*: 31-bit
//! fractions of the root cube, equal steps on all axes, so that the cell at level `l` is `t >> (31 - l)`, spacing is a
//! power of two, and octants and Morton order are exact.
//!
//! The side of the cube is an **odd** number `S` of lattice steps. The planes between nodes of a level `l` are at `i · S / 2^l`
//! steps, `i` odd at the level where the plane first occurs: never at a lattice point, and at least `2^-l` steps from the
//! nearest. So there is no point on a plane, and who computes planes and positions in doubles decides the same
//! (docs/formats/potree2.md, §8).

use pointmill_format::{Lattice, NodeKey};

use super::frames::{JobBounds, JobPoint, TreePoint};

/// Bits of a tree coordinate; also the deepest level.
pub(crate) const TREE_BITS: u32 = NodeKey::MAX_LEVEL as u32;

/// The longest side, in steps: two lattice points never share a tree coordinate.
const LONGEST: u64 = (1 << TREE_BITS) - 1;

/// The largest extent, in steps, that a cube holds.
pub(crate) const MOST_STEPS: f64 = (LONGEST - 1) as f64;

/// No cube is smaller: a root spacing (side / 128) below the lattice step would mean nothing.
const LEAST_STEPS: u64 = 129;

/// The largest integer that a record of the format has room for.
const LARGEST_STORED: u64 = i32::MAX as u64;

/// The root cube on the job lattice, and the way from lattice integers to tree coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cube {
    /// The lower corner; integers of octree formats are relative to it.
    pub(crate) min: JobPoint,
    /// Side in world units.
    pub(crate) side: f64,
    /// By axis: `t = ((q - min) << shift) · factor >> 64`.
    shift: [u32; 3],
    factor: [u64; 3],
    /// Side in steps of the finest axis, where all steps are that one times a power of two.
    steps: Option<u64>,
}

/// The extent does not fit the integers of the format.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TooFine;

impl Cube {
    /// The cube of a cloud with these exact bounds: a function of nothing else.
    pub(crate) fn around(bounds: &JobBounds, lattice: &Lattice) -> Result<Self, TooFine> {
        if (0..3).any(|a| bounds.extent(a) as f64 > MOST_STEPS) {
            return Err(TooFine);
        }
        match coarser_by(lattice.scale).and_then(|coarser| Self::around_equal(bounds, lattice.scale, coarser)) {
            Some(cube) => Ok(cube),
            None => Self::around_unequal(bounds, lattice.scale),
        }
    }

    /// Scales that are `2^coarser` of the finest one; `None` if that has too many steps.
    fn around_equal(bounds: &JobBounds, scale: [f64; 3], coarser: [u32; 3]) -> Option<Self> {
        let extent = (0..3).map(|a| bounds.extent(a) << coarser[a]).max()?;
        let finest = scale.into_iter().fold(f64::INFINITY, f64::min);
        let least = LEAST_STEPS << coarser.into_iter().max()?;
        let steps = (extent + 1).max(least) | 1;
        if steps > LONGEST {
            return None;
        }
        let start = |a: usize| place(bounds.extent(a), (steps >> (1 + coarser[a])) + 1, (steps - 1) >> coarser[a]);
        let (shift, factor) = fraction(steps);
        Some(Self {
            min: JobPoint(std::array::from_fn(|a| bounds.min[a].saturating_sub_unsigned(start(a)))),
            side: steps as f64 * finest,
            shift: coarser.map(|by| shift + by),
            factor: [factor; 3],
            steps: Some(steps),
        })
    }

    /// The axis with the largest world extent gives the side.
    fn around_unequal(bounds: &JobBounds, scale: [f64; 3]) -> Result<Self, TooFine> {
        let world = |a: usize| bounds.extent(a) as f64 * scale[a];
        let reference = (1..3).fold(0, |best, a| if world(a) > world(best) { a } else { best });
        // A step of any axis must fit the cube too, or a flat cloud with one coarse axis would have no cells there.
        let coarsest = scale.iter().copied().fold(0.0, f64::max);
        let least = (2.0 * coarsest / scale[reference]).ceil() as u64; // saturates
        let steps = (bounds.extent(reference) + 1).max(LEAST_STEPS).max(least) | 1;
        if steps > LONGEST {
            return Err(TooFine);
        }
        let side = steps as f64 * scale[reference];
        let (shift, factor) = fraction(steps);
        let mut cube = Self { min: bounds.min, side, shift: [shift; 3], factor: [factor; 3], steps: None };
        for (a, own) in scale.into_iter().enumerate() {
            let extent = bounds.extent(a);
            let mut start = place(extent, (steps >> 1) + 1, steps - 1);
            if a != reference {
                let span = side / own;
                // far more than what the quotient is rounded by, and less than the step of the reference that is to spare
                let last = (span * (1.0 - 2f64.powi(-40))) as u64;
                start = place(extent, ((span / 2.0) as u64).saturating_add(1), last);
                (cube.shift[a], cube.factor[a]) = quotient(own / side);
            }
            let has_room = start.saturating_add(extent) <= LARGEST_STORED;
            cube.min[a] = bounds.min[a].saturating_sub_unsigned(if has_room { start } else { 0 });
        }
        Ok(cube)
    }

    /// Tree coordinates of a lattice point inside the cube: the floor of `(q - min) · 2^31 / S`.
    #[inline]
    pub(crate) fn tree(&self, q: JobPoint) -> TreePoint {
        TreePoint(std::array::from_fn(|a| {
            let steps = (q[a].wrapping_sub(self.min[a]) as u64) << self.shift[a];
            high(steps, self.factor[a]) as u32
        }))
    }

    /// The same, rounded to the nearest that is in the cube.
    #[inline]
    pub(crate) fn nearest_tree(&self, q: JobPoint) -> [u64; 3] {
        std::array::from_fn(|a| {
            let steps = (q[a].wrapping_sub(self.min[a]) as u64) << self.shift[a];
            let product = u128::from(steps) * u128::from(self.factor[a]);
            (((product + (1 << (u64::BITS - 1))) >> u64::BITS) as u64).min(LONGEST)
        })
    }

    /// Where all steps are the finest one times a power of two: the side in steps of the finest axis, odd and below `2^31`,
    /// and by axis that power.
    pub(crate) fn whole_steps(&self) -> Option<(u64, [u32; 3])> {
        let steps = self.steps?;
        let (finest, _) = fraction(steps);
        Some((steps, self.shift.map(|shift| shift - finest)))
    }

    /// By axis, what `q - min` is multiplied by so that the upper 64 bits of the product are the cell of a level, the same
    /// as `t >> (31 - level)`; `None` where there is no such factor.
    pub(crate) fn cell_factors(&self, level: u32) -> Option<[u64; 3]> {
        let below = TREE_BITS.checked_sub(level)?;
        let mut factors = [0; 3];
        for (a, factor) in factors.iter_mut().enumerate() {
            let whole = self.ratio(a);
            // Bits that are lost change nothing where cells are fractions of an odd side: by less than 2^-33, and products
            // are at least 1 / S > 2^-31 from a whole number ([`fraction`]).
            if self.steps.is_none() && whole.trailing_zeros() < below {
                return None;
            }
            *factor = u64::try_from(whole >> below).ok()?;
        }
        Some(factors)
    }

    /// The box of the lattice that holds the points of a node, and no others.
    pub(crate) fn bounds_of(&self, node: NodeKey) -> JobBounds {
        let level = u32::from(node.level);
        let mut bounds = JobBounds::EMPTY;
        for (a, cell) in [node.x, node.y, node.z].into_iter().enumerate() {
            // the first integer whose tree coordinate is not below that of the cell
            let first = |cell: u64| {
                let t = u128::from(cell << (TREE_BITS - level));
                u64::try_from((t << 64).div_ceil(self.ratio(a).max(1))).unwrap_or(u64::MAX)
            };
            let [min, end] = [cell, cell + 1].map(|c| first(u64::from(c)));
            bounds.min[a] = self.min[a].saturating_add_unsigned(min);
            bounds.max[a] = self.min[a].saturating_add_unsigned(end.saturating_sub(1));
        }
        bounds
    }

    /// Levels below which no two different lattice points share a cell.
    pub(crate) fn resolved_level(&self) -> u32 {
        self.steps.map_or(TREE_BITS, |steps| u64::BITS - steps.leading_zeros())
    }

    /// World coordinates of the lower corner: a lattice point, computed so that tidy decimals stay tidy.
    pub(crate) fn offset(&self, lattice: &Lattice) -> [f64; 3] {
        std::array::from_fn(|a| tidy_world(self.min[a], lattice.scale[a], lattice.offset[a]))
    }

    /// `t = (q - min) · ratio >> 64`.
    fn ratio(&self, axis: usize) -> u128 {
        u128::from(self.factor[axis]) << self.shift[axis]
    }
}

/// The upper half of a product.
#[inline]
pub(crate) fn high(a: u64, b: u64) -> u64 {
    ((u128::from(a) * u128::from(b)) >> 64) as u64
}

/// Where in the cube an axis begins, in its own steps: in the middle; but what fits between the middle plane (`above` is the
/// first coordinate beyond it) and the last coordinate begins there, so that planes divide a thin cloud only where nodes
/// are thinner than it. In the very middle, it would be divided at level 1 and have twice the nodes.
fn place(extent: u64, above: u64, last: u64) -> u64 {
    if above.saturating_add(extent) <= last { above } else { last.saturating_sub(extent) / 2 }
}

/// Shift and factor of `X · 2^31 / S` for odd `S`, rounded down: exact for all `X < S`.
///
/// With `2^b < S < 2^(b+1)` the factor is `(2^(64+b) + r) / S`, `0 < r ≤ S`, and has 64 bits. The product with `X · 2^(31-b)`,
/// divided by `2^64`, is `X · 2^31 / S + e` with `e = X · 2^(31-b) · r / (S · 2^64) < 2^32 / 2^64`. A fraction of `S` that is not
/// whole ends at least `1 / S > 2^-31` below the next whole number, which `e` does not reach; it is whole only for `X = 0`.
fn fraction(steps: u64) -> (u32, u64) {
    let bits = steps.ilog2();
    let factor = (1u128 << (64 + bits)) / u128::from(steps) + 1;
    (TREE_BITS - bits, factor as u64)
}

/// Shift and factor of `X · d · 2^31`, rounded down, for a double `d` below 1: no bit of it above `2^-95` is lost.
fn quotient(d: f64) -> (u32, u64) {
    let ratio = (d * 2f64.powi(64 + TREE_BITS as i32)) as u128;
    let shift = (u128::BITS - ratio.leading_zeros()).saturating_sub(u64::BITS);
    (shift, (ratio >> shift) as u64)
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

/// Exponents `e` such that each scale is the finest times `2^e`, if they are that.
fn coarser_by(scale: [f64; 3]) -> Option<[u32; 3]> {
    let finest = scale.iter().copied().fold(f64::INFINITY, f64::min);
    let mut exponents = [0; 3];
    for (exponent, scale) in exponents.iter_mut().zip(scale) {
        let ratio = (scale / finest).log2().round();
        if !(0.0..f64::from(TREE_BITS)).contains(&ratio) || finest * ratio.exp2() != scale {
            return None;
        }
        *exponent = ratio as u32;
    }
    Some(exponents)
}

#[cfg(test)]
mod tests;
