//! What is run: each job as command lines of pointmill and of the programs that can do the same.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::args::{Args, Job};

/// Who runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Program {
    Pointmill,
    PotreeConverter,
    CopcConverter,
}

impl Program {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Pointmill => "pointmill",
            Self::PotreeConverter => "PotreeConverter",
            Self::CopcConverter => "copc_converter",
        }
    }
}

/// One program with its options on one scene.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    /// Unique; the ratios find their cases by it.
    pub(crate) label: String,
    pub(crate) program: Program,
    pub(crate) options: Vec<String>,
    /// Points of its scene.
    pub(crate) points: u64,
    /// The scene; empty until it was generated.
    pub(crate) input: PathBuf,
}

impl Case {
    /// The whole command line after the program.
    pub(crate) fn arguments(&self, input: &Path, output: &Path) -> Vec<OsString> {
        let (input, output) = (OsString::from(input), OsString::from(output));
        let options = self.options.iter().map(OsString::from);
        match self.program {
            Program::Pointmill => {
                let fixed = ["convert".into(), input, "-o".into(), output, "--quiet".into()];
                fixed.into_iter().chain(options).collect()
            }
            Program::PotreeConverter => [input, "-o".into(), output].into_iter().chain(options).collect(),
            Program::CopcConverter => {
                // Like the others, it keeps its temporary files beside its output.
                let temp = Path::new(&output).parent().map(OsString::from).unwrap_or_default();
                let fixed = [input, output, "--progress".into(), "plain".into(), "--temp-dir".into(), temp];
                fixed.into_iter().chain(options).collect()
            }
        }
    }
}

/// Every case of the jobs asked for, pointmill's first.
pub(crate) fn list(args: &Args) -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    let mut add = |program: Program, label: &str, options: &str, points: u64| {
        let label = format!("{} {label}", program.name()).trim_end().to_owned();
        if cases.iter().all(|c| c.label != label) {
            let options = options.split_whitespace().map(str::to_owned).collect();
            cases.push(Case { label, program, options, points, input: PathBuf::new() });
        }
    };
    let n = args.points;
    for job in &args.jobs {
        match job {
            Job::Poisson => {
                add(Program::Pointmill, "poisson", "--sampling poisson", n);
                add(Program::PotreeConverter, "poisson", "-m poisson", n);
                add(Program::CopcConverter, "", "", n);
            }
            Job::Random => {
                add(Program::Pointmill, "random", "--sampling random", n);
                add(Program::PotreeConverter, "random", "-m random", n);
            }
            Job::Grid => add(Program::Pointmill, "grid", "--sampling grid", n),
            Job::Brotli => {
                add(Program::Pointmill, "poisson BROTLI", "--sampling poisson --encoding brotli", n);
                add(Program::PotreeConverter, "poisson BROTLI", "-m poisson --encoding BROTLI", n);
            }
            Job::Threads => {
                for threads in [1, 2] {
                    let options = format!("--sampling poisson --threads {threads}");
                    add(Program::Pointmill, &format!("poisson, threads {threads}"), &options, n);
                }
            }
            Job::Memory => {
                add(Program::Pointmill, "poisson", "--sampling poisson", n);
                // In bytes: every spelling of a size takes those.
                let options = format!("--sampling poisson --memory {}", args.memory);
                add(Program::Pointmill, "poisson, memory ceiling", &options, n);
            }
            Job::Formats => {
                add(Program::Pointmill, "poisson", "--sampling poisson", n);
                for format in ["bintree", "batches"] {
                    add(Program::Pointmill, format, &format!("--to {format}"), n);
                    let both = format!("--sampling poisson --to potree2 --to {format}");
                    add(Program::Pointmill, &format!("poisson and {format}"), &both, n);
                }
            }
            Job::Splits => {
                for split in ["mean", "median", "midpoint"] {
                    add(Program::Pointmill, &format!("bintree, {split}"), &format!("--to bintree --split {split}"), n);
                }
            }
            Job::Growth => {
                for points in &args.growth {
                    let label = format!("poisson, {points} points");
                    add(Program::Pointmill, &label, "--sampling poisson", *points);
                }
            }
        }
    }
    cases
}
