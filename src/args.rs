//! What can be typed. Values are parsed here and judged in the commands.

use std::num::NonZero;
use std::path::PathBuf;

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use pointmill_format::{Aabb, OpenOptions};

use crate::exit::Failure;
use crate::quantities::{parse_bounds, parse_bytes};

/// Turns raw scans into data that renderers stream, without losing a point.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110, arg_required_else_help = true)]
#[command(after_help = "Exit codes: 0 done · 1 a fault of ours · 2 usage · 3 an input is broken · 4 not supported · \
    5 disk full or I/O · 6 memory ceiling too small · 7 validation found faults · 130 interrupted")]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Converts scans to a dataset that a renderer can stream
    Convert(Box<ConvertArgs>),
    /// Checks whether a dataset keeps the promises of its format
    Validate(ValidateArgs),
    /// Says what a scan or a dataset is; decodes nothing that need not be
    Info(InfoArgs),
}

/// Where points come from.
#[derive(Debug, Default, ClapArgs)]
pub(crate) struct InputArgs {
    /// Scans (LAS, LAZ, E57, PLY, PCD, XYZ, CSV, PTS, PTX, OFF): files, folders (searched recursively) or globs
    #[arg(value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Reads more inputs from LIST, one a line; empty lines and lines that begin with # are skipped
    #[arg(long, value_name = "LIST")]
    pub(crate) files_from: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// What files do not say of themselves.
#[derive(Debug, Default, ClapArgs)]
pub(crate) struct ReadingArgs {
    /// Columns of text scans in file order, as in x,y,z,r,g,b,i: x y z, r g b, i (intensity), c (classification), nx ny
    /// nz; - leaves one out, any other name makes an attribute, its type after a colon [default: found out]
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "How scans are read"
    )]
    pub(crate) columns: Option<Vec<String>>,
    /// What stands between the fields of text scans: one character, or tab, space, comma, semicolon [default: found out]
    #[arg(long, value_name = "CHAR", value_parser = parse_separator, help_heading = "How scans are read")]
    pub(crate) separator: Option<char>,
    /// Keeps rowIndex and columnIndex of E57 scans as attributes
    #[arg(long, help_heading = "How scans are read")]
    pub(crate) row_column: bool,
}

impl ReadingArgs {
    /// For the readers; columns that cannot be are told before any file is opened.
    pub(crate) fn options(&self) -> Result<OpenOptions, Failure> {
        if let Some(columns) = &self.columns {
            pointmill_format::text::check_columns(columns).map_err(|e| Failure::Usage(format!("--columns: {e}")))?;
        }
        let Self { columns, separator, row_column } = self;
        Ok(OpenOptions { columns: columns.clone(), separator: *separator, keep_row_column: *row_column })
    }
}

fn parse_separator(text: &str) -> Result<char, String> {
    match text {
        "tab" | "\\t" => Ok('\t'),
        "space" | "blank" => Ok(' '),
        "comma" => Ok(','),
        "semicolon" => Ok(';'),
        _ => {
            let mut chars = text.chars();
            chars.next().filter(|_| chars.next().is_none()).ok_or_else(|| "one character is expected".to_owned())
        }
    }
}

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

/// Planes of ten bits, or as many as are needed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Planes(pub(crate) Option<u8>);

fn parse_planes(text: &str) -> Result<Planes, String> {
    match text {
        "auto" => Ok(Planes(None)),
        "10" => Ok(Planes(Some(1))),
        "20" => Ok(Planes(Some(2))),
        "30" => Ok(Planes(Some(3))),
        _ => Err("10, 20, 30 or auto is expected".to_owned()),
    }
}

/// Zstandard's own default.
const ZSTD_LEVEL: i32 = 3;

