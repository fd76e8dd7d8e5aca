//! The command line.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use pointmill_bench::scene::Scene;

#[derive(Parser)]
#[command(about = "Measures pointmill beside PotreeConverter and copc_converter on generated scans")]
pub(crate) struct Args {
    /// Points of the scene
    #[arg(long, default_value = "20000000", value_parser = parse_count)]
    pub(crate) points: u64,
    /// What is scanned
    #[arg(long, value_enum, default_value = "aerial")]
    scene: SceneArg,
    /// How the scene is stored
    #[arg(long, value_enum, default_value = "las")]
    pub(crate) format: Format,
    /// What is compared
    #[arg(long, value_enum, value_delimiter = ',', default_value = "poisson,random,grid,brotli,threads")]
    pub(crate) jobs: Vec<Job>,
    /// Ceiling of the job `memory`, bytes or with KiB, MiB, GiB
    #[arg(long, default_value = "1GiB", value_parser = parse_size)]
    pub(crate) memory: u64,
    /// Two sizes of scene that the job `growth` compares, points
    #[arg(long, value_delimiter = ',', default_value = "5000000,100000000", value_parser = parse_count)]
    pub(crate) growth: Vec<u64>,
    /// Runs of each program; the median is reported
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) runs: u32,
    /// Where scenes (kept and used again) and outputs (removed) go; the default is a folder for temporary files
    #[arg(long)]
    pub(crate) dir: Option<PathBuf>,
    /// The pointmill to measure; the default is built and found beside this program
    #[arg(long)]
    pub(crate) pointmill: Option<PathBuf>,
    /// A line to add under the machine, such as the version of a program that does not report it
    #[arg(long)]
    pub(crate) note: Vec<String>,
    /// Markdown file whose section of this scene is replaced or added; the default is standard output
    #[arg(long)]
    pub(crate) out: Option<PathBuf>,
}

/// A comparison that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Job {
    /// Poisson-disk sampling, with PotreeConverter's and copc_converter
    Poisson,
    /// Random sampling, with PotreeConverter's
    Random,
    /// Grid sampling
    Grid,
    /// Poisson-disk sampling with BROTLI payloads, with PotreeConverter's
    Brotli,
    /// One thread and two
    Threads,
    /// Under the ceiling of --memory, compared with the job poisson
    Memory,
    /// The sizes of --growth
    Growth,
    /// Binary tree and batches, each alone and beside an octree, compared with the job poisson
    Formats,
    /// Binary trees by mean, median and midpoint
    Splits,
}

#[derive(Clone, Copy, ValueEnum)]
enum SceneArg {
    Aerial,
    Terrestrial,
}

#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum Format {
    Las,
    Laz,
}

impl Args {
    pub(crate) fn scene(&self) -> Scene {
        match self.scene {
            SceneArg::Aerial => Scene::Aerial,
            SceneArg::Terrestrial => Scene::Terrestrial,
        }
    }
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
