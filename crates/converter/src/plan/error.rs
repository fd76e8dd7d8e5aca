//! Requests that cannot be carried out as given, as data.

use std::fmt;
use std::path::PathBuf;

use pointmill_format::DatasetKind;

/// A setting of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Setting {
    /// The scans to read.
    Inputs,
    /// The datasets to make.
    Outputs,
    /// Maximum points of an octree leaf.
    LeafCapacity,
    /// Maximum points of any node of an octree.
    MaxNodePoints,
    /// Distance between points in the root of an octree.
    Spacing,
    /// Quality of Brotli compression.
    BrotliQuality,
    /// Maximum points of a leaf of a binary tree.
    Capacity,
    /// Side of the cells of the coarsest level of detail.
    LodCell,
    /// Bits of a coordinate in batches.
    Planes,
    /// Coordinate step.
    Scale,
    /// Largest error of a coordinate.
    Precision,
    /// Box of the points to keep.
    Bounds,
    /// Folder of temporary files.
    TempDir,
    /// Attributes to keep.
    Attributes,
    /// Attributes to compute.
    Derive,
    /// The points from which they are computed.
    Neighbours,
    /// Coordinate reference system.
    Crs,
}

impl Setting {
    /// The name in words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Inputs => "inputs",
            Self::Outputs => "outputs",
            Self::LeafCapacity => "leaf capacity",
            Self::MaxNodePoints => "points of a node",
            Self::Spacing => "spacing",
            Self::BrotliQuality => "Brotli quality",
            Self::Capacity => "capacity",
            Self::LodCell => "cell of the coarsest level of detail",
            Self::Planes => "planes",
            Self::Scale => "scale",
            Self::Precision => "precision",
            Self::Bounds => "bounds",
            Self::TempDir => "folder of temporary files",
            Self::Attributes => "attributes",
            Self::Derive => "derived attributes",
            Self::Neighbours => "neighbours",
            Self::Crs => "coordinate reference system",
        }
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A setting, and what is wrong with its value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{setting}: {fault}")]
#[non_exhaustive]
pub struct PlanError {
    /// Which setting.
    pub setting: Setting,
    /// What is wrong with it.
    pub fault: PlanFault,
}

impl PlanError {
    pub(crate) fn new(setting: Setting, fault: PlanFault) -> Self {
        Self { setting, fault }
    }
}

/// What is wrong with the value of a setting.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanFault {
    /// Nothing was named.
    #[error("name at least one")]
    Missing,
    /// A format is named more than once.
    #[error("{0} is named twice")]
    Twice(DatasetKind),
    /// Duplicates are dropped, and those of the outputs are not the same.
    #[error(
        "the outputs hold different attributes, and so have different duplicates; name attributes, or make one after the \
         other"
    )]
    DifferentDuplicates,
    /// A count of 0.
    #[error("must be at least 1")]
    Zero,
    /// A length that is not positive and finite.
    #[error("must be a number above 0")]
    NotPositive,
    /// A length that this scene does not permit.
    #[error("must be between {least} and {most} for this scene")]
    NotBetween {
        /// The least that it permits.
        least: f64,
        /// The greatest that it permits.
        most: f64,
    },
    /// A value that is none of the choices.
    #[error("must be {0}")]
    NotOneOf(&'static str),
    /// A length in a unit, of coordinates whose unit is unknown.
    #[error(
        "the unit of the coordinates is unknown; name their coordinate reference system, or give a number in units of \
         the coordinates"
    )]
    UnknownUnit,
    /// A neighbourhood may reach from new points into old ones.
    #[error(
        "cannot be computed while scans are added: what the dataset has depends on the new points; convert all scans at once"
    )]
    NotWhenAppending,
    /// What several processes do together needs the points around each unit.
    #[error("cannot be computed by a job that several processes share; convert on one machine")]
    NotInJobs,
    /// A box without content.
    #[error("the minimum is above the maximum")]
    EmptyBox,
    /// A path that is not a folder.
    #[error("{} is not a folder", .0.display())]
    NotAFolder(PathBuf),
    /// An attribute that no input has.
    #[error("no input has \"{name}\"; the inputs have: {}", known.join(", "))]
    UnknownAttribute {
        /// The name that was requested.
        name: String,
        /// The names that the inputs have.
        known: Vec<String>,
    },
    /// Text that is not a coordinate reference system.
    #[error("\"{0}\" is not EPSG:n, a +proj=… definition or WKT")]
    NotACrs(String),
    /// WKT that ends too early.
    #[error("the WKT \"{0}\" ends before its brackets are closed")]
    CutWkt(String),
    /// WKT with text behind its last bracket.
    #[error("the WKT \"{0}\" goes on after its last bracket")]
    LongWkt(String),
    /// A proj4 definition that means nothing.
    #[error("\"{text}\" {what}")]
    Definition {
        /// The definition.
        text: String,
        /// What is wrong with it: "has no +zone".
        what: String,
    },
    /// WKT of a system without a name.
    #[error("the WKT \"{0}\" has no name in quotes")]
    EmptyWkt(String),
    /// A cell that the format of batches cannot have with this cloud.
    #[error("{0}")]
    Cell(String),
}
