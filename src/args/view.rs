//! Options of `pointmill view`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::common::{InputArgs, TalkArgs};
use super::values::{parse_bytes, parse_threads, whole};

#[derive(Debug, ClapArgs)]
pub(crate) struct ViewArgs {
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
    /// Prints the address and does not open the browser
    #[arg(long, help_heading = "Server")]
    pub(crate) no_open: bool,
    /// Port on 127.0.0.1 [default: any that is free]
    #[arg(long, value_name = "N", value_parser = whole::<u16>(1..=65535), allow_negative_numbers = true,
          help_heading = "Server")]
    pub(crate) port: Option<u16>,

    /// Keeps the dataset that is made of scans, beside them, as SCAN.pointmill; a later --keep uses it again unless a scan is
    /// newer. Without --keep it is temporary
    #[arg(long, help_heading = "Scans")]
    pub(crate) keep: bool,
    /// Folder for the temporary dataset, of about the size of the scans uncompressed [default: the system's]
    #[arg(long, value_name = "DIR", conflicts_with = "keep", help_heading = "Scans")]
    pub(crate) temp_dir: Option<PathBuf>,

    /// Memory limit of the conversion of scans, for example 2GiB [default: 60 % of the available memory]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) memory: Option<u64>,
    /// Number of worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = parse_threads, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) threads: Option<NonZero<u16>>,

    /// Prints one JSON object on standard output: the address and the datasets
    #[arg(long, help_heading = "Reporting")]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}
