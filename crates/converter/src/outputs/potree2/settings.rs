//! What can be chosen of an octree.

use crate::octree::Sampling;

/// Settings of a Potree 2.0 octree (`docs/formats/potree2.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Potree2Settings {
    /// How inner nodes choose their points.
    pub sampling: Sampling,
    /// Distance between points in the root, world units; half of it on each level below. Without one it is chosen.
    pub spacing: Option<f64>,
    /// How payloads are stored.
    pub encoding: Encoding,
    /// A node with more points than this is divided, unless all of them share one position.
    pub leaf_capacity: u32,
    /// Colour channels of 16 bits that viewers take for 8.
    pub dark_colours: DarkColours,
}

impl Default for Potree2Settings {
    fn default() -> Self {
        Self {
            sampling: Sampling::Poisson,
            spacing: None,
            encoding: Encoding::Default,
            leaf_capacity: 20_000,
            dark_colours: DarkColours::Keep,
        }
    }
}

/// What becomes of channels of 1 to 255 of colours of 16 bits: viewers divide a channel by 256 if it is above 255, and
/// show others as they are, too bright.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DarkColours {
    /// They stay as they are.
    Keep,
    /// Those below 128 become 0, the others 256.
    Round,
}

impl DarkColours {
    /// The word in reports and datasets.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::Round => "round",
        }
    }
}

/// Encoding of node payloads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Encoding {
    /// Interleaved records, uncompressed.
    Default,
    /// Columns in Morton order under Brotli.
    Brotli {
        /// 0–11.
        quality: u8,
    },
}

impl Encoding {
    /// The first quality that encodes by column: above 9 the time grows a hundred times for up to eight per cent.
    pub const BROTLI_QUALITY: u8 = 5;
}
