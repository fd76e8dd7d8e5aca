//! What `index.json` says beside the nodes.

use serde_json::{Map, Value};

use crate::Lattice;
use crate::names::named;

use super::RecordLayout;

/// What the key `format` says.
pub(super) const FORMAT: &str = "pointmill-bintree";

/// What the key `version` says.
pub(super) const VERSION: u64 = 1;

/// Where the leaves are. Version 1 of the format has these two.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// One file per leaf, named by its path.
    Files,
    /// All in `leaves.bin`.
    Packed,
}

impl Layout {
    /// Every layout.
    pub const ALL: [Self; 2] = [Self::Files, Self::Packed];

    /// The word in the index.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Files => "files",
            Self::Packed => "packed",
        }
    }
}

named!(Layout, "layout");

/// How splitting planes are found (`docs/formats/bintree.md`, section 6.2). Version 1 of the format has these three.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SplitRule {
    /// At the exact mean, rounded down: the meaning of the format.
    #[default]
    Mean,
    /// At the median.
    Median,
    /// In the middle of the box.
    Midpoint,
}

impl SplitRule {
    /// Every rule.
    pub const ALL: [Self; 3] = [Self::Mean, Self::Median, Self::Midpoint];

    /// The word in the index.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Median => "median",
            Self::Midpoint => "midpoint",
        }
    }
}

named!(SplitRule, "split rule");

/// Everything in `index.json` but the nodes.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Header {
    /// Program and version that wrote the dataset.
    pub generator: String,
    /// Name of the cloud.
    pub name: String,
    /// Points of all leaves together.
    pub points: u64,
    /// Most points of a leaf, ≥ 1.
    pub capacity: u64,
    /// Where the leaves are.
    pub layout: Layout,
    /// How splitting planes were found.
    pub split: SplitRule,
    /// A local frame for renderers; nothing in the files is relative to it.
    pub origin: [f64; 3],
    /// A proj4 definition or nothing.
    pub projection: String,
    /// Where the sources' positions lie: world = X · scale + offset.
    pub lattice: Lattice,
    /// The free key `pointmill`.
    pub pointmill: Map<String, Value>,
    /// The columns of a leaf record.
    pub record: RecordLayout,
}

impl Header {
    /// The header of an unnamed dataset without points: split at the mean, records of the core alone. Set the other
    /// fields.
    #[must_use]
    pub fn new(lattice: Lattice, capacity: u64, layout: Layout) -> Self {
        Self {
            generator: String::new(),
            name: String::new(),
            points: 0,
            capacity,
            layout,
            split: SplitRule::Mean,
            origin: [0.0; 3],
            projection: String::new(),
            lattice,
            pointmill: Map::new(),
            record: RecordLayout::core(),
        }
    }
}
