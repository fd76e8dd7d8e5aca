//! Options of `pointmill measure`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::Args as ClapArgs;
use pointmill_measure::Axes;
use pointmill_render::Size;

use super::common::TalkArgs;
use super::values::{parse_bytes, parse_points, parse_size, parse_threads};

/// Scenes up to this size are measured in whole.
pub(crate) const SAMPLE: u64 = 20_000_000;

/// Points that viewers draw at once unless they are told otherwise.
pub(crate) const BUDGET: u64 = 1_000_000;

#[derive(Debug, ClapArgs)]
pub(crate) struct MeasureArgs {
    /// Scans (LAS, LAZ, E57, PLY, PCD, XYZ, CSV, PTS, PTX, OFF, OBJ) and datasets: files, folders (searched recursively) or globs; of
    /// scans that need options to be read, make LAS with `export` first
    #[arg(value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Reads more inputs from the file LIST, one per line (- for standard input); skips empty lines and lines that
    /// start with #
    #[arg(long, value_name = "LIST")]
    pub(crate) files_from: Option<PathBuf>,
    /// Folder for measure.json, measure.csv and report.html
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Replaces the files of an earlier measurement in OUT
    #[arg(long, help_heading = "Output")]
    pub(crate) overwrite: bool,

    /// The settings to measure: axes separated by commas, each with values where the usual ones will not do, as in
    /// output=potree2+batches,sampling,scale=0.001+0.01. Axes: output, sampling, encoding, planes, scale, precision,
    /// attributes, averaging, leaf-capacity [default: output,sampling,encoding,planes,averaging]
    #[arg(long, value_name = "LIST", value_parser = Axes::parse, help_heading = "Measuring")]
    pub(crate) axes: Option<Axes>,
    #[arg(long, value_name = "POINTS", value_parser = parse_points, help_heading = "Measuring",
          help = format!("Measures about so many points of larger scenes: whole columns of ground, evenly spread; 5M is five \
                          million [default: {}M]", SAMPLE / 1_000_000))]
    pub(crate) sample: Option<u64>,
    #[arg(long, value_name = "POINTS", value_parser = parse_points, help_heading = "Measuring",
          help = format!("Points that a renderer may draw at once [default: {}M]", BUDGET / 1_000_000))]
    pub(crate) budget: Option<u64>,
    /// Size of the pictures that are compared
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "800x600", help_heading = "Measuring")]
    pub(crate) size: Size,

    /// Memory limit of each conversion, for example 2GiB [default: 60 % of the available memory]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) memory: Option<u64>,
    /// Number of worker threads of each conversion [default: all cores]
    #[arg(long, value_name = "N", value_parser = parse_threads, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) threads: Option<NonZero<u16>>,
    /// Folder for the datasets until they are measured [default: in OUT]
    #[arg(long, value_name = "DIR", help_heading = "Resources")]
    pub(crate) temp_dir: Option<PathBuf>,

    /// Prints the contents of measure.json on standard output
    #[arg(long, help_heading = "Reporting")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}
