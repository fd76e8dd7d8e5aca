//! What a run shall do: every setting resolved, nothing left to guess.

use std::path::PathBuf;

use pointmill_format::{Aabb, OpenOptions};

/// The settings of a conversion. `Plan::new` gives the defaults of the command line.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Scans to read, files only (folders and globs are already expanded), any order.
    pub inputs: Vec<PathBuf>,
    /// What text and E57 files do not say of themselves.
    pub open: OpenOptions,
    /// The folder to make.
    pub output: PathBuf,
    /// Name of the cloud in the metadata.
    pub name: String,
    /// How inner nodes choose their points.
    pub sampling: Sampling,
    /// How payloads are stored.
    pub encoding: Encoding,
    /// A node with more points than this is split, unless all of them share one position.
    pub leaf_capacity: u32,
    /// Which attributes go in.
    pub attributes: AttributeChoice,
    /// Coordinate step.
    pub scale: ScaleChoice,
    /// Ceiling for the resident set of the whole process, bytes.
    pub memory_bytes: u64,
    /// Worker threads, ≥ 1.
    pub threads: usize,
    /// Where temporary files go; `None`: beside the output.
    pub temp_dir: Option<PathBuf>,
    /// Which points go in.
    pub filter: Filter,
    /// Points whose position and attributes all repeat.
    pub duplicates: Duplicates,
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
}

/// How an inner node chooses its points from those of its children.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// No two points of a node closer than its spacing, and no hole wider: a maximal Poisson-disk sample.
    Poisson,
    /// The point nearest to the centre of each cell of a 128³ grid.
    Grid,
    /// One pseudo-random point of each cell of a 128³ grid.
    Random {
        /// Other seeds, other points; the same seed, the same bytes.
        seed: u64,
    },
}

/// Encoding of node payloads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Interleaved records, uncompressed.
    Default,
    /// Columns in Morton order under Brotli.
    Brotli {
        /// 0–11.
        quality: u8,
    },
}

/// Which attributes go in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AttributeChoice {
    /// All that any input has.
    All,
    /// All but those that have one value everywhere; what is left out is named in the report.
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
}

/// Which points go in.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Keep what lies inside or on the border, world coordinates.
    pub bounds: Option<Aabb>,
    /// Keep these classes; `None`: all.
    pub classes: Option<Vec<u8>>,
    /// Keep points whose index in their file is a multiple of this; 0 and 1: all.
    pub every: u64,
}

/// What to do with points whose position and attributes all repeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Duplicates {
    /// Keep all.
    Keep,
    /// Keep one.
    Drop,
}

/// What to do when something is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnFault {
    /// Leave it out and count it in the report.
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

impl Plan {
    /// The defaults of the command line for one output.
    pub fn new(inputs: Vec<PathBuf>, output: PathBuf) -> Self {
        Self {
            inputs,
            open: OpenOptions::default(),
            output,
            name: String::new(),
            sampling: Sampling::Poisson,
            encoding: Encoding::Default,
            leaf_capacity: 10_000,
            attributes: AttributeChoice::All,
            scale: ScaleChoice::Auto,
            memory_bytes: crate::memory::default_ceiling_bytes(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            temp_dir: None,
            filter: Filter::default(),
            duplicates: Duplicates::Keep,
            invalid: OnFault::Skip,
            unreadable: OnFault::Fail,
            rgb_depth: RgbDepth::Auto,
            crs: None,
            overwrite: false,
        }
    }
}
