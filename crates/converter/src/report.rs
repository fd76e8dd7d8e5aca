//! The account of a run: what went in, what came out, what it cost. Serialises to the JSON of `--report`.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value};

/// What a run did.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Report {
    /// Version of pointmill.
    pub version: String,
    /// The settings that shaped the output, by their command-line names.
    pub options: serde_json::Map<String, serde_json::Value>,
    /// One entry an input, in order of path.
    pub inputs: Vec<InputReport>,
    /// The lattice of the output.
    pub grid: GridReport,
    /// Every point accounted for.
    pub points: PointsReport,
    /// Largest and RMS change of a coordinate, per axis, world units.
    pub coordinate_change: CoordinateChange,
    /// One entry a format written, in the order asked for.
    pub outputs: Vec<OutputReport>,
    /// Attributes that were kept, by the first output.
    pub attributes: Vec<String>,
    /// Attributes that were left out by the first output, and why.
    pub attributes_dropped: Vec<DroppedAttribute>,
    /// The tree of the first output.
    pub tree: TreeReport,
    /// Order-independent checksum of the points read and of the points written; equal, or the run fails.
    pub checksum_in: String,
    /// See `checksum_in`.
    pub checksum_out: String,
    /// Wall seconds and rates by phase.
    pub phases: Vec<PhaseReport>,
    /// Wall seconds in all.
    pub seconds: f64,
    /// Highest resident set of the process, bytes.
    pub peak_memory_bytes: Option<u64>,
    /// Bytes written to temporary files.
    pub temp_bytes: u64,
    /// Bytes of the datasets.
    pub output_bytes: u64,
    /// Lines the user should know.
    pub warnings: Vec<String>,
}

/// One dataset.
#[derive(Debug, Clone, Default, Serialize)]
pub struct OutputReport {
    /// `potree2`, `bintree`, `batches`.
    pub format: String,
    /// Folder below the output; empty if there is one dataset.
    pub folder: String,
    /// Points in it.
    pub points: u64,
    /// Attributes that were kept.
    pub attributes: Vec<String>,
    /// Attributes that were left out, and why.
    pub attributes_dropped: Vec<DroppedAttribute>,
    /// Bytes of its files.
    pub bytes: u64,
    /// Wall seconds from the gathered points to the synced files.
    pub seconds: f64,
    /// Order-independent checksum of the points written; equals `checksum_in` of the report.
    pub checksum: String,
    /// Nodes of a tree.
    pub tree: TreeReport,
    /// What is particular to the format.
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub details: Map<String, Value>,
    /// Lines the user should know.
    #[serde(skip)]
    pub warnings: Vec<String>,
}

/// One input.
#[derive(Debug, Clone, Default, Serialize)]
pub struct InputReport {
    /// The file; serialised as text, with U+FFFD for what is no Unicode in its name.
    #[serde(serialize_with = "lossy")]
    pub path: PathBuf,
    /// Its kind, for people.
    pub format: String,
    /// Claimed by the header.
    pub points_declared: u64,
    /// Decoded.
    pub points_read: u64,
    /// Claimed by the header: min x y z, max x y z.
    pub bounds_declared: Option<[f64; 6]>,
    /// Of the points decoded, before any filter.
    pub bounds_measured: Option<[f64; 6]>,
    /// As found, shortened for people ("EPSG:2994", "WKT: NAD83 / …") or empty.
    pub crs: String,
    /// 8 or 16 where the file has colour.
    pub rgb_depth: Option<u8>,
}

/// File names need not be Unicode, JSON must be.
fn lossy<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// The lattice and the cube.
#[derive(Debug, Clone, Default, Serialize)]
pub struct GridReport {
    /// Coordinate step per axis.
    pub scale: [f64; 3],
    /// World coordinate of integer 0.
    pub offset: [f64; 3],
    /// Side of the root cube, world units.
    pub cube_side: f64,
    /// Why this lattice.
    pub why: String,
}

/// Every point accounted for: `read = written + filtered + invalid + duplicates`.
#[derive(Debug, Clone, Default, Serialize)]
pub struct PointsReport {
    /// Decoded from the inputs.
    pub read: u64,
    /// In the dataset.
    pub written: u64,
    /// Left out by `--bounds`.
    pub outside_bounds: u64,
    /// Left out by `--class`.
    pub other_class: u64,
    /// Left out by `--every`.
    pub thinned: u64,
    /// Left out by `--duplicates drop`.
    pub duplicates_dropped: u64,
    /// Without a valid position.
    pub invalid: u64,
    /// Declared, but in parts of inputs that could not be decoded.
    pub unreadable: u64,
}

/// Coordinate change by moving to the output lattice.
#[derive(Debug, Clone, Default, Serialize)]
pub struct CoordinateChange {
    /// Largest, world units.
    pub max: [f64; 3],
    /// Root of the mean square, world units.
    pub rms: [f64; 3],
}

/// An attribute that is not in the dataset.
#[derive(Debug, Clone, Default, Serialize)]
pub struct DroppedAttribute {
    /// Its name.
    pub name: String,
    /// Why ("constant 0", "not asked for", …).
    pub why: String,
    /// What all points agree on, by element, if that is why.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant: Option<Vec<f64>>,
}

/// The tree.
#[derive(Debug, Clone, Default, Serialize)]
pub struct TreeReport {
    /// Nodes in all.
    pub nodes: u64,
    /// Deepest level, root = 0.
    pub depth: u32,
    /// Points by level.
    pub points_per_level: Vec<u64>,
    /// Nodes by level.
    pub nodes_per_level: Vec<u64>,
    /// Points of the fullest leaf.
    pub largest_leaf: u64,
    /// Leaves above the capacity, because their points share one position.
    pub overfull_leaves: u64,
}

/// One phase.
#[derive(Debug, Clone, Default, Serialize)]
pub struct PhaseReport {
    /// `probe`, `read`, `build`, `finish`.
    pub name: String,
    /// Wall seconds.
    pub seconds: f64,
    /// Points handled.
    pub points: u64,
    /// Points a wall second.
    pub points_per_second: f64,
}

/// What a run would do, from the headers alone.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Estimate {
    /// Input files.
    pub inputs: Vec<InputReport>,
    /// Points declared in all.
    pub points: u64,
    /// min x y z, max x y z as declared.
    pub bounds: Option<[f64; 6]>,
    /// Coordinate reference system, as it would stand in `projection`, or what was found.
    pub crs: String,
    /// The lattice.
    pub grid: GridReport,
    /// Attributes of the output.
    pub attributes: Vec<String>,
    /// Bytes a point of the output (before compression).
    pub bytes_per_point: u64,
    /// Estimated highest resident set, bytes.
    pub memory_bytes: u64,
    /// Estimated temporary bytes; 0 if all fits in memory.
    pub temp_bytes: u64,
    /// Estimated bytes of the dataset (an upper bound under BROTLI).
    pub output_bytes: u64,
    /// Lines the user should know.
    pub warnings: Vec<String>,
}
