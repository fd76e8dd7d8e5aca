//! What `pointmill convert` takes.

use std::num::NonZero;
use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use pointmill_format::Aabb;

use super::common::{InputArgs, TalkArgs};
use super::values::{
    Attributes, Planes, Scale, parse_attributes, parse_bounds, parse_bytes, parse_compress, parse_planes, parse_scale,
};

#[derive(Debug, ClapArgs)]
pub(crate) struct ConvertArgs {
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
    /// Folder to make
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,

    /// Output format; several, each with its own --to, are made from one read of the input and go into OUT/potree2,
    /// OUT/bintree, OUT/batches
    #[arg(long, value_name = "FORMAT", default_value = "potree2", help_heading = "Output")]
    pub(crate) to: Vec<TargetArg>,
    /// Replaces OUT if it is a dataset; the old one stays until the new one is complete
    #[arg(long, help_heading = "Output")]
    pub(crate) overwrite: bool,
    /// Name of the cloud in the metadata [default: name of the first input]
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    pub(crate) name: Option<String>,
    /// Encoding of node payloads
    #[arg(long, value_enum, default_value = "default", help_heading = "Output")]
    pub(crate) encoding: EncodingArg,
    /// 0 (fast) to 11 (small), with --encoding brotli [default: 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=11), help_heading = "Output")]
    pub(crate) brotli_quality: Option<u8>,
    /// How inner nodes choose their points: a maximal Poisson-disk sample, the point nearest to the centre of each
    /// cell of a 128³ grid, or one pseudo-random point of each cell
    #[arg(long, value_enum, default_value = "poisson", help_heading = "Output")]
    pub(crate) sampling: SamplingArg,
    /// Seed of --sampling random; the same seed gives the same bytes [default: 0]
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub(crate) seed: Option<u64>,
    /// A node with more points than this is split
    #[arg(long, value_name = "POINTS", default_value = "10000",
          value_parser = clap::value_parser!(u32).range(1..=1_000_000), help_heading = "Output")]
    pub(crate) leaf_capacity: u32,
    #[command(flatten)]
    pub(crate) bintree: BintreeArgs,
    #[command(flatten)]
    pub(crate) batches: BatchesArgs,
    /// Coordinate step in units of the CRS, or `auto`: the sources' own, so that no coordinate changes; for scans
    /// without one, what the extent and the precision of the scan allow
    #[arg(long, value_name = "STEP", default_value = "auto", value_parser = parse_scale, help_heading = "Output")]
    pub(crate) scale: Scale,
    /// Overrides the coordinate reference system: a proj4 string, EPSG:n or WKT [default: from the inputs]
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    pub(crate) crs: Option<String>,

    /// `all`; `scene`: without those that are constant; or a list, as in intensity,rgb [default: all for potree2, the
    /// class for bintree, the colour for batches]
    #[arg(long, value_name = "all|scene|LIST", value_parser = parse_attributes, help_heading = "What goes in")]
    pub(crate) attributes: Option<Attributes>,
    /// Keeps the points inside this box, in world coordinates
    #[arg(long, value_name = "X,Y,Z..X,Y,Z", value_parser = parse_bounds, allow_hyphen_values = true,
          help_heading = "What goes in")]
    pub(crate) bounds: Option<Aabb>,
    /// Keeps these classes, as in 2,6 [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "What goes in")]
    pub(crate) class: Option<Vec<u8>>,
    /// Keeps one of N points, by their index in the file
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u64).range(1..),
          help_heading = "What goes in")]
    pub(crate) every: u64,
    /// Points whose position and attributes all repeat
    #[arg(long, value_enum, default_value = "keep", help_heading = "What goes in")]
    pub(crate) duplicates: DuplicatesArg,
    /// Points without a valid position
    #[arg(long, value_enum, default_value = "skip", help_heading = "What goes in")]
    pub(crate) invalid: FaultArg,
    /// Inputs, or parts of them, that cannot be decoded
    #[arg(long, value_enum, default_value = "fail", help_heading = "What goes in")]
    pub(crate) unreadable: FaultArg,
    /// Meaning of colour values: 0–255, 0–65535, or found out by reading them all
    #[arg(long, value_enum, default_value = "auto", help_heading = "What goes in")]
    pub(crate) rgb_depth: RgbDepthArg,

    /// Ceiling for the memory of the whole process, as in 2GiB [default: 60 % of what the machine allows]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes, help_heading = "Resources")]
    pub(crate) memory: Option<u64>,
    /// Worker threads [default: all cores]
    #[arg(long, value_name = "N", help_heading = "Resources")]
    pub(crate) threads: Option<NonZero<u16>>,
    /// Folder for temporary files, used when the points do not fit the ceiling [default: beside OUT]
    #[arg(long, value_name = "DIR", help_heading = "Resources")]
    pub(crate) temp_dir: Option<PathBuf>,

    /// Writes the run report (JSON) here too; it is always in OUT/report.json
    #[arg(long, value_name = "FILE", help_heading = "What is told")]
    pub(crate) report: Option<PathBuf>,
    /// Says from the headers alone what would be done: points, bounds, CRS, grid, memory, disk; writes nothing
    #[arg(long, help_heading = "What is told")]
    pub(crate) dry_run: bool,
    /// Prints the run report, or the estimate of --dry-run, as JSON on standard output
    #[arg(long, help_heading = "What is told")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// Settings of a mean-split binary tree.
