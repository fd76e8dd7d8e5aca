//! What the user should know of a run that goes on, as data.

mod colours;
mod crs;
mod numbers;
mod skipped;
mod viewers;
mod words;

use std::fmt;
use std::path::PathBuf;

use pointmill_format::{Aabb, AttributeType, Changes, DatasetKind, ScanWarning};
use serde::ser::{Serialize, SerializeStruct, Serializer};

use crate::advice::Advice;
use crate::reason::LatticeReason;

pub use colours::ColourNote;
pub use crs::{CrsNote, Proj4Fault};
pub(crate) use skipped::{SkippedPoints, reason_of};
pub use viewers::{NameFault, RenamedAttribute, ViewerNote};

/// What the user should know of a run that goes on.
///
/// `Display` gives one line with [`Self::advice`] in words. Serialises to an object with `kind` and `text`.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// A reader noticed something odd in a scan that did not stop it.
    Scan {
        /// The scan.
        path: PathBuf,
        /// What was odd.
        warning: ScanWarning,
    },
    /// Files that were found with the scans are none.
    OtherFiles {
        /// All of them, in order of path.
        files: Vec<PathBuf>,
    },
    /// A run was ended while it replaced an output; the old one was put back.
    OldOutputBack {
        /// The output.
        output: PathBuf,
    },
    /// Something that this or an earlier run has left stays.
    Leftover {
        /// The file or folder.
        path: PathBuf,
        /// Why it is not removed.
        why: String,
    },
    /// An input that cannot be read was skipped.
    InputSkipped {
        /// The input.
        path: PathBuf,
        /// Why, with path and byte.
        error: String,
    },
    /// Points that cannot be decoded were skipped.
    PointsSkipped {
        /// How many, by the declared counts.
        points: u64,
        /// The scan that has them.
        path: PathBuf,
        /// Why, with path and byte.
        error: String,
    },
    /// There is no run to go on with: this one begins anew.
    BeginsAnew,
    /// What a run had left to go on with was removed, as this one begins anew.
    JobRemoved {
        /// The folder.
        folder: PathBuf,
    },
    /// Another run cannot go on where this one ends, if it does not come to its end.
    NoJob {
        /// Why.
        why: String,
    },
    /// The declared bounds, or the coordinate step chosen from them, do not fit the points: they are read again.
    ReadAgain,
    /// The process took more memory than it was allowed.
    AboveCeiling {
        /// Resident set at its highest, bytes.
        peak: u64,
        /// The ceiling, bytes.
        ceiling: u64,
    },
    /// Bounds that were declared, or decimals of a sample, made the coordinate step too coarse: the points are read
    /// again.
    FinerStep {
        /// The step per axis, world units.
        scale: [f64; 3],
        /// Why.
        reason: LatticeReason,
    },
    /// The points ask for a coarser coordinate step: they are read again.
    CoarserStep {
        /// The step per axis, world units.
        scale: [f64; 3],
        /// Why.
        reason: LatticeReason,
    },
    /// Points far from all others were dropped.
    OutliersDropped {
        /// At least as many.
        points: u64,
        /// The box of all others, world units.
        others: Aabb,
    },
    /// Single precision does not resolve the coordinates of an input well.
    CoarseSingle {
        /// The input.
        path: PathBuf,
        /// Distance of neighbouring coordinates at the largest ones, per axis, world units.
        resolution: [f64; 3],
    },
    /// A few points are far from all others.
    Outliers {
        /// How many.
        points: u64,
        /// The box of all others, whole world units.
        others: Aabb,
        /// Longest side of the cloud over that of `others`.
        factor: f64,
        /// The coordinate step would be finer without them.
        holds_back_step: bool,
    },
    /// Points exactly at the origin of their scan, where the scanner stood.
    OriginPoints {
        /// How many.
        points: u64,
        /// Of how many points of scans whose origin is known.
        of: u64,
    },
    /// Very many points share one place.
    SharedPlace {
        /// World coordinates of the place that most share.
        position: [f64; 3],
        /// Points there.
        points: u64,
        /// Points of the cloud.
        of: u64,
        /// Other places that very many points share.
        more: usize,
        /// The place is (0, 0, 0) in a file that does not say where the scanner stood.
        at_origin: bool,
    },
    /// Values of an attribute could not stay as they were.
    ValuesChanged {
        /// Its name.
        attribute: String,
        /// The format that cannot hold them, and the type that it has; `None`: they changed while they were read.
        output: Option<(DatasetKind, AttributeType)>,
        /// How many, by what became of them.
        changes: Changes,
    },
    /// Two attributes of one name cannot be one.
    AttributesApart {
        /// The name.
        name: String,
        /// Elements of the first and of the second.
        elements: [usize; 2],
        /// The name that the second gets.
        other: String,
    },
    /// Some files, or some scans of a file, have no values of attributes that others have.
    ValuesMissing {
        /// Their names.
        attributes: Vec<String>,
        /// Points without.
        points: u64,
        /// Files that have such points.
        files: u64,
    },
    /// Inputs with 8-bit colour are mixed with inputs with 16-bit colour.
    MixedRgbDepth {
        /// Inputs taken as 8 bits deep.
        eight_bit: usize,
        /// Inputs with colour.
        coloured: usize,
        /// The first of the former.
        first: PathBuf,
    },
    /// The coordinate reference system could not be resolved in full.
    Crs(CrsNote),
    /// What viewers of octrees make of a dataset, or what was done so that they show it.
    Viewers {
        /// The format.
        format: DatasetKind,
        /// What there is to say.
        note: ViewerNote,
    },
    /// The inputs have different coordinate reference systems.
    DifferentCrs {
        /// What each of them says.
        labels: Vec<String>,
    },
    /// A file has no place for the coordinate reference system as it is known.
    CrsNotWritten {
        /// The system, for people.
        label: String,
    },
    /// A binary tree with one file per leaf has very many files.
    ManyFiles {
        /// Number of leaves.
        leaves: usize,
    },
    /// Colours of a format that has 8 bits for them.
    Colours {
        /// The format.
        format: DatasetKind,
        /// What there is to say.
        note: ColourNote,
    },
}

