//! Options of `pointmill convert`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use pointmill_converter::{BatchesSettings, BintreeSettings, PositionPrecision, Potree2Settings};
use pointmill_format::Aabb;

use super::common::{InputArgs, TalkArgs};
use super::derive::DeriveArgs;
use super::values::{
    Attributes, CheckpointArg, Planes, Scale, ZSTD_LEVEL, or_auto, parse_attributes, parse_bounds, parse_bytes,
    parse_checkpoint, parse_class, parse_compress, parse_planes, parse_precision, parse_scale, parse_threads, whole,
};

/// The Brotli quality for node payloads; above 9 the time grows a hundred times for up to eight per cent.
pub(crate) const BROTLI_QUALITY: u8 = pointmill_converter::Encoding::BROTLI_QUALITY;

/// The seed of random sampling.
pub(crate) const SEED: u64 = 0;

#[derive(Debug, ClapArgs)]
pub(crate) struct ConvertArgs {
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
    /// Output folder
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,

    /// Output format; repeat --to to write several formats in one run, to OUT/potree2, OUT/bintree and so on
    #[arg(long, value_name = "FORMAT", default_value = "potree2", help_heading = "Output")]
    pub(crate) to: Vec<TargetArg>,
    /// Replaces OUT if it is a dataset; the old dataset is kept until the new one is complete
    #[arg(long, help_heading = "Output")]
    pub(crate) overwrite: bool,
    /// Adds the points of the inputs to those of OUT, a dataset that was made with the same options, and replaces it: the same bytes as
    /// converting all scans at once, if it holds all attributes and has the same --name. Of Potree 2.0 what the new points do not touch is
    /// copied, as long as root cube, step and spacing stay; all else is built anew
    #[arg(long, conflicts_with = "overwrite", help_heading = "Output")]
    pub(crate) append: bool,
    /// Name of the point cloud in the metadata [default: name of the first input]
    #[arg(long, value_name = "TEXT", help_heading = "Output")]
    pub(crate) name: Option<String>,
    /// Options by name: fast (least processor time), balanced (time, size and pictures weighed), exact (nothing lost that need not
    /// be); options that are given override them
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Output")]
    pub(crate) profile: Option<ProfileArg>,
    /// Takes the profile from a measurement of this scene: the folder that `measure` made
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    pub(crate) measured: Option<PathBuf>,
    /// Writes OUT.html beside OUT: a page that shows the dataset from any web server with ranges; not for copc, nor for what is
    /// compressed or archived, which `view` shows
    #[arg(long, help_heading = "Output")]
    pub(crate) page: bool,
    /// Encoding of node payloads [default: default]
    #[arg(long, value_enum, help_heading = "Output")]
    pub(crate) encoding: Option<EncodingArg>,
    #[arg(long, value_name = "N", value_parser = whole::<u8>(0..=11), allow_negative_numbers = true, help_heading = "Output",
          help = format!("Brotli quality, 0 (fast) to 11 (small), for --encoding brotli; 5 to 9 are one, by column [default: {BROTLI_QUALITY}]"))]
    pub(crate) brotli_quality: Option<u8>,
    /// How inner nodes select their points: poisson (maximal Poisson-disk sample), grid (the point nearest to the
    /// centre of each cell of a grid, by default of 128³ cells), or random (one pseudo-random point per cell)
    /// [default: poisson]
    #[arg(long, value_enum, help_heading = "Output")]
    pub(crate) sampling: Option<SamplingArg>,
    #[arg(long, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX), allow_negative_numbers = true,
          help_heading = "Output",
          help = format!("Seed for --sampling random; the same seed gives the same bytes [default: {SEED}]"))]
    pub(crate) seed: Option<u64>,
    /// Distance between points in the root, in units of the CRS; each level has half of the one above: 1/255 to 1/16 of
    /// the side of the root cube; auto takes what gives the root about 20,000 points, 1/148 to 1/200 of it [default: auto]
    #[arg(long, value_name = "STEP|auto", value_parser = parse_scale, allow_negative_numbers = true,
          help_heading = "Output")]
    pub(crate) spacing: Option<Scale>,
    #[arg(long, value_name = "POINTS", value_parser = whole::<u32>(1..=1_000_000), allow_negative_numbers = true,
          help_heading = "Output",
          help = format!("Maximum points per leaf node [default: {}]", Potree2Settings::default().leaf_capacity))]
    pub(crate) leaf_capacity: Option<u32>,
    /// 16-bit colour channels of 1 to 255, which viewers take for 8 bits and show too bright: keep them, or round them to 0
    /// or 256 [default: keep]
    #[arg(long, value_enum, help_heading = "Output")]
    pub(crate) dark_colours: Option<DarkColoursArg>,
    #[command(flatten)]
    pub(crate) potree1: Potree1Args,
    #[command(flatten)]
    pub(crate) bintree: BintreeArgs,
    #[command(flatten)]
    pub(crate) batches: BatchesArgs,
    /// Coordinate step in units of the CRS; auto uses the step of the scans, so that no coordinate changes, or, for
    /// scans without a step, one chosen from their extent and precision
    #[arg(long, value_name = "STEP", default_value = "auto", value_parser = parse_scale,
          allow_negative_numbers = true, help_heading = "Output")]
    pub(crate) scale: Scale,
    /// How exact positions must be: no coordinate of a written point differs from its scan by more than LENGTH (mm, cm, m,
    /// km, um, ft, us-ft; a number alone is in units of the CRS). The coarsest step and the fewest planes that keep it are
    /// chosen; not with --scale
    #[arg(long, value_name = "LENGTH", value_parser = parse_precision, allow_negative_numbers = true,
          help_heading = "Output")]
    pub(crate) precision: Option<PositionPrecision>,

    /// Attributes to write: all, scene (those that are not constant and do not follow from others; export gives the rest
    /// back), or a list such as intensity,rgb
    /// [default: all for potree2 and copc, colour for potree1 and batches, classification for bintree]
    #[arg(long, value_name = "all|scene|LIST", value_parser = parse_attributes, help_heading = "Selecting data")]
    pub(crate) attributes: Option<Attributes>,
    #[command(flatten)]
    pub(crate) derive: DeriveArgs,
    /// Keeps only points inside this box, in world coordinates
    #[arg(long, value_name = "X,Y,Z..X,Y,Z", value_parser = parse_bounds, allow_hyphen_values = true,
          help_heading = "Selecting data")]
    pub(crate) bounds: Option<Aabb>,
    /// Keeps only points of these classes, for example 2,6 [default: all]
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        value_parser = parse_class,
        allow_negative_numbers = true,
        help_heading = "Selecting data"
    )]
    pub(crate) class: Option<Vec<i64>>,
    /// Keeps every Nth point, by index in the file
    #[arg(long, value_name = "N", default_value = "1", value_parser = whole::<u64>(1..=u64::MAX),
          allow_negative_numbers = true, help_heading = "Selecting data")]
    pub(crate) every: u64,
    /// What to do with points whose position and attributes all repeat those of another point
    #[arg(long, value_enum, default_value = "keep", help_heading = "Selecting data")]
    pub(crate) duplicates: DuplicatesArg,
    /// What to do with points so far from all others that these lose precision: fail, drop (and count them), or keep
    #[arg(long, value_enum, default_value = "fail", help_heading = "Selecting data")]
    pub(crate) outliers: OutliersArg,
    /// What to do with points without a valid position
    #[arg(long, value_enum, default_value = "skip", help_heading = "Selecting data")]
    pub(crate) invalid: FaultArg,
    /// What to do with points exactly at the origin of their scan (where the scanner stood, by the pose of the scan; 0,0,0
    /// in files without poses): some scanners write them where they measured nothing
    #[arg(long, value_enum, default_value = "keep", help_heading = "Selecting data")]
    pub(crate) origin_points: OriginPointsArg,
    /// What to do with inputs, or parts of inputs, that cannot be decoded
    #[arg(long, value_enum, default_value = "fail", help_heading = "Selecting data")]
    pub(crate) unreadable: FaultArg,
    /// Depth of colour values: 8 (0–255), 16 (0–65535), or auto (detected from all values of a file)
    #[arg(long, value_enum, default_value = "auto", help_heading = "Selecting data")]
    pub(crate) rgb_depth: RgbDepthArg,

    /// Memory limit of the whole process, for example 2GiB [default: 60 % of the available memory]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) memory: Option<u64>,
    /// Number of worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = parse_threads, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) threads: Option<NonZero<u16>>,
    /// Folder for temporary files, used when the points do not fit in memory [default: beside OUT]
    #[arg(long, value_name = "DIR", help_heading = "Resources")]
    pub(crate) temp_dir: Option<PathBuf>,

    /// Validates what was made before it gets its name, and keeps none of it if anything is wrong (exit code 7): its promises
    /// (dataset), or these and every point against the scans, which are read again (scans)
    #[arg(long, value_enum, value_name = "WITH", num_args = 0..=1, require_equals = true, default_missing_value = "dataset",
          help_heading = "Output")]
    pub(crate) verify: Option<VerifyArg>,

    /// Goes on where a run with the same inputs and options was ended, if it has left OUT.job: what it has read and built is not
    /// read and built again
    #[arg(long, help_heading = "Resources")]
    pub(crate) resume: bool,
    /// Whether a run that is ended leaves OUT.job for --resume: never, always, or auto: if the points are not expected to fit into
    /// memory. A number of points: always, and what was read is safe each time that so many more are [default: auto]
    #[arg(long, value_name = "WHEN|POINTS", value_parser = parse_checkpoint, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) checkpoint: Option<CheckpointArg>,

    /// Writes a copy of the run report OUT/report.json to FILE
    #[arg(long, value_name = "FILE", help_heading = "Reporting")]
    pub(crate) report: Option<PathBuf>,
    /// Reports points, bounds, CRS, grid, memory and disk use, estimated from the headers; writes nothing
    #[arg(long, help_heading = "Reporting")]
    pub(crate) dry_run: bool,
    /// Prints the run report, or the estimate of --dry-run, as JSON on standard output
    #[arg(long, help_heading = "Reporting")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// What a new dataset is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum VerifyArg {
    /// What its format promises
    Dataset,
    /// That, and every point of the scans
    Scans,
}

