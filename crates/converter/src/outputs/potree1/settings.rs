//! What can be chosen of a Potree 1 octree.

use crate::octree::Sampling;

/// Settings of a Potree 1.7 or 1.8 octree (`docs/formats/potree1.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Potree1Settings {
    /// How inner nodes choose their points.
    pub sampling: Sampling,
    /// Distance between points in the root, world units; half of it on each level below. Without one it is chosen.
    pub spacing: Option<f64>,
    /// A node with more points than this is divided, unless all of them share one position.
    pub leaf_capacity: u32,
    /// No node has more points than this, unless all of them share one position; what is too much for an inner node goes to
    /// its children.
    pub max_node_points: Option<u32>,
    /// How attributes are described, and so which there can be.
    pub version: Potree1Version,
    /// All files are in one archive, uncompressed.
    pub archive: bool,
}

impl Default for Potree1Settings {
    fn default() -> Self {
        Self {
            sampling: Sampling::Poisson,
            spacing: None,
            leaf_capacity: 20_000,
            max_node_points: None,
            version: Potree1Version::V1_7,
            archive: false,
        }
    }
}

/// The version of a Potree 1 octree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Potree1Version {
    /// Attributes are words: colour, intensity, classification and normals are those that every client reads.
    V1_7,
    /// Attributes are objects, of any name and type: Potree and BA_PointCloud alone read it.
    V1_8,
}

impl Potree1Version {
    /// As it stands in datasets and reports: "1.7".
    pub const fn name(self) -> &'static str {
        match self {
            Self::V1_7 => "1.7",
            Self::V1_8 => "1.8",
        }
    }
}
