//! What the user should know of a run that goes on, as data.

use std::fmt;
use std::path::PathBuf;

use pointmill_format::{Aabb, AttributeType, Changes, DatasetKind, ReadError, ScanWarning, Unit};
use serde::ser::{Serialize, SerializeStruct, Serializer};

use crate::advice::Advice;
use crate::reason::LatticeReason;

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
    /// The inputs have different coordinate reference systems.
    DifferentCrs {
        /// What each of them says.
        labels: Vec<String>,
    },
    /// A binary tree with one file per leaf has very many files.
    ManyFiles {
        /// Number of leaves.
        leaves: usize,
    },
    /// Batches: 16-bit colours are stored in 8 bits.
    ColoursNarrowed,
    /// Batches: some inputs have no colour and are black.
    InputsWithoutColour {
        /// How many.
        without: usize,
        /// Of how many inputs.
        inputs: usize,
    },
    /// Batches: no input has colour; grey shows the intensity.
    GreyIntensity {
        /// The intensity shown as black.
        least: f64,
        /// The intensity shown as white.
        greatest: f64,
    },
    /// Batches: no input has colour or intensity.
    NoColour,
}

/// What is odd about a coordinate reference system.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum CrsNote {
    /// The WKT describes no horizontal system.
    NoSystem,
    /// The WKT carries no EPSG code.
    NoCode {
        /// Name of the system.
        name: String,
    },
    /// The table of proj4 definitions lacks the code.
    NotInTable {
        /// EPSG code.
        code: u32,
    },
    /// Viewers cannot use the proj4 definition.
    NotForViewers {
        /// EPSG code, where the definition comes from the table.
        code: Option<u32>,
        /// Why.
        why: Proj4Fault,
    },
    /// WKT and GeoTIFF keys of one file disagree.
    Disagree {
        /// What the WKT says: code, units.
        wkt: String,
        /// What the GeoTIFF keys say.
        geotiff: String,
        /// The file says that the keys count, and they were taken.
        keys_taken: bool,
    },
    /// Coordinates are declared in another unit than the one of their system.
    Unit {
        /// EPSG code of the system.
        code: u32,
        /// The unit of the system.
        own: Unit,
        /// The unit that was declared, and taken.
        declared: Unit,
    },
    /// The given system has another unit than the one that the inputs declare.
    GivenUnit {
        /// The unit of the given system, which was taken.
        given: Unit,
        /// The unit that the inputs declare.
        declared: Unit,
    },
    /// The false easting of the WKT is not the one of the code that it carries.
    FalseEasting {
        /// EPSG code of the system.
        code: u32,
        /// False easting of the WKT, metres.
        found: f64,
        /// False easting of the code, metres.
        own: f64,
    },
    /// GeoTIFF keys define a system by parameters.
    UserDefined {
        /// Its name, or empty.
        name: String,
    },
    /// The WKT ends too early.
    CutWkt,
}