impl Warning {
    /// A short name for programs, such as `outliers`.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Scan { .. } => "scan",
            Self::OtherFiles { .. } => "other_files",
            Self::OldOutputBack { .. } => "old_output_back",
            Self::Leftover { .. } => "leftover",
            Self::InputSkipped { .. } => "input_skipped",
            Self::PointsSkipped { .. } => "points_skipped",
            Self::BeginsAnew => "begins_anew",
            Self::JobRemoved { .. } => "job_removed",
            Self::NoJob { .. } => "no_job",
            Self::ReadAgain => "read_again",
            Self::AboveCeiling { .. } => "above_ceiling",
            Self::FinerStep { .. } => "finer_step",
            Self::CoarserStep { .. } => "coarser_step",
            Self::OutliersDropped { .. } => "outliers_dropped",
            Self::CoarseSingle { .. } => "coarse_single",
            Self::Outliers { .. } => "outliers",
            Self::OriginPoints { .. } => "origin_points",
            Self::SharedPlace { .. } => "shared_place",
            Self::ValuesChanged { .. } => "values_changed",
            Self::AttributesApart { .. } => "attributes_apart",
            Self::ValuesMissing { .. } => "values_missing",
            Self::MixedRgbDepth { .. } => "mixed_rgb_depth",
            Self::Crs(_) => "crs",
            Self::Viewers { note, .. } => note.kind(),
            Self::DifferentCrs { .. } => "different_crs",
            Self::CrsNotWritten { .. } => "crs_not_written",
            Self::ManyFiles { .. } => "many_files",
            Self::Colours { note, .. } => note.kind(),
        }
    }

    /// What the user can do, where there is something.
    pub fn advice(&self) -> Option<Advice> {
        match self {
            Self::Outliers { others, .. } => Some(Advice::CutBounds { bounds: Some(*others) }),
            Self::OriginPoints { .. } | Self::SharedPlace { at_origin: true, .. } => Some(Advice::SkipOriginPoints),
            Self::MixedRgbDepth { .. } => Some(Advice::SetRgbDepth),
            Self::Scan { warning: ScanWarning::DecimalComma { .. }, .. } => Some(Advice::CommasSeparate),
            Self::Crs(CrsNote::NoCode { .. } | CrsNote::UserDefined { .. }) => Some(Advice::NameEpsg),
            Self::Crs(CrsNote::NotInTable { .. } | CrsNote::FalseEasting { .. }) => Some(Advice::GiveProj4),
            Self::DifferentCrs { .. } => Some(Advice::Reproject),
            Self::Viewers { note, .. } => note.advice(),
            Self::ManyFiles { .. } => Some(Advice::PackLeaves),
            _ => None,
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what())?;
        match self.advice() {
            Some(advice) => write!(f, "; {advice}"),
            None => Ok(()),
        }
    }
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Warning", 2)?;
        object.serialize_field("kind", self.kind())?;
        object.serialize_field("text", &self.to_string())?;
        object.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_one_line_for_all_attributes_that_the_same_points_lack() {
        let missing = |names: &[&str], points, files| {
            let attributes = names.iter().map(|n| (*n).to_owned()).collect();
            Warning::ValuesMissing { attributes, points, files }.to_string()
        };
        let line = "classification, intensity: 400 points of 2 files have none; 0 is written";
        assert_eq!(missing(&["classification", "intensity"], 400, 2), line);
        assert_eq!(missing(&["rgb"], 1, 1), "rgb: 1 point of 1 file has none; 0 is written");
    }

    #[test]
    fn a_warning_is_an_object_with_kind_and_text() {
        let json = serde_json::to_value(Warning::ManyFiles { leaves: 7 }).unwrap();
        assert_eq!(json["kind"], "many_files");
        assert_eq!(json["text"], "7 files, one per leaf; the packed layout puts all leaves into one file");
    }
}
