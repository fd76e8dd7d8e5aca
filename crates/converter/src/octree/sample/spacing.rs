//! Ways to sample, and the spacing that they keep.

use crate::cloud::TREE_BITS;

/// How an inner node chooses its points from those of its children.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Sampling {
    /// No two points of a node closer than its spacing, and no hole wider: a maximal Poisson-disk sample.
    Poisson,
    /// The point nearest to the centre of each cell of a 128³ grid.
    Grid,
    /// One pseudo-random point of each cell of a 128³ grid.
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

/// Spacing of a node is its side divided by `2^SPACING_BITS`.
pub(crate) const SPACING_BITS: u32 = 7;

/// Bits below the spacing of a level: a cell as wide as the spacing is `t >> cell_shift(level)`.
pub(super) fn cell_shift(level: u8) -> u32 {
    (TREE_BITS - SPACING_BITS).saturating_sub(u32::from(level))
}
