//! What can be typed. Values are parsed here and judged in the commands.

mod common;
mod convert;
mod values;

use std::num::NonZero;
use std::path::PathBuf;

use clap::{Args as ClapArgs, Parser, Subcommand};

pub(crate) use common::{InputArgs, ProgressArg, ReadingArgs, TalkArgs};
pub(crate) use convert::{
    BatchesArgs, BintreeArgs, ConvertArgs, DuplicatesArg, EncodingArg, FaultArg, LayoutArg, RgbDepthArg, SamplingArg,
    SplitArg, TargetArg,
};
pub(crate) use values::Attributes;

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

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::values::Scale;
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
