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
}

impl Default for Potree2Settings {
    fn default() -> Self {
        Self { sampling: Sampling::Poisson, spacing: None, encoding: Encoding::Default, leaf_capacity: 10_000 }
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
    /// Brotli's knee for node payloads: above it the time grows several times over for a few per cent.
    pub const BROTLI_QUALITY: u8 = 5;
}