impl VerifyArg {
    /// What there is to say once nothing wrong was found.
    pub(crate) const fn passed(self) -> &'static str {
        match self {
            Self::Dataset => "validated before it got its name: it keeps the promises of its format",
            Self::Scans => {
                "validated before it got its name: it keeps the promises of its format, and holds every point once"
            }
        }
    }
}

/// What a conversion is good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProfileArg {
    /// The least processor time
    Fast,
    /// Time, size and pictures weighed
    Balanced,
    /// Nothing lost that need not be
    Exact,
}

impl ProfileArg {
    /// As it is typed.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Exact => "exact",
        }
    }
}

/// Settings of an octree before Potree 2.0.
#[derive(Debug, ClapArgs)]
pub(crate) struct Potree1Args {
    /// Version of the octree: 1.7, which every client reads, holds colour, intensity, classification and normals; 1.8 any
    /// attribute, and Potree and BA_PointCloud alone read it [default: 1.7]
    #[arg(long, value_enum, value_name = "VERSION", help_heading = "Output: potree1")]
    pub(crate) potree1_version: Option<Potree1VersionArg>,
    /// Maximum points of any node, such as 65000, which one mesh of an engine holds; what is too much for an inner node goes to
    /// its children [default: none but for leaves]
    #[arg(long, value_name = "POINTS", value_parser = whole::<u32>(100..=u64::from(u32::MAX)),
          allow_negative_numbers = true, help_heading = "Output: potree1")]
    pub(crate) max_node_points: Option<u32>,
    /// Writes one uncompressed archive, potree1.zip, instead of a file for each node: millions of files take days to copy.
    /// Unpack it for viewers; info and validate read it as it is
    #[arg(long, help_heading = "Output: potree1")]
    pub(crate) archive: bool,
}