#[derive(Debug, ClapArgs)]
pub(crate) struct BintreeArgs {
    /// A leaf of a binary tree has at most so many points [default: 65000]
    #[arg(long, value_name = "POINTS", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Output: bintree")]
    pub(crate) capacity: Option<u32>,
    /// Where nodes are split; anything but the mean is for comparison [default: mean]
    #[arg(long, value_enum, value_name = "RULE", help_heading = "Output: bintree")]
    pub(crate) split: Option<SplitArg>,
    /// One file a leaf, or all leaves in one file [default: files]
    #[arg(long, value_enum, value_name = "LAYOUT", help_heading = "Output: bintree")]
    pub(crate) layout: Option<LayoutArg>,
}

/// Settings of quantised batches.
#[derive(Debug, ClapArgs)]
pub(crate) struct BatchesArgs {
    /// Side of the cells of the coarsest level of detail, in units of the CRS, or `auto`: from extent and density
    /// [default: 1]
    #[arg(long, value_name = "STEP|auto", value_parser = parse_scale, help_heading = "Output: batches")]
    pub(crate) lod_cell: Option<Scale>,
    /// Bits of a coordinate: 10, 20 or 30, or `auto`: what the step of the scans needs [default: auto]
    #[arg(long, value_name = "BITS", value_parser = parse_planes, help_heading = "Output: batches")]
    pub(crate) planes: Option<Planes>,
    /// Compresses the sections in blocks that decode on their own; they cannot be mapped then [default: none]
    #[arg(long, value_name = "zstd[:LEVEL]", value_parser = parse_compress, help_heading = "Output: batches")]
    pub(crate) compress: Option<i32>,
    /// Does not keep the colours that averaging replaces
    #[arg(long, help_heading = "Output: batches")]
    pub(crate) no_originals: bool,
}

/// Where the nodes of a binary tree are split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SplitArg {
    Mean,
    Median,
    Midpoint,
}

/// Where the leaves of a binary tree go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LayoutArg {
    Files,
    Packed,
}

/// The formats that pointmill knows of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TargetArg {
    /// Octree with levels of detail, for Potree and its relatives
    Potree2,
    #[value(hide = true)]
    Potree1,
    /// Mean-split binary tree with tight boxes: every point at every distance
    Bintree,
    /// Morton-sorted quantised batches with CLOD levels, for compute-shader renderers
    Batches,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EncodingArg {
    Default,
    Brotli,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SamplingArg {
    Poisson,
    Grid,
    Random,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DuplicatesArg {
    Keep,
    Drop,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FaultArg {
    Skip,
    Fail,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RgbDepthArg {
    Auto,
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}