/// Why viewers cannot use a proj4 definition.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Proj4Fault {
    /// There is none.
    Missing,
    /// The text is not one.
    Malformed(String),
    /// Viewers do not know the projection.
    UnknownProjection(String),
    /// A definition cannot say that coordinates have this unit.
    Unit(Unit),
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
            Self::DifferentCrs { .. } => "different_crs",
            Self::ManyFiles { .. } => "many_files",
            Self::ColoursNarrowed => "colours_narrowed",
            Self::InputsWithoutColour { .. } => "inputs_without_colour",
            Self::GreyIntensity { .. } => "grey_intensity",
            Self::NoColour => "no_colour",
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
            Self::ManyFiles { .. } => Some(Advice::PackLeaves),
            _ => None,
        }
    }

    /// The line without the advice.
    pub fn what(&self) -> String {
        match self {
            Self::Scan { path, warning } => format!("{}: {warning}", path.display()),
            Self::OtherFiles { files } => other_files(files),
            Self::OldOutputBack { output } => format!(
                "{}: a run was ended while it replaced this output; the dataset before it is back in its place",
                output.display()
            ),
            Self::Leftover { path, why } => format!("{}: left over, and not removed: {why}", path.display()),
            Self::InputSkipped { error, .. } => format!("input skipped: {error}"),
            Self::PointsSkipped { points, error, .. } => format!("{points} points skipped: {error}"),
            Self::ReadAgain => "the points lie outside the bounds that were declared or sampled, or their extent does \
                                not fit the chosen step; reading again with the measured bounds"
                .to_owned(),
            Self::AboveCeiling { peak, ceiling } => format!(
                "the run took {} MiB of memory, more than the ceiling of {} MiB; please report this scene",
                peak.div_ceil(1 << 20),
                ceiling >> 20
            ),
            Self::FinerStep { scale, reason } => format!(
                "the coordinates are finer than bounds or a sample showed; reading again with the step {}: {reason}",
                steps(*scale)
            ),
            Self::CoarserStep { scale, reason } => format!("coordinate step {}: {reason}", steps(*scale)),
            Self::OutliersDropped { points, others: Aabb { min, max } } => format!(
                "{points} or more points far from all others are dropped: those outside {min:?} to {max:?}; reading again"
            ),
            Self::CoarseSingle { path, resolution } => format!(
                "{}: stores coordinates in single precision, which resolves {} here and no finer; no tool can restore \
                 what it lacks",
                path.display(),
                steps(*resolution)
            ),
            Self::Outliers { points, factor, holds_back_step, .. } => outliers(*points, *factor, *holds_back_step),
            Self::OriginPoints { points, of } => format!(
                "{} of {} points lie exactly at the origin of their scan, where the scanner stood",
                grouped(*points),
                grouped(*of)
            ),
            Self::SharedPlace { position, points, of, more, .. } => shared_place(*position, *points, *of, *more),
            Self::ValuesChanged { attribute, output: None, changes } => format!("{attribute}: {changes}"),
            Self::ValuesChanged { attribute, output: Some((kind, ty)), changes } => {
                format!("{}: {attribute}, stored as {ty}: {changes}", kind.name())
            }
            Self::AttributesApart { name, elements: [one, two], other } => format!(
                "the inputs have two attributes {name:?}, of {one} and of {two} elements a point; the second is {other:?}"
            ),
            Self::ValuesMissing { attributes, points, files } => missing(attributes, *points, *files),
            Self::MixedRgbDepth { eight_bit, coloured, first } => format!(
                "{eight_bit} of {coloured} inputs with colour have no value above 255 and are taken as 8 bits deep, \
                 the others as 16 (the first is {})",
                first.display()
            ),
            Self::Crs(note) => note.to_string(),
            Self::DifferentCrs { labels } => format!(
                "the inputs have different coordinate reference systems ({}); coordinates are taken as they are and \
                 the projection stays empty",
                labels.join("; ")
            ),
            Self::ManyFiles { leaves } => format!("{leaves} files, one per leaf"),
            Self::ColoursNarrowed => "batches: colours of 16 bits are stored in 8".to_owned(),
            Self::InputsWithoutColour { without, inputs } => {
                format!("batches: {without} of {inputs} inputs have no colour and are black")
            }
            Self::GreyIntensity { least, greatest } => {
                format!("batches: no input has colour; grey shows the intensity, {least} to {greatest}")
            }
            Self::NoColour => "batches: no input has colour or intensity; all points are white".to_owned(),
        }
    }
}

fn other_files(files: &[PathBuf]) -> String {
    let named: Vec<_> = files.iter().take(3).map(|f| f.display().to_string()).collect();
    let (noun, more) = (if files.len() == 1 { "file" } else { "files" }, if files.len() > 3 { ", …" } else { "" });
    format!("{} other {noun} skipped, not scans ({}{more})", files.len(), named.join(", "))
}

