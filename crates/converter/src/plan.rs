//! What a run shall do: every setting resolved, nothing left to guess.

use std::path::PathBuf;

use pointmill_format::bintree::{self, SplitRule};
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
    /// What to make: one or more, no two of a format. One goes into the output folder itself, several into folders of
    /// their names below it.
    pub targets: Vec<Target>,
    /// Octree: how inner nodes choose their points.
    pub sampling: Sampling,
    /// Octree: how payloads are stored.
    pub encoding: Encoding,
    /// Octree: a node with more points than this is split, unless all of them share one position.
    pub leaf_capacity: u32,
    /// Which attributes go in.
    pub attributes: AttributeChoice,
    /// Coordinate step.
    pub scale: ScaleChoice,
    /// Ceiling for the resident set of the whole process, bytes.
    pub memory_bytes: u64,
    /// Worker threads, ≥ 1.
    pub threads: usize,
    /// Points that a thread takes at once, at most; `None`: as the memory allows. Changes nothing in the output.
    pub task_points: Option<u64>,
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

/// A format to write, and its own settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// Potree 2.0 octree (`docs/formats/potree2.md`).
    Potree2,
    /// Mean-split binary tree (`docs/formats/bintree.md`).
    Bintree(BintreeSettings),
    /// Quantised batches (`docs/formats/batches.md`).
    Batches(BatchesSettings),
}

impl Target {
    /// The word of the command line, and the name of its folder beside others.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Potree2 => "potree2",
            Self::Bintree(_) => "bintree",
            Self::Batches(_) => "batches",
        }
    }
}

/// Settings of a mean-split binary tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BintreeSettings {
    /// Most points of a leaf, ≥ 1.
    pub capacity: u32,
    /// Where a node is split.
    pub split: SplitRule,
    /// One file a leaf, or one for all.
    pub layout: bintree::Layout,
}

impl Default for BintreeSettings {
    fn default() -> Self {
        Self { capacity: 65_000, split: SplitRule::Mean, layout: bintree::Layout::Files }
    }
}

/// Settings of quantised batches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BatchesSettings {
    /// Cell of the coarsest level of detail, world units; `None`: from the scene's extent and density.
    pub lod_cell: Option<f64>,
    /// Position planes of ten bits to write, 1 to 3; `None`: those that the scene needs.
    pub planes: Option<u8>,
    /// Zstandard level of the sections; `None`: stored as they are, ready to be mapped.
    pub zstd_level: Option<i32>,
    /// Keep the colours that averaging replaced.
    pub originals: bool,
}

impl Default for BatchesSettings {
    fn default() -> Self {
        Self { lod_cell: Some(1.0), planes: None, zstd_level: None, originals: true }
    }
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
    /// What the format is made for: all for an octree, the class for a binary tree, the colour for batches.
    Usual,
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
            targets: vec![Target::Potree2],
            sampling: Sampling::Poisson,
            encoding: Encoding::Default,
            leaf_capacity: 10_000,
            attributes: AttributeChoice::Usual,
            scale: ScaleChoice::Auto,
            memory_bytes: crate::memory::default_ceiling_bytes(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            task_points: None,
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
