//! The account of a run as data. Serialises to the JSON of `report.json`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill_format::Changes;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use serde_json::{Map, Value};

use super::accuracy::Accuracy;
use super::choices::PlannedChoice;
use super::precision::{PrecisionReport, SavedBytes};
use crate::reason::{BuiltAnew, GridReason};
use crate::warning::{RenamedAttribute, Warning};

/// What a run did.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Version of pointmill.
    pub version: String,
    /// The settings that shaped the output.
    pub options: Map<String, Value>,
    /// One entry per input, in order of path.
    pub inputs: Vec<InputReport>,
    /// Files that were found with the inputs and are no scans.
    pub other_files: OtherFilesReport,
    /// The lattice of the output.
    pub grid: GridReport,
    /// Every point accounted for.
    pub points: PointsReport,
    /// Places that very many points share (16 or more, and at least one in a hundred), the fullest first.
    pub shared_places: Vec<SharedPlaceReport>,
    /// One entry per attribute that was read, in the order of the stored records.
    pub attributes: Vec<AttributeReport>,
    /// What came of attributes that were computed from the points around each; `None`: none were.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub derived: Option<DerivedReport>,
    /// One entry per dataset written, in the order requested.
    pub outputs: Vec<OutputReport>,
    /// Order-independent checksum of the points that passed the filter; that of every output equals it, or the run fails.
    pub checksum_in: String,
    /// Wall seconds and rates by phase.
    pub phases: Vec<PhaseReport>,
    /// Wall seconds in all.
    pub seconds: f64,
    /// Highest resident set of the process, bytes.
    pub peak_memory_bytes: Option<u64>,
    /// Bytes written to temporary files.
    pub temp_bytes: u64,
    /// Points that an earlier run had read already, before it was ended.
    #[serde(skip_serializing_if = "is_zero")]
    pub recalled_points: u64,
    /// Parts of the outputs that an earlier run had built already.
    #[serde(skip_serializing_if = "is_zero")]
    pub recalled_units: u64,
    /// Bytes of the datasets.
    pub output_bytes: u64,
    /// What the user should know, an object with `kind` and `text` each.
    pub warnings: Vec<Warning>,
}

/// Attributes that were computed (`docs/surfels.md`), in counts of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct DerivedReport {
    /// All.
    pub points: u64,
    /// With the normal of their scan.
    pub kept_normals: u64,
    /// Through which there is no plane: their normal is 0 0 0.
    pub without_normal: u64,
    /// With the radius of their scan.
    pub kept_radii: u64,
    /// Whose radius is 0.
    pub without_radius: u64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde asks")]
const fn is_zero(points: &u64) -> bool {
    *points == 0
}

/// One dataset.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct OutputReport {
    /// `potree2`, `bintree`, `batches`.
    pub format: String,
    /// Folder below the output; empty if there is one dataset.
    pub folder: String,
    /// Points in it; with `duplicates_dropped` the points that passed the filter.
    pub points: u64,
    /// Points that were dropped because all of their values repeat.
    pub duplicates_dropped: u64,
    /// How far the positions that a reader decodes are from those of the sources.
    pub accuracy: Accuracy,
    /// What became of the precision that was requested; `None`: none was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<PrecisionReport>,
    /// Attributes that were kept.
    pub attributes: Vec<String>,
    /// Attributes that were omitted, and why.
    pub attributes_dropped: Vec<DroppedAttribute>,
    /// Attributes with values that the format cannot hold as they were read.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub attributes_changed: Vec<ChangedAttribute>,
    /// Attributes that have another name in it than in the inputs; all other lists here have the names of the inputs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub attributes_renamed: Vec<RenamedAttribute>,
    /// Bytes of its files.
    pub bytes: u64,
    /// Wall seconds from the gathered points to the synced files, those of [`Self::built_with`] included.
    pub seconds: f64,
    /// Formats that were made of the same tree at the same time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub built_with: Vec<String>,
    /// Order-independent checksum of the points written; equals `checksum_in` of the report.
    pub checksum: String,
    /// Nodes of a tree.
    pub tree: TreeReport,
    /// What stayed as it was in a dataset that scans were added to; `None`: it is a new one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub taken_over: Option<TakenOver>,
    /// What a coarser step of positions saved, where only the finished dataset tells.
    #[serde(skip)]
    pub(crate) saved: Option<SavedBytes>,
    /// What is particular to the format.
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub details: Map<String, Value>,
    /// What the user should know of it; listed among the warnings of the report.
    #[serde(skip)]
    pub warnings: Vec<Warning>,
}

