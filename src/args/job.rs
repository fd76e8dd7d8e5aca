//! Options of `pointmill job`.

use std::num::NonZero;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args as ClapArgs, Subcommand};
use pointmill_converter::UnitName;

use super::common::TalkArgs;
use super::convert::ConvertArgs;
use super::values::{parse_bytes, parse_threads};

#[derive(Debug, ClapArgs)]
#[command(subcommand_required = true, arg_required_else_help = true)]
pub(crate) struct JobArgs {
    #[command(subcommand)]
    pub(crate) command: JobCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum JobCommand {
    /// Begins a conversion that several processes do together: takes the options of convert, reads headers alone; --checkpoint
    /// POINTS is the size of a unit of reading
    Plan(Box<JobPlanArgs>),
    /// Prints the units that are known: names of those that are ready, or all as JSON
    Units(JobUnitsArgs),
    /// Does units
    Run(JobRunArgs),
    /// Puts the results of all units together; the output then has its name, and the job is gone
    Finish(JobFinishArgs),
    /// Prints how far a job is
    Status(JobUnitsArgs),
}

#[derive(Debug, ClapArgs)]
pub(crate) struct JobPlanArgs {
    /// Folder of the job, which all processes see under this path; it is made
    #[arg(long, value_name = "DIR", help_heading = "Job")]
    pub(crate) job: PathBuf,
    #[command(flatten)]
    pub(crate) convert: ConvertArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct JobUnitsArgs {
    /// Folder of the job
    #[arg(value_name = "DIR")]
    pub(crate) job: PathBuf,
    /// Prints one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct JobRunArgs {
    /// Folder of the job
    #[arg(value_name = "DIR")]
    pub(crate) job: PathBuf,
    /// Units to do, by name
    #[arg(value_name = "UNIT", value_parser = parse_unit, conflicts_with = "share", required_unless_present = "share")]
    pub(crate) units: Vec<UnitName>,
    /// Does the I-th of N shares of all units, from now to the end of the job, and waits for what other shares do: one process for
    /// each share, as in an array of Slurm
    #[arg(long, value_name = "I/N")]
    pub(crate) share: Option<Share>,
    /// After so many seconds without news of any unit, a share does those of others, which may have died or never begun
    #[arg(long, value_name = "SECONDS", default_value_t = 600, requires = "share")]
    pub(crate) patience: u64,
    #[command(flatten)]
    pub(crate) resources: JobResources,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

#[derive(Debug, ClapArgs)]
pub(crate) struct JobFinishArgs {
    /// Folder of the job
    #[arg(value_name = "DIR")]
    pub(crate) job: PathBuf,
    #[command(flatten)]
    pub(crate) resources: JobResources,
    /// Prints the report as one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// What a process may use; what is not given is as it was planned.
#[derive(Debug, ClapArgs)]
pub(crate) struct JobResources {
    /// Memory limit of this process; what it was planned with must fit
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub(crate) memory: Option<u64>,
    /// Number of worker threads of this process
    #[arg(long, value_name = "N", value_parser = parse_threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<NonZero<u16>>,
    /// Folder for temporary files of this process [default: the folder of the job]
    #[arg(long, value_name = "DIR")]
    pub(crate) temp_dir: Option<PathBuf>,
}

/// One of several shares.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Share {
    /// From 0 on.
    pub(crate) index: u64,
    pub(crate) of: u64,
}

impl FromStr for Share {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "expected I/N, with I from 1 to N, such as 3/16".to_owned();
        let (index, of) = text.split_once('/').ok_or_else(wrong)?;
        let (index, of): (u64, u64) = (index.parse().map_err(|_| wrong())?, of.parse().map_err(|_| wrong())?);
        if (1..=of).contains(&index) { Ok(Self { index: index - 1, of }) } else { Err(wrong()) }
    }
}

fn parse_unit(text: &str) -> Result<UnitName, String> {
    text.parse().map_err(|()| "expected a name that 'pointmill job units' prints, such as read-1-0".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_counted_from_one() {
        assert_eq!("1/1".parse(), Ok(Share { index: 0, of: 1 }));
        assert_eq!("3/16".parse(), Ok(Share { index: 2, of: 16 }));
        for text in ["", "3", "0/4", "5/4", "1/0", "-1/4", "1/4/2", "a/b"] {
            assert!(text.parse::<Share>().is_err(), "{text}");
        }
    }
}