fn parse_compress(text: &str) -> Result<i32, String> {
    match text.split_once(':').unwrap_or((text, "")) {
        ("zstd", "") => Ok(ZSTD_LEVEL),
        ("zstd", level) => level.parse().ok().filter(|l| (1..=19).contains(l)).ok_or("levels are 1 to 19".to_owned()),
        _ => Err("zstd or zstd:LEVEL is expected".to_owned()),
    }
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

/// How much is told while the program works.
#[derive(Debug, ClapArgs)]
pub(crate) struct TalkArgs {
    /// A bar, or one JSON object a line, on standard error; `auto`: a bar on a terminal
    #[arg(long, value_enum, default_value = "auto", help_heading = "What is told")]
    pub(crate) progress: ProgressArg,
    /// Tells more: phases, levels and inputs one by one
    #[arg(short, long, conflicts_with = "quiet", help_heading = "What is told")]
    pub(crate) verbose: bool,
    /// Tells nothing but errors
    #[arg(short, long, help_heading = "What is told")]
    pub(crate) quiet: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct ValidateArgs {
    /// Folder of a dataset of any format, or a .qbatch file; its content tells which
    pub(crate) dataset: PathBuf,
    /// Proves that every point of these scans is in the dataset exactly once: files, folders or globs
    #[arg(long, value_name = "INPUT", num_args = 1..)]
    pub(crate) against: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    /// Leaves out spacing, coverage and quality figures, which take most of the time
    #[arg(long)]
    pub(crate) fast: bool,
    /// Worker threads [default: all cores]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZero<u16>>,
    /// Prints one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct InfoArgs {
    /// Scans, folders of scans, globs, or Potree 2.0 datasets
    #[arg(required = true, value_name = "PATH")]
    pub(crate) paths: Vec<PathBuf>,
    /// Decodes every point: counts them and measures bounds and the range of each attribute
    #[arg(long)]
    pub(crate) deep: bool,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    /// Prints one JSON array on standard output, an object for each scan or dataset
    #[arg(long)]
    pub(crate) json: bool,
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

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressArg {
    Auto,
    Bar,
    Json,
    None,
}

/// `--scale`, parsed; `None` is `auto`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale(pub(crate) Option<f64>);

fn parse_scale(text: &str) -> Result<Scale, String> {
    match (text, text.parse::<f64>()) {
        ("auto", _) => Ok(Scale(None)),
        (_, Ok(step)) if step.is_finite() && step > 0.0 => Ok(Scale(Some(step))),
        _ => Err("write a number above 0, as in 0.001, or auto".to_owned()),
    }
}

/// `--attributes`, parsed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Attributes {
    All,
    Scene,
    List(Vec<String>),
}

fn parse_attributes(text: &str) -> Result<Attributes, String> {
    let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
    match text {
        "all" => Ok(Attributes::All),
        "scene" => Ok(Attributes::Scene),
        _ if names.iter().any(String::is_empty) => Err("an attribute name is empty".to_owned()),
        _ => Ok(Attributes::List(names)),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    fn convert(extra: &[&str]) -> Result<Box<ConvertArgs>, clap::Error> {
        let args = ["pointmill", "convert", "a.las", "-o", "out"].iter().chain(extra);
        Args::try_parse_from(args).map(|args| match args.command {
            Command::Convert(convert) => convert,
            other => panic!("{other:?}"),
        })
    }

    #[test]
    fn the_definition_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn values_arrive_as_meant() {
        let args =
            convert(&["--class", "2,6", "--bounds", "-1,-2,-3..1,2,3", "--attributes", "rgb, intensity"]).unwrap();
        assert_eq!(args.class, Some(vec![2, 6]));
        assert_eq!(args.bounds.unwrap().min, [-1.0, -2.0, -3.0]);
        assert_eq!(args.attributes, Some(Attributes::List(vec!["rgb".into(), "intensity".into()])));
        assert_eq!(args.scale, Scale(None));
    }

    #[test]
    fn nonsense_is_refused() {
        let table: [&[&str]; 10] = [
            &["--class", "256"],
            &["--every", "0"],
            &["--threads", "0"],
            &["--memory", "lots"],
            &["--scale", "0"],
            &["--leaf-capacity", "0"],
            &["--brotli-quality", "12"],
            &["--attributes", "rgb,,intensity"],
            &["--to", "obj"],
            &["-v", "-q"],
        ];
        for extra in table {
            assert!(convert(extra).is_err(), "{extra:?}");
        }
    }
}