/// One input. There may be very many: what they have in common they share.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct InputReport {
    /// The file; serialised as text, with U+FFFD for what is no Unicode in its name.
    #[serde(serialize_with = "lossy")]
    pub path: Arc<Path>,
    /// Its kind, for people.
    #[serde(serialize_with = "text")]
    pub format: Arc<str>,
    /// Claimed by the header.
    pub points_declared: u64,
    /// Decoded.
    pub points_read: u64,
    /// Decoded, and exactly at the origin of their scan: where the scanner stood, by the pose of the scan; (0, 0, 0) in
    /// files without poses.
    pub points_at_origin: u64,
    /// Claimed by the header: min x y z, max x y z.
    pub bounds_declared: Option<[f64; 6]>,
    /// Of the points decoded, before any filter.
    pub bounds_measured: Option<[f64; 6]>,
    /// How finely the file stores these coordinates, per axis, world units; null: in doubles that show no step.
    pub resolution: [Option<f64>; 3],
    /// As found, shortened for people ("EPSG:2994", "WKT: NAD83 / …") or empty.
    #[serde(serialize_with = "text")]
    pub crs: Arc<str>,
    /// 8 or 16 where the file has colour.
    pub rgb_depth: Option<u8>,
}

/// One attribute of the cloud.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AttributeReport {
    /// Its name.
    pub name: String,
    /// The type of its elements in the records (`uint16`, `double`, …): one that holds the values of all inputs.
    #[serde(rename = "type")]
    pub ty: String,
    /// Elements per point.
    pub elements: usize,
    /// Points without a value, for which 0 was taken; `None`: all have one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<MissingValues>,
    /// Values that changed while they were read; `None`: none did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changed: Option<ChangedValues>,
}

/// Points that have no value of an attribute.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct MissingValues {
    /// How many.
    pub points: u64,
    /// Of how many files.
    pub files: u64,
    /// What was taken for them.
    pub value: u8,
}

/// An attribute with values that a format cannot hold as they were read.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ChangedAttribute {
    /// Its name.
    pub name: String,
    /// How many, by what became of them.
    pub changed: ChangedValues,
}

/// Values that became others, by what became of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ChangedValues {
    /// Outside the range that is declared or can be held: its nearest end was taken.
    pub clamped: u64,
    /// Between two values that can be held: the nearest was taken.
    pub rounded: u64,
    /// NaN or infinite where there are no such values: 0 was taken.
    pub not_finite: u64,
    /// Too large to be held, and the nearest end would mean something else: 0 was taken.
    pub out_of_range: u64,
    /// Least and greatest finite value among them.
    pub extremes: Option<[f64; 2]>,
}

impl From<Changes> for ChangedValues {
    fn from(changes: Changes) -> Self {
        let Changes { clamped, rounded, not_finite, out_of_range, extremes, .. } = changes;
        Self { clamped, rounded, not_finite, out_of_range, extremes }
    }
}

/// Files that were found with the inputs and are no scans.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct OtherFilesReport {
    /// How many.
    pub count: u64,
    /// The first hundred in order of path, with U+FFFD for what is no Unicode in a name.
    pub paths: Vec<String>,
}

impl OtherFilesReport {
    /// Paths that are listed.
    const LISTED: usize = 100;

    pub(crate) fn new(files: &[PathBuf]) -> Self {
        let paths = files.iter().take(Self::LISTED).map(|f| f.to_string_lossy().into_owned());
        Self { count: files.len() as u64, paths: paths.collect() }
    }
}

/// File names need not be Unicode, JSON must be.
fn lossy<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

fn text<S: Serializer>(text: &Arc<str>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(text)
}

/// The lattice and the cube.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct GridReport {
    /// Coordinate step per axis.
    pub scale: [f64; 3],
    /// World coordinate of integer 0.
    pub offset: [f64; 3],
    /// Side of the root cube, world units.
    pub cube_side: f64,
    /// Why this lattice.
    pub why: GridReason,
}

