//! What was requested: every setting resolved, nothing left to guess.

mod derive;
mod error;
mod export;
mod precision;

use std::path::PathBuf;

use pointmill_format::{Aabb, OpenOptions};

pub(crate) use derive::{CURVATURE, NORMALS, RADIUS};
pub use derive::{Derive, DeriveNormals, NEIGHBOURS, Neighbourhood, Orient};
pub use error::{PlanError, PlanFault, Setting};
pub use export::ExportFormat;
pub use precision::{LengthUnit, PositionPrecision};

/// The most points of a neighbourhood.
const MOST_NEIGHBOURS: u32 = 1000;

/// Points after which what was read is safe, unless the plan says otherwise.
const CHECKPOINT_POINTS: u64 = 64_000_000;

/// What every output shares: inputs, filter, lattice, policies, resources. [`Plan::new`] gives the defaults of the
/// command line. The datasets to make are [`crate::Target`]s beside it.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Scans to read, files only (folders and globs are already expanded), any order.
    pub inputs: Vec<PathBuf>,
    /// Files that were found with the scans and are none: they are told and counted, not read.
    pub other_files: Vec<PathBuf>,
    /// Places where scans may be that could not be looked into, and why: listed in the report.
    pub skipped_inputs: Vec<(PathBuf, String)>,
    /// What text and E57 files do not say of themselves.
    pub open: OpenOptions,
    /// The folder to make.
    pub output: PathBuf,
    /// Name of the cloud in the metadata.
    pub name: String,
    /// Which attributes go in.
    pub attributes: AttributeChoice,
    /// What is computed beside them.
    pub derive: Derive,
    /// Coordinate step.
    pub scale: ScaleChoice,
    /// Ceiling for the resident set of the whole process, bytes.
    pub memory_bytes: u64,
    /// Worker threads, ≥ 1.
    pub threads: usize,
    /// Maximum points of a unit of work; `None`: what the memory allows. Changes nothing in the output.
    pub task_points: Option<u64>,
    /// Maximum points of a subtree of an octree that is built as one; `None`: by the bytes of a point. Shapes the output.
    pub subtree_points: Option<u64>,
    /// Maximum bytes of points that wait in memory between being read and being built; `None`: what the ceiling leaves. More
    /// go through temporary files. Changes nothing in the output.
    pub waiting_bytes: Option<u64>,
    /// Where temporary files go; `None`: beside the output.
    pub temp_dir: Option<PathBuf>,
    /// Which points go in.
    pub filter: Filter,
    /// Points whose position and attributes all repeat.
    pub duplicates: Duplicates,
    /// Points so far from all others that these lose precision.
    pub outliers: Outliers,
    /// Points without a valid position.
    pub invalid: OnFault,
    /// Inputs (or parts of inputs) that cannot be decoded.
    pub unreadable: OnFault,
    /// Meaning of 16-bit colour fields.
    pub rgb_depth: RgbDepth,
    /// Overrides the coordinate reference system of the inputs: a proj4 string, `EPSG:n` or WKT.
    pub crs: Option<String>,
    /// Replace an existing output.
    pub overwrite: bool,
    /// The output is one of the inputs: scans are added to it, and what they do not touch need not be built again. Changes
    /// nothing in the output.
    pub append: bool,
    /// Whether the run leaves what another one can go on with.
    pub checkpoint: Checkpoint,
    /// Points, about, after which what was read is safe. Changes nothing in the output.
    pub checkpoint_points: u64,
    /// Go on where a run that was ended has left off.
    pub resume: bool,
}

/// Whether a run leaves what another one can go on with if it is ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Checkpoint {
    /// If its points are not expected to fit into memory.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// Which attributes go in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AttributeChoice {
    /// What the format is made for: all for an octree, the class for a binary tree, the colour for batches.
    Usual,
    /// All that any input has.
    All,
    /// All but those that have one value everywhere; the report names what is omitted.
    Scene,
    /// These, in this order; `position` is implied.
    List(Vec<String>),
}

/// Coordinate step of the output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ScaleChoice {
    /// The sources' own.
    Auto,
    /// This step on all axes, world units, > 0.
    Fixed(f64),
    /// By axis, the coarsest one that keeps every position this exact; see `docs/accuracy.md`.
    Within(PositionPrecision),
}

/// Which points go in.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Keep what lies inside or on the border, world coordinates.
    pub bounds: Option<Aabb>,
    /// Of that, keep what lies inside or on the border of any of these boxes; empty: all.
    pub regions: Vec<Aabb>,
    /// Keep these classes; `None`: all.
    pub classes: Option<Vec<i64>>,
    /// Keep points whose index in their file is a multiple of this; 0 and 1: all.
    pub every: u64,
    /// Points exactly at the origin of their scan.
    pub origin_points: OriginPoints,
}