/// Settings of a mean-split binary tree.
#[derive(Debug, ClapArgs)]
pub(crate) struct BintreeArgs {
    #[arg(long, value_name = "POINTS", value_parser = whole::<u32>(1..=u64::from(u32::MAX)),
          allow_negative_numbers = true, help_heading = "Output: bintree",
          help = format!("Maximum points per leaf [default: {}]", BintreeSettings::default().capacity))]
    pub(crate) capacity: Option<u32>,
    #[arg(long, value_enum, value_name = "RULE", help_heading = "Output: bintree",
          help = format!("Where nodes are split; median and midpoint are for comparisons [default: {}]",
                         BintreeSettings::default().split.name()))]
    pub(crate) split: Option<SplitArg>,
    #[arg(long, value_enum, value_name = "LAYOUT", help_heading = "Output: bintree",
          help = format!("One file per leaf, or all leaves packed in one file [default: {}]",
                         BintreeSettings::default().layout.name()))]
    pub(crate) layout: Option<LayoutArg>,
}

/// Settings of quantised batches.
#[derive(Debug, ClapArgs)]
pub(crate) struct BatchesArgs {
    #[arg(long, value_name = "STEP|auto", value_parser = parse_scale, allow_negative_numbers = true,
          help_heading = "Output: batches",
          help = format!("Cell size of the coarsest level of detail, in units of the CRS; auto derives it from extent \
                          and density [default: {}]", or_auto(BatchesSettings::default().lod_cell)))]
    pub(crate) lod_cell: Option<Scale>,
    #[arg(long, value_name = "BITS", value_parser = parse_planes, help_heading = "Output: batches",
          help = format!("Bits per coordinate: 10, 20 or 30; auto uses as many as the step of the scans needs \
                          [default: {}]", or_auto(BatchesSettings::default().planes.map(|p| 10 * p))))]
    pub(crate) planes: Option<Planes>,
    #[arg(long, value_name = "zstd[:LEVEL]", value_parser = parse_compress, help_heading = "Output: batches",
          help = format!("Compresses the sections in independent blocks; LEVEL is 1 to 19 (default {ZSTD_LEVEL}); a \
                          compressed file cannot be memory-mapped [default: not compressed]"))]
    pub(crate) compress: Option<i32>,
    /// Discards the original colours of points whose colour is replaced by an average
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

/// The output formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TargetArg {
    /// Octree with levels of detail, for Potree and compatible viewers
    Potree2,
    /// The octree before Potree 2.0, a file per node: for engines, three-loader and installations that read nothing newer
    Potree1,
    /// The octree as one LAZ file with a hierarchy: for QGIS, PDAL, deck.gl and maps in browsers
    Copc,
    /// Mean-split binary tree with tight boxes, which draws every point at every distance
    Bintree,
    /// Morton-sorted quantised batches with continuous levels of detail, for compute-shader renderers
    Batches,
}

impl TargetArg {
    /// The value of `--to`.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Potree2 => "potree2",
            Self::Potree1 => "potree1",
            Self::Copc => "copc",
            Self::Bintree => "bintree",
            Self::Batches => "batches",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Potree1VersionArg {
    #[value(name = "1.7")]
    V1_7,
    #[value(name = "1.8")]
    V1_8,
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
pub(crate) enum OriginPointsArg {
    Keep,
    Skip,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OutliersArg {
    Keep,
    Drop,
    Fail,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FaultArg {
    Skip,
    Fail,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DarkColoursArg {
    Keep,
    Round,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RgbDepthArg {
    Auto,
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}
