//! Ways to sample, and the spacing that they keep.

use crate::cloud::{TREE_BITS, TreePoint};

/// How an inner node chooses its points from those of its children.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Sampling {
    /// No two points of a level closer than its spacing, and no hole wider: a maximal Poisson-disk sample.
    Poisson,
    /// The point nearest to the centre of each cell of a grid, by default of 128³ cells.
    Grid,
    /// One pseudo-random point of each cell of such a grid.
    Random {
        /// Other seeds, other points; the same seed, the same bytes.
        seed: u64,
    },
}

impl Sampling {
    /// The word in reports and datasets.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Poisson => "poisson",
            Self::Grid => "grid",
            Self::Random { .. } => "random",
        }
    }
}

/// The distance that the points of a level keep: the side of a node divided by the same number on every level.
///
/// A node has `2^bits` *units* along each axis, powers of two of tree coordinates; the spacing is a whole unit or less,
/// but more than half of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spacing {
    divisor: f64,
    bits: u32,
}

impl Spacing {
    /// Spacings along the side of a node: least and greatest.
    pub(crate) const DIVISORS: std::ops::RangeInclusive<f64> = 16.0..=255.0;

    /// As many spacings along the side of a node, within [`Self::DIVISORS`].
    pub(crate) fn new(divisor: f64) -> Self {
        let divisor = divisor.clamp(*Self::DIVISORS.start(), *Self::DIVISORS.end());
        Self { divisor, bits: divisor.log2() as u32 }
    }

    /// Spacings along the side of a node.
    pub(crate) fn divisor(self) -> f64 {
        self.divisor
    }

    /// Bits of a unit at a level; `None` where a node has no so many.
    pub(super) fn unit_bits(self, level: u8) -> Option<u32> {
        (TREE_BITS - self.bits).checked_sub(u32::from(level))
    }

    /// Units along the side of a node: `2^bits`.
    pub(super) fn bits(self) -> u32 {
        self.bits
    }

    /// In units.
    pub(super) fn in_units(self) -> f64 {
        f64::from(1u32 << self.bits) / self.divisor
    }

    /// In tree coordinates, squared.
    pub(super) fn squared(self, level: u8) -> f64 {
        (2f64.powi(TREE_BITS as i32 - i32::from(level)) / self.divisor).powi(2)
    }

    /// Whole tree coordinates that are not less than the spacing; `None` where nodes are too small for one another's
    /// points to matter: what lies at one place lies in one node.
    pub(in crate::octree) fn reach(self, level: u8) -> Option<u32> {
        self.unit_bits(level).map(|_| self.squared(level).sqrt().ceil() as u32)
    }
}

impl Default for Spacing {
    fn default() -> Self {
        Self::new(128.0)
    }
}

/// The distance of two points, squared, in tree coordinates.
pub(super) fn squared_distance(a: TreePoint, b: TreePoint) -> f64 {
    (0..3).map(|i| f64::from(a[i].abs_diff(b[i])).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spacing_is_a_unit_or_less_but_more_than_half_of_one() {
        for (divisor, bits) in [(16.0, 4), (100.0, 6), (127.9, 6), (128.0, 7), (181.0, 7), (255.0, 7)] {
            let spacing = Spacing::new(divisor);
            assert_eq!((spacing.bits(), spacing.divisor()), (bits, divisor));
            assert!(spacing.in_units() > 0.5 && spacing.in_units() <= 1.0);
            let side = 2f64.powi(31 - 5);
            assert!((spacing.squared(5).sqrt() * divisor / side - 1.0).abs() < 1e-12);
        }
        assert_eq!(Spacing::new(128.0).reach(0), Some(1 << 24));
        assert_eq!(Spacing::new(128.0).reach(24), Some(1));
        assert_eq!(Spacing::new(128.0).reach(25), None);
    }

    #[test]
    fn ways_to_sample_have_the_words_of_reports() {
        let all = [Sampling::Poisson, Sampling::Grid, Sampling::Random { seed: 1 }];
        assert_eq!(all.map(Sampling::name), ["poisson", "grid", "random"]);
    }
}
