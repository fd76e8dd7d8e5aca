//! Options of `pointmill export`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::Args as ClapArgs;
use pointmill_format::Aabb;

use super::common::{InputArgs, TalkArgs};
use super::convert::FaultArg;
use super::values::{
    Attributes, Scale, parse_attributes, parse_bounds, parse_bytes, parse_class, parse_scale, parse_spacing,
    parse_threads, whole,
};

#[derive(Debug, ClapArgs)]
pub(crate) struct ExportArgs {
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
    /// The file to write; its ending is the format: .las, .laz, .ply (binary) or .csv
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,

    /// Replaces FILE if it is there; the old file is kept until the new one is complete
    #[arg(long, help_heading = "Output")]
    pub(crate) overwrite: bool,
    /// Coordinate step of LAS and LAZ in units of the CRS; auto uses the step of the inputs, so that no coordinate changes,
    /// or, for inputs without a step, one chosen from their extent and precision
    #[arg(long, value_name = "STEP", default_value = "auto", value_parser = parse_scale,
          allow_negative_numbers = true, help_heading = "Output")]
    pub(crate) scale: Scale,

    /// Attributes to write: all, or a list such as intensity,rgb
    #[arg(long, value_name = "all|LIST", default_value = "all", value_parser = parse_attributes,
          help_heading = "Selecting data")]
    pub(crate) attributes: Attributes,
    /// Reads an octree down to this level alone, 0 for its root: the cloud thinned
    #[arg(long, value_name = "N", value_parser = whole::<u8>(0..=u64::from(u8::MAX)), allow_negative_numbers = true,
          help_heading = "Selecting data")]
    pub(crate) level: Option<u8>,
    /// Reads an octree down to the last level whose points are at least this far apart, in units of the CRS: the cloud thinned
    #[arg(long, value_name = "STEP", value_parser = parse_spacing, allow_negative_numbers = true,
          help_heading = "Selecting data")]
    pub(crate) spacing: Option<f64>,
    /// Keeps only points inside this box, in world coordinates; repeat it for points in any of several boxes
    #[arg(long, value_name = "X,Y,Z..X,Y,Z", value_parser = parse_bounds, allow_hyphen_values = true,
          help_heading = "Selecting data")]
    pub(crate) bounds: Vec<Aabb>,
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
    /// What to do with inputs, or parts of inputs, that cannot be decoded
    #[arg(long, value_enum, default_value = "fail", help_heading = "Selecting data")]
    pub(crate) unreadable: FaultArg,

    /// Memory limit of the whole process, for example 2GiB [default: 60 % of the available memory]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) memory: Option<u64>,
    /// Number of worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = parse_threads, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) threads: Option<NonZero<u16>>,

    /// Writes an account of the run to FILE: points by cause, attributes, positions
    #[arg(long, value_name = "FILE", help_heading = "Reporting")]
    pub(crate) report: Option<PathBuf>,
    /// Prints the account of the run as JSON on standard output
    #[arg(long, help_heading = "Reporting")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}