/// What to do with points exactly at the origin of their scan: where the scanner stood, by the pose of the scan; (0, 0, 0)
/// in files without poses. Some scanners write them where they measured nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OriginPoints {
    /// Keep them; the report has their number.
    #[default]
    Keep,
    /// Skip them and count them in the report.
    Skip,
}

/// What to do with points whose position and attributes all repeat, as the sources have them: points that only the
/// lattice of the run makes equal are different ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Duplicates {
    /// Keep all.
    Keep,
    /// Keep one.
    Drop,
}

impl Duplicates {
    /// The word in reports and datasets.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::Drop => "drop",
        }
    }
}

/// What to do with points far from all others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Outliers {
    /// Keep them, however coarse the coordinate step becomes for all.
    Keep,
    /// Drop them, and count them.
    Drop,
    /// End the run where they cost precision; where they cost levels of the tree alone, keep them with a warning.
    #[default]
    Fail,
}

impl Outliers {
    /// The word in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Keep => "keep",
            Self::Drop => "drop",
            Self::Fail => "fail",
        }
    }
}

/// What to do when something is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnFault {
    /// Skip it and count it in the report.
    Skip,
    /// End the run.
    Fail,
}

/// Meaning of 16-bit colour fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RgbDepth {
    /// Eight bits for a file whose values all are at most 255, else sixteen; found by reading every point.
    Auto,
    /// Values are 0–255; they are stored times 257.
    Eight,
    /// Values are 0–65535; they are stored as they are.
    Sixteen,
}

impl RgbDepth {
    /// The word in reports and datasets.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Eight => "8",
            Self::Sixteen => "16",
        }
    }
}

impl Plan {
    /// The defaults of the command line.
    pub fn new(inputs: Vec<PathBuf>, output: PathBuf) -> Self {
        Self {
            inputs,
            other_files: Vec::new(),
            skipped_inputs: Vec::new(),
            open: OpenOptions::default(),
            output,
            name: String::new(),
            attributes: AttributeChoice::Usual,
            derive: Derive::default(),
            scale: ScaleChoice::Auto,
            memory_bytes: crate::memory::default_ceiling_bytes(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            task_points: None,
            waiting_bytes: None,
            temp_dir: None,
            filter: Filter::default(),
            duplicates: Duplicates::Keep,
            outliers: Outliers::Fail,
            invalid: OnFault::Skip,
            unreadable: OnFault::Fail,
            rgb_depth: RgbDepth::Auto,
            crs: None,
            overwrite: false,
            checkpoint: Checkpoint::Never,
            checkpoint_points: CHECKPOINT_POINTS,
            resume: false,
            append: false,
            subtree_points: None,
        }
    }
}

impl Plan {
    /// Refuses settings that cannot be used.
    pub(crate) fn check(&self) -> Result<(), PlanError> {
        let refuse = |setting, fault| Err(PlanError::new(setting, fault));
        if self.inputs.is_empty() {
            return refuse(Setting::Inputs, PlanFault::Missing);
        }
        if matches!(self.scale, ScaleChoice::Fixed(s) if !(s.is_finite() && s > 0.0)) {
            return refuse(Setting::Scale, PlanFault::NotPositive);
        }
        if matches!(self.scale, ScaleChoice::Within(p) if !(p.length.is_finite() && p.length > 0.0)) {
            return refuse(Setting::Precision, PlanFault::NotPositive);
        }
        if self.filter.bounds.is_some_and(|b| b.is_empty()) {
            return refuse(Setting::Bounds, PlanFault::EmptyBox);
        }
        match self.derive.neighbourhood {
            Neighbourhood::Nearest(3..=MOST_NEIGHBOURS) => {}
            Neighbourhood::Nearest(_) => return refuse(Setting::Neighbours, PlanFault::NotOneOf("3 to 1000")),
            Neighbourhood::Within(radius) if radius.is_finite() && radius > 0.0 => {}
            Neighbourhood::Within(_) => return refuse(Setting::Neighbours, PlanFault::NotPositive),
        }
        if !self.derive.is_nothing() && self.append {
            return refuse(Setting::Derive, PlanFault::NotWhenAppending);
        }
        match &self.temp_dir {
            Some(dir) if !dir.is_dir() => refuse(Setting::TempDir, PlanFault::NotAFolder(dir.clone())),
            _ => Ok(()),
        }
    }

    /// The name of the cloud: as given, else that of the output.
    pub(crate) fn cloud_name(&self) -> String {
        if !self.name.is_empty() {
            return self.name.clone();
        }
        let stem = self.output.file_name().map(|n| n.to_string_lossy().into_owned());
        stem.filter(|s| !s.is_empty()).unwrap_or_else(|| "cloud".into())
    }
}
