//! The command-line options. Values are parsed here and checked against each other in the commands.

mod common;
mod convert;
mod depth;
mod derive;
mod examples;
mod export;
mod job;
mod manual;
mod measure;
pub(crate) mod mistake;
mod placing;
mod preview;
mod values;
mod view;

use std::num::NonZero;
use std::path::PathBuf;

use clap::{Args as ClapArgs, Parser, Subcommand};

pub(crate) use common::{InputArgs, ProgressArg, ReadingArgs, TalkArgs};
pub(crate) use convert::{
    BROTLI_QUALITY, BatchesArgs, BintreeArgs, ConvertArgs, DarkColoursArg, DuplicatesArg, EncodingArg, FaultArg,
    LayoutArg, OriginPointsArg, OutliersArg, Potree1VersionArg, ProfileArg, RgbDepthArg, SEED, SamplingArg, SplitArg,
    TargetArg, VerifyArg,
};
pub(crate) use export::ExportArgs;
pub(crate) use job::{JobArgs, JobCommand, JobFinishArgs, JobPlanArgs, JobResources, JobRunArgs, JobUnitsArgs, Share};
pub(crate) use manual::{CompletionsArgs, ManArgs};
pub(crate) use measure::{BUDGET, MeasureArgs, SAMPLE};
pub(crate) use preview::PreviewArgs;
use values::parse_bytes;
pub(crate) use values::{Attributes, CheckpointArg};
pub(crate) use view::ViewArgs;

/// Converts laser scans to datasets that renderers stream, without losing a point.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110, arg_required_else_help = true)]
#[command(
    after_help = "Exit codes: 0 success · 1 internal error · 2 usage error · 3 broken input · 4 not supported · \
    5 I/O error or disk full · 6 memory limit too small · 7 validation found errors · 130 interrupted"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Converts scans to a dataset
    #[command(after_help = examples::CONVERT)]
    Convert(Box<ConvertArgs>),
    /// Converts in units that several processes do, on one machine or on many
    #[command(after_help = examples::JOB)]
    Job(JobArgs),
    /// Writes the points of scans and datasets to one file: LAS, LAZ, PLY or CSV
    #[command(after_help = examples::EXPORT)]
    Export(Box<ExportArgs>),
    /// Measures what settings of convert cost and buy on a scene: speed, size, errors of positions, colours and pictures
    #[command(after_help = examples::MEASURE)]
    Measure(Box<MeasureArgs>),
    /// Checks whether a dataset conforms to its format and matches its scans
    #[command(after_help = examples::VALIDATE)]
    Validate(ValidateArgs),
    /// Writes the images within an E57 file, and the places of its scans and images as a table
    #[command(after_help = examples::EXTRACT)]
    Extract(ExtractArgs),
    /// Describes scans and datasets, from their headers unless --deep is given
    #[command(after_help = examples::INFO)]
    Info(InfoArgs),
    /// Draws a picture of a dataset or of scans
    #[command(after_help = examples::PREVIEW)]
    Preview(Box<PreviewArgs>),
    /// Shows datasets or scans in the browser, served from this machine
    #[command(after_help = examples::VIEW)]
    View(Box<ViewArgs>),
    /// Prints what a shell needs to complete commands, options and values
    #[command(after_help = examples::COMPLETIONS)]
    Completions(CompletionsArgs),
    /// Writes manual pages
    #[command(after_help = examples::MAN)]
    Man(ManArgs),
}

impl Command {
    /// As it is typed behind the name of the program.
    pub(crate) const fn name(&self) -> &'static str {
        match self {
            Self::Convert(_) => "convert",
            Self::Job(job) => match &job.command {
                JobCommand::Plan(_) => "job plan",
                JobCommand::Units(_) => "job units",
                JobCommand::Run(_) => "job run",
                JobCommand::Finish(_) => "job finish",
                JobCommand::Status(_) => "job status",
            },
            Self::Export(_) => "export",
            Self::Measure(_) => "measure",
            Self::Validate(_) => "validate",
            Self::Extract(_) => "extract",
            Self::Info(_) => "info",
            Self::Preview(_) => "preview",
            Self::View(_) => "view",
            Self::Completions(_) => "completions",
            Self::Man(_) => "man",
        }
    }
}

