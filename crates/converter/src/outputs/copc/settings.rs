//! What can be chosen of a COPC file.

use crate::octree::Sampling;

/// Settings of a COPC file (`docs/formats/copc.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CopcSettings {
    /// How inner nodes choose their points.
    pub sampling: Sampling,
    /// Distance between points in the root, world units; half of it on each level below. Without one it is chosen.
    pub spacing: Option<f64>,
    /// A node with more points than this is divided, unless all of them share one position.
    pub leaf_capacity: u32,
}

impl Default for CopcSettings {
    fn default() -> Self {
        Self { sampling: Sampling::Poisson, spacing: None, leaf_capacity: 20_000 }
    }
}
