//! What several commands take: inputs, how they are read, and how much is told.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use pointmill_format::OpenOptions;

use super::values::parse_separator;
use crate::exit::Failure;

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
            pointmill_format::scan::text::check_columns(columns)
                .map_err(|e| Failure::Usage(format!("--columns: {e}")))?;
        }
        let Self { columns, separator, row_column } = self;
        Ok(OpenOptions { columns: columns.clone(), separator: *separator, keep_row_column: *row_column })
    }
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

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressArg {
    Auto,
    Bar,
    Json,
    None,
}