/// Every point accounted for: `read = kept + outside_bounds + outliers + other_class + thinned + invalid + at_origin`, and
/// for every output
/// `kept = points + duplicates_dropped`. All are counted, none is a difference; the run fails where a sum is wrong.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct PointsReport {
    /// Decoded from the inputs.
    pub read: u64,
    /// Passed the filter.
    pub kept: u64,
    /// Outside the bounds.
    pub outside_bounds: u64,
    /// Far from all others, where these are dropped.
    pub outliers: u64,
    /// Of other classes than those to keep.
    pub other_class: u64,
    /// Removed by thinning.
    pub thinned: u64,
    /// Without a valid position.
    pub invalid: u64,
    /// Exactly at the origin of their scan, and skipped for it.
    pub at_origin: u64,
    /// Declared, but in parts of inputs that could not be decoded.
    pub unreadable: u64,
}

/// A place that very many points share.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct SharedPlaceReport {
    /// World coordinates.
    pub position: [f64; 3],
    /// Points of the cloud that lie there.
    pub points: u64,
}

/// An attribute that is not in the dataset. Serialises to its name, why as text, and the constant if there is one.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DroppedAttribute {
    /// Its name.
    pub name: String,
    /// Why.
    pub why: DropReason,
}

/// Why an attribute is not in a dataset.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum DropReason {
    /// All points agree on these values, one per element.
    Constant(Vec<f64>),
    /// Every point has the value that it has of this attribute.
    SameAs(String),
    /// The value follows from that of another attribute.
    FollowsFrom {
        /// Which.
        attribute: String,
        /// Its values, ascending, with what follows from each.
        table: Vec<[f64; 2]>,
    },
    /// The plan lists the attributes to keep, and this is none of them.
    NotRequested,
    /// The format does not store it unless it is requested.
    NotUsual,
    /// It is shown as grey of 8 bits.
    ShownAsGrey,
    /// This version of the format has no place for it.
    NoPlace(&'static str),
}

impl DropReason {
    /// What all points agree on, by element, if that is why.
    pub fn constant(&self) -> Option<&[f64]> {
        match self {
            Self::Constant(values) => Some(values),
            _ => None,
        }
    }
}

impl std::fmt::Display for DropReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Constant(values) => {
                let texts: Vec<String> = values.iter().map(f64::to_string).collect();
                write!(f, "constant {}", texts.join(" "))
            }
            Self::SameAs(other) => write!(f, "the same as {other}"),
            Self::FollowsFrom { attribute, table } => {
                write!(f, "follows from {attribute} by a table of {} values", table.len())
            }
            Self::NotRequested => f.write_str("not requested"),
            Self::NotUsual => f.write_str("not part of the usual record"),
            Self::ShownAsGrey => f.write_str("shown as grey of 8 bits"),
            Self::NoPlace(version) => write!(f, "version {version} has no place for it"),
        }
    }
}

impl Serialize for DroppedAttribute {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let constant = self.why.constant();
        let mut object = serializer.serialize_struct("DroppedAttribute", 2 + usize::from(constant.is_some()))?;
        object.serialize_field("name", &self.name)?;
        object.serialize_field("why", &self.why.to_string())?;
        match constant {
            Some(values) => object.serialize_field("constant", values)?,
            None => object.skip_field("constant")?,
        }
        object.end()
    }
}

/// The tree.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
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
    /// Maximum points of a subtree of an octree that is built as one; 0: it is no octree.
    #[serde(skip_serializing_if = "is_zero")]
    pub unit_points: u64,
}

/// What a dataset that scans were added to kept of itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct TakenOver {
    /// Nodes whose bytes were copied.
    pub nodes: u64,
    /// Points in them.
    pub points: u64,
    /// Why all was built anew.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why_not: Option<BuiltAnew>,
}

impl TakenOver {
    /// Nothing.
    pub(crate) fn nothing(why: BuiltAnew) -> Self {
        Self { why_not: Some(why), ..Self::default() }
    }
}

/// One phase.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct PhaseReport {
    /// `probe`, `read`, `build`, `finish`.
    pub name: String,
    /// Wall seconds.
    pub seconds: f64,
    /// Points handled.
    pub points: u64,
    /// Points per wall second.
    pub points_per_second: f64,
}

/// What a run would do, from the headers alone.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
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
    /// What would be chosen beside the lattice, and why.
    pub choices: Vec<PlannedChoice>,
    /// Bytes per point of the output (before compression).
    pub bytes_per_point: u64,
    /// The least memory ceiling with which the run could begin, bytes.
    pub least_memory_bytes: u64,
    /// Estimated highest resident set, bytes.
    pub memory_bytes: u64,
    /// Estimated temporary bytes; 0 if all fits in memory.
    pub temp_bytes: u64,
    /// Estimated bytes of the dataset (an upper bound under BROTLI).
    pub output_bytes: u64,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}