#[derive(Debug, ClapArgs)]
pub(crate) struct ValidateArgs {
    /// Folder of a dataset, or a .qbatch or COPC file; the format is detected from the content
    pub(crate) dataset: PathBuf,
    /// Checks that the dataset holds every point of these scans exactly once: files, folders or globs
    #[arg(long, value_name = "INPUT", num_args = 1..)]
    pub(crate) against: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    /// Skips spacing, coverage and quality figures, which take most of the time
    #[arg(long)]
    pub(crate) fast: bool,
    /// Memory limit of the whole process, for example 2GiB [default: 60 % of the available memory]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub(crate) memory: Option<u64>,
    /// Number of worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = values::parse_threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<NonZero<u16>>,
    /// Prints one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct ExtractArgs {
    /// The file: E57, or PTX, which has places of scans but no images
    #[arg(value_name = "SCAN")]
    pub(crate) file: PathBuf,
    /// Folder for the images and poses.csv; it is made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Replaces files of the same names in DIR; others are left alone
    #[arg(long)]
    pub(crate) overwrite: bool,
    /// Takes only this scan and its images: its exact name, or its number, from 1; repeat it for more scans
    #[arg(long = "scan", value_name = "NAME|N", value_parser = clap::builder::NonEmptyStringValueParser::new())]
    pub(crate) scans: Vec<String>,
    /// What becomes of an image whose bytes cannot be read
    #[arg(long, value_enum, value_name = "POLICY", default_value = "fail")]
    pub(crate) unreadable: FaultArg,
    /// Reports errors only
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct InfoArgs {
    /// Scans, folders of scans, globs, or datasets of any format
    #[arg(required = true, value_name = "PATH")]
    pub(crate) paths: Vec<PathBuf>,
    /// Decodes every point to report the true count, bounds and range of each attribute
    #[arg(long)]
    pub(crate) deep: bool,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    /// Prints a JSON array on standard output, one object per scan or dataset
    #[arg(long)]
    pub(crate) json: bool,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;
    use pointmill_converter::{BatchesSettings, BintreeSettings};

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
    fn the_help_states_the_defaults_that_the_code_uses() {
        let mut command = Args::command();
        let help = command.find_subcommand_mut("convert").unwrap().render_long_help().to_string();
        let (tree, batches) = (BintreeSettings::default(), BatchesSettings::default());
        let table = [
            ("--brotli-quality", BROTLI_QUALITY.to_string()),
            ("--seed", SEED.to_string()),
            ("--capacity", tree.capacity.to_string()),
            ("--split", tree.split.name().to_owned()),
            ("--layout", tree.layout.name().to_owned()),
            ("--lod-cell", "auto".to_owned()),
            ("--planes", "auto".to_owned()),
        ];
        assert_eq!((batches.planes, batches.lod_cell), (None, None));
        for (option, default) in table {
            let text = help.split(&format!("      {option} <")).nth(1).unwrap().split("\n      -").next().unwrap();
            let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(words.contains(&format!("[default: {default}]")), "{option}: {words}");
        }
    }

    #[test]
    fn values_arrive_as_meant() {
        let args =
            convert(&["--class", "2,6", "--bounds", "-1,-2,-3..1,2,3", "--attributes", "rgb, intensity"]).unwrap();
        assert_eq!(args.class, Some(vec![2, 6]));
        assert_eq!(convert(&["--class", "-1"]).unwrap().class, Some(vec![-1]));
        assert_eq!(convert(&["--class=-1,300"]).unwrap().class, Some(vec![-1, 300]));
        assert_eq!(args.bounds.unwrap().min, [-1.0, -2.0, -3.0]);
        assert_eq!(args.attributes, Some(Attributes::List(vec!["rgb".into(), "intensity".into()])));
        assert_eq!(args.scale, Scale(None));
    }

    #[test]
    fn nonsense_is_refused() {
        let table: [&[&str]; 10] = [
            &["--class", "2.5"],
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
