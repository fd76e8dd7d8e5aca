//! Options of several commands: inputs, how scans are read, and reporting.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use pointmill_format::{Decimal, OpenOptions};

use super::depth::DepthArgs;
use super::placing::PlacingArgs;
use super::values::parse_separator;
use crate::exit::Failure;

/// The scans to convert.
#[derive(Debug, Default, ClapArgs)]
pub(crate) struct InputArgs {
    /// Scans (LAS, LAZ, E57, PLY, PCD, XYZ, CSV, PTS, PTX, OFF, OBJ, depth maps) and datasets: files, folders (searched recursively) or globs
    #[arg(value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// Reads more inputs from the file LIST, one per line (- for standard input); skips empty lines and lines that
    /// start with #
    #[arg(long, value_name = "LIST")]
    pub(crate) files_from: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
}

/// Facts about scans that their files do not state, and where their points belong.
#[derive(Debug, Default, ClapArgs)]
pub(crate) struct ReadingArgs {
    /// Columns of text scans in file order, for example x,y,z,r,g,b,i. Names: x y z, r g b, i (intensity),
    /// c (classification), nx ny nz; - skips a column; any other name becomes an attribute, with an optional type as in
    /// quality:uint8 [default: detected]
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "Reading scans"
    )]
    pub(crate) columns: Option<Vec<String>>,
    /// Field separator of text scans: one character, or tab, space, comma, semicolon [default: detected]
    #[arg(long, value_name = "CHAR", value_parser = parse_separator, help_heading = "Reading scans")]
    pub(crate) separator: Option<char>,
    /// Decimal mark of text scans; auto looks at a sample of the rows, and fails where it cannot tell
    #[arg(long, value_enum, default_value = "auto", value_name = "MARK", help_heading = "Reading scans")]
    pub(crate) decimal: DecimalArg,
    /// Reads only this scan within the files (E57, PTX, folders of depth maps): its exact name, or its number in the file, from 1; repeat it for
    /// more scans. Other kinds of files are read whole [default: all scans]
    #[arg(
        long = "scan",
        value_name = "NAME|N",
        value_parser = clap::builder::NonEmptyStringValueParser::new(),
        help_heading = "Reading scans"
    )]
    pub(crate) scans: Vec<String>,
    /// Keeps rowIndex and columnIndex of E57 scans as attributes
    #[arg(long, help_heading = "Reading scans")]
    pub(crate) row_column: bool,
    #[command(flatten)]
    pub(crate) depth: DepthArgs,
    #[command(flatten)]
    pub(crate) placing: PlacingArgs,
}

impl ReadingArgs {
    /// Where no scan is read, an option about reading scans is a mistake.
    pub(crate) fn refuse_without_scans(&self) -> Result<(), Failure> {
        match self.given() {
            Some(option) => Err(Failure::Usage(format!("{option} requires --against"))),
            None => Ok(()),
        }
    }

    /// The first option about reading scans that was given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let placing = &self.placing;
        let given = [
            ("--columns", self.columns.is_some()),
            ("--separator", self.separator.is_some()),
            ("--decimal", self.decimal != DecimalArg::Auto),
            ("--scan", !self.scans.is_empty()),
            ("--row-column", self.row_column),
            ("--crs", placing.crs.is_some()),
            ("--units", placing.units.is_some()),
            ("--axes", placing.axes.is_some()),
            ("--transform", placing.transform.is_some()),
            ("--reproject", placing.reproject.is_some()),
        ];
        let given = given.into_iter().chain(self.depth.given());
        given.filter(|(_, is_given)| *is_given).map(|(option, _)| option).next()
    }

    /// The options for the readers; invalid columns are reported before any file is opened.
    pub(crate) fn options(&self) -> Result<OpenOptions, Failure> {
        if let Some(columns) = &self.columns {
            pointmill_format::scan::text::check_columns(columns)
                .map_err(|e| Failure::Usage(format!("--columns: {e}")))?;
        }
        let mut options = OpenOptions::default().keep_row_column(self.row_column);
        (options.columns, options.separator) = (self.columns.clone(), self.separator);
        options.decimal = self.decimal.into();
        options.depth = self.depth.options()?;
        options.scans = (!self.scans.is_empty()).then(|| self.scans.clone());
        if let Some(placing) = self.placing.placing()? {
            options = options.maps(placing);
        }
        Ok(options)
    }
}

/// What stands before the decimals of a number.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum DecimalArg {
    #[default]
    Auto,
    Point,
    Comma,
}

impl From<DecimalArg> for Decimal {
    fn from(arg: DecimalArg) -> Self {
        match arg {
            DecimalArg::Auto => Self::Auto,
            DecimalArg::Point => Self::Point,
            DecimalArg::Comma => Self::Comma,
        }
    }
}

/// How much is reported while a command runs.
#[derive(Debug, ClapArgs)]
pub(crate) struct TalkArgs {
    /// Progress on standard error: a bar, or one JSON object per line; auto shows a bar on a terminal
    #[arg(long, value_enum, default_value = "auto", help_heading = "Reporting")]
    pub(crate) progress: ProgressArg,
    /// Reports every phase, level and input
    #[arg(short, long, conflicts_with = "quiet", help_heading = "Reporting")]
    pub(crate) verbose: bool,
    /// Reports errors only
    #[arg(short, long, help_heading = "Reporting")]
    pub(crate) quiet: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressArg {
    Auto,
    Bar,
    Json,
    None,
}
