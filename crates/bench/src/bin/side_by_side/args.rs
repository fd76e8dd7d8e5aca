//! The command line.

use std::path::PathBuf;

use clap::Parser;

use crate::job::Job;

#[derive(Parser)]
#[command(about = "Measures pointmill beside the floor, PotreeConverter and copc_converter on generated scans")]
pub(crate) struct Args {
    /// What is measured
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "aerial,terrestrial,random-order,volume,large,brotli,outputs,decoder"
    )]
    pub(crate) jobs: Vec<Job>,
    /// Points of the scene; the default depends on the job. Figures of other numbers of points change no row of the
    /// table of targets
    #[arg(long, value_parser = parse_count)]
    pub(crate) points: Option<u64>,
    /// Runs of each program; the median is reported. The default is 5, of half-billion 1
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) runs: Option<u32>,
    /// Runs only what has one of these words in its name
    #[arg(long, value_delimiter = ',')]
    pub(crate) only: Vec<String>,
    /// More options for every conversion by pointmill, separated by blanks
    #[arg(long, allow_hyphen_values = true, default_value = "")]
    pub(crate) options: String,
    /// Memory that the host of a virtual machine has lent before a run starts, so that no run waits for it; 0 for none.
    /// The default is 4GiB, of large 8GiB
    #[arg(long, value_parser = parse_size)]
    pub(crate) lend: Option<u64>,
    /// Where scenes (kept and used again up to 2 GiB) and outputs (removed) go; the default is a folder for
    /// temporary files
    #[arg(long)]
    pub(crate) dir: Option<PathBuf>,
    /// The pointmill to measure; the default is built and found beside this program
    #[arg(long)]
    pub(crate) pointmill: Option<PathBuf>,
    /// A line to add under the machine, such as the version of a program that does not report it
    #[arg(long)]
    pub(crate) note: Vec<String>,
    /// Markdown file whose section of this job, and whose rows of the table of targets, are replaced or added; the
    /// default is standard output
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
    /// Is the process that holds this memory
    #[arg(long, hide = true)]
    pub(crate) ballast: bool,
}

fn parse_count(text: &str) -> Result<u64, String> {
    let count = text.replace('_', "").parse::<u64>().map_err(|e| e.to_string())?;
    if count > 0 { Ok(count) } else { Err("at least one point".into()) }
}

fn parse_size(text: &str) -> Result<u64, String> {
    let (digits, shift) = [("KiB", 10), ("MiB", 20), ("GiB", 30)]
        .iter()
        .find_map(|(unit, shift)| Some((text.strip_suffix(unit)?, *shift)))
        .unwrap_or((text, 0));
    let bytes = digits.trim().parse::<u64>().map_err(|e| e.to_string())?;
    bytes.checked_mul(1 << shift).ok_or_else(|| "too large".into())
}