/// One number where all axes have the same.
fn steps(scale: [f64; 3]) -> String {
    let short = |v: f64| if (1e-4..1e9).contains(&v) { v.to_string() } else { format!("{v:e}") };
    let [x, y, z] = scale.map(short);
    if x == y && y == z { x } else { format!("{x}, {y}, {z}") }
}

/// The line of an error of something that was skipped: without the advice to skip it.
pub(crate) fn reason_of(error: &ReadError) -> String {
    match error.advice() {
        Some(pointmill_format::Advice::SkipUnreadable) | None => error.what_and_where(),
        Some(_) => error.to_string(),
    }
}

fn missing(attributes: &[String], points: u64, files: u64) -> String {
    let (point, have) = if points == 1 { ("point", "has") } else { ("points", "have") };
    let file = if files == 1 { "file" } else { "files" };
    format!("{}: {points} {point} of {files} {file} {have} none; 0 is written", attributes.join(", "))
}

fn outliers(points: u64, factor: f64, holds_back_step: bool) -> String {
    let (lie, make, them) = if points == 1 { ("point is", "makes", "it") } else { ("points are", "make", "them") };
    let gain = if holds_back_step { "the coordinate step could be finer and " } else { "" };
    format!(
        "{points} {lie} far from all others and {make} the extent at least {} times larger; without {them} {gain}the \
         tree would have fewer levels",
        factor.floor()
    )
}

fn shared_place([x, y, z]: [f64; 3], points: u64, of: u64, more: usize) -> String {
    let more = match more {
        0 => String::new(),
        1 => ", and one more place is shared by at least one in a hundred".to_owned(),
        n => format!(", and {n} more places are each shared by at least one in a hundred"),
    };
    format!("{} of {} points share the position ({x}, {y}, {z}){more}", grouped(points), grouped(of))
}

/// A count with commas between thousands.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
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

impl fmt::Display for CrsNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSystem => f.write_str("the WKT describes no projected or geographic coordinate system"),
            Self::NoCode { name } => write!(f, "the WKT \"{name}\" carries no EPSG code"),
            Self::NotInTable { code } => write!(f, "EPSG:{code} is not in the table of proj4 definitions"),
            Self::NotForViewers { code: Some(code), why } => write!(f, "EPSG:{code}: {why}"),
            Self::NotForViewers { code: None, why } => why.fmt(f),
            Self::Disagree { wkt, geotiff, keys_taken } => {
                let taken = if *keys_taken { "the keys were taken, as the header says" } else { "the WKT was taken" };
                write!(f, "the WKT says {wkt} but the GeoTIFF keys say {geotiff}; {taken}")
            }
            Self::Unit { code, own, declared } => write!(
                f,
                "EPSG:{code} has coordinates in units of {own}, but units of {declared} are declared; the latter were taken"
            ),
            Self::GivenUnit { given, declared } => write!(
                f,
                "the inputs declare coordinates in units of {declared}, the given coordinate reference system has \
                 units of {given}; the latter were taken"
            ),
            Self::FalseEasting { code, found, own } => write!(
                f,
                "the WKT has a false easting of {found} m, but the EPSG:{code} that it names has {own} m; the \
                 projection stays empty"
            ),
            Self::UserDefined { name } if name.is_empty() => {
                f.write_str("the GeoTIFF keys define a system of their own, which is not interpreted")
            }
            Self::UserDefined { name } => {
                write!(f, "the GeoTIFF keys define a system of their own (\"{name}\"), which is not interpreted")
            }
            Self::CutWkt => f.write_str("the WKT ends before its brackets are closed"),
        }
    }
}

impl fmt::Display for Proj4Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("there is no proj4 definition for it"),
            Self::Malformed(text) => write!(f, "\"{text}\" is not a proj4 definition"),
            Self::Unit(Unit::Unknown) => f.write_str("the unit of the coordinates is not known"),
            Self::Unit(unit) => write!(f, "a proj4 definition cannot have coordinates in units of {unit}"),
            Self::UnknownProjection(name) => write!(f, "viewers do not know +proj={name}"),
        }
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
