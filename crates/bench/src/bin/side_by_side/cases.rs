//! What is run: each job as command lines of pointmill and of the programs that can do the same.

use std::ffi::OsString;
use std::path::Path;

use pointmill_bench::las_layout::LasLayout;

use crate::job::{Job, SceneFile, grouped};

/// The ceiling of [`Job::Large`].
pub(crate) const SMALL_CEILING: u64 = 256 << 20;

/// The ceiling of [`Job::HalfBillion`].
pub(crate) const CEILING: u64 = 2 << 30;

/// Points of the scene that [`Job::HalfBillion`] is compared with.
pub(crate) const COMPARED_POINTS: u64 = 20_000_000;

/// Point formats whose decoding is compared.
pub(crate) const DECODED: [LasLayout; 4] =
    [LasLayout::COLOUR, LasLayout::EXTRA, LasLayout::MODERN, LasLayout::MODERN_COLOUR];

/// Who runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Program {
    Pointmill,
    PotreeConverter,
    CopcConverter,
    /// The program `floor` of this crate.
    Floor,
    /// The program `decode` of this crate, with pointmill's reader.
    Reader,
    /// The same with the `laz` crate.
    Laz,
}

impl Program {
    /// Every program.
    pub(crate) const ALL: [Self; 6] =
        [Self::Pointmill, Self::Floor, Self::PotreeConverter, Self::CopcConverter, Self::Reader, Self::Laz];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Pointmill => "pointmill",
            Self::PotreeConverter => "PotreeConverter",
            Self::CopcConverter => "copc_converter",
            Self::Floor => "floor",
            Self::Reader => "pointmill's reader",
            Self::Laz => "laz",
        }
    }

    /// The name of its binary.
    pub(crate) const fn binary(self) -> &'static str {
        match self {
            Self::Reader | Self::Laz => "decode",
            _ => self.name(),
        }
    }

    /// True for programs that are on `PATH` or omitted; the others are built with this one.
    pub(crate) const fn is_foreign(self) -> bool {
        matches!(self, Self::PotreeConverter | Self::CopcConverter)
    }

    /// True if it writes something.
    pub(crate) const fn is_writer(self) -> bool {
        !matches!(self, Self::Reader | Self::Laz)
    }
}

/// One program with its options on one scene.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    /// Unique; the figures find their cases by it.
    pub(crate) label: String,
    pub(crate) program: Program,
    pub(crate) options: Vec<String>,
    pub(crate) scene: SceneFile,
    /// The dataset is compared with the scene afterwards.
    pub(crate) is_validated: bool,
}

impl Case {
    /// The whole command line after the program.
    pub(crate) fn arguments(&self, input: &Path, output: &Path) -> Vec<OsString> {
        let (input, output) = (OsString::from(input), OsString::from(output));
        let options = self.options.iter().map(OsString::from);
        let fixed = match self.program {
            Program::Pointmill => vec!["convert".into(), input, "-o".into(), output, "--quiet".into()],
            Program::PotreeConverter => vec![input, "-o".into(), output],
            Program::CopcConverter => {
                // Like the others, it keeps its temporary files beside its output.
                let temp = Path::new(&output).parent().map(OsString::from).unwrap_or_default();
                vec![input, output, "--progress".into(), "plain".into(), "--temp-dir".into(), temp]
            }
            Program::Floor => vec![input, output],
            Program::Reader => vec![input, "pointmill".into()],
            Program::Laz => vec![input, "laz".into()],
        };
        fixed.into_iter().chain(options).collect()
    }

    /// Where its output goes, in the folder of outputs.
    pub(crate) const fn output(&self) -> &'static str {
        match self.program {
            Program::CopcConverter => "out.copc.laz",
            Program::Floor => "out.bin",
            _ => "out",
        }
    }
}

/// Every case of a job with so many points; pointmill has `more` options.
pub(crate) fn list(job: Job, points: u64, more: &str) -> Vec<Case> {
    let mut cases = Cases { scene: job.scene(points), more, cases: Vec::new() };
    match job {
        Job::Aerial | Job::Terrestrial | Job::RandomOrder | Job::Volume => one_scene(job, &mut cases),
        Job::Large => {
            cases.add(Program::Pointmill, "", "");
            // In bytes: every spelling of a size takes those.
            cases.add(Program::Pointmill, "256 MiB", &format!("--memory {SMALL_CEILING}"));
        }
        Job::Brotli => {
            cases.add(Program::Pointmill, "BROTLI", "--encoding brotli");
            cases.add(Program::PotreeConverter, "BROTLI", "-m poisson --encoding BROTLI");
        }
        Job::Outputs => outputs(&mut cases),
        Job::Octrees | Job::OctreesLaz => {
            for format in ["potree2", "potree1", "copc"] {
                cases.add(Program::Pointmill, format, &format!("--to {format}"));
            }
            cases.add(Program::Pointmill, "three octrees", "--to potree2 --to potree1 --to copc");
            cases.add(Program::CopcConverter, "", "");
        }
        Job::Decoder => {
            for layout in DECODED {
                cases.scene.layout = layout;
                let format = format!("format {}", layout.name());
                cases.add(Program::Reader, &format, "");
                cases.add(Program::Laz, &format, "");
            }
        }
        Job::HalfBillion => {
            let options = format!("--memory {CEILING}");
            cases.add(Program::Pointmill, "all points", &options);
            cases.validate();
            cases.scene.points = points.min(COMPARED_POINTS);
            cases.add(Program::Pointmill, &format!("{} points", grouped(cases.scene.points)), &options);
        }
        Job::Sampling => {
            for sampling in ["poisson", "grid", "random"] {
                cases.add(Program::Pointmill, sampling, &format!("--sampling {sampling}"));
            }
            cases.add(Program::PotreeConverter, "poisson", "-m poisson");
            cases.add(Program::PotreeConverter, "random", "-m random");
        }
        Job::Splits => {
            for split in ["mean", "median", "midpoint"] {
                cases.add(Program::Pointmill, split, &format!("--to bintree --split {split}"));
            }
        }
    }
    cases.cases
}

fn one_scene(job: Job, cases: &mut Cases<'_>) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    cases.add(Program::Pointmill, "", "");
    cases.add(Program::Floor, "", &threads.to_string());
    if job == Job::Volume {
        return;
    }
    cases.add(Program::PotreeConverter, "", "-m poisson");
    if job == Job::RandomOrder {
        return;
    }
    cases.add(Program::CopcConverter, "", "");
    cases.add(Program::Pointmill, "1 thread", "--threads 1");
    cases.add(Program::Pointmill, "2 threads", "--threads 2");
    if job == Job::Terrestrial {
        cases.add(Program::Laz, "", "");
        cases.add(Program::Reader, "", "");
    }
}

/// Alone as they come, and every combination with all attributes in each.
fn outputs(cases: &mut Cases<'_>) {
    cases.add(Program::Pointmill, "potree2", "");
    for format in ["bintree", "batches"] {
        cases.add(Program::Pointmill, format, &format!("--to {format}"));
        cases.add(Program::Pointmill, &format!("{format}, all attributes"), &format!("--attributes all --to {format}"));
    }
    let several = [
        ("potree2 and bintree", "--to potree2 --to bintree"),
        ("potree2 and batches", "--to potree2 --to batches"),
        ("bintree and batches", "--to bintree --to batches"),
        ("all three", "--to potree2 --to bintree --to batches"),
    ];
    for (label, options) in several {
        cases.add(Program::Pointmill, label, &format!("--attributes all {options}"));
    }
}

struct Cases<'a> {
    scene: SceneFile,
    /// Options of every conversion by pointmill.
    more: &'a str,
    cases: Vec<Case>,
}

impl Cases<'_> {
    fn add(&mut self, program: Program, detail: &str, options: &str) {
        let label = if detail.is_empty() { program.name().to_owned() } else { format!("{}, {detail}", program.name()) };
        let more = if program == Program::Pointmill { self.more } else { "" };
        let options = options.split_whitespace().chain(more.split_whitespace()).map(str::to_owned).collect();
        self.cases.push(Case { label, program, options, scene: self.scene, is_validated: false });
    }

    /// The case that was added last is validated.
    fn validate(&mut self) {
        if let Some(case) = self.cases.last_mut() {
            case.is_validated = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::*;

    #[test]
    fn labels_are_unique_in_a_job() {
        for job in Job::value_variants() {
            let cases = list(*job, 1000, "");
            let mut labels: Vec<&str> = cases.iter().map(|case| case.label.as_str()).collect();
            labels.sort();
            labels.dedup();
            assert_eq!(labels.len(), cases.len(), "{job:?}");
        }
    }

    #[test]
    fn more_options_are_those_of_pointmill_alone() {
        let options: Vec<String> =
            list(Job::Brotli, 1000, "--planes 10").into_iter().map(|case| case.options.join(" ")).collect();
        assert_eq!(options, ["--encoding brotli --planes 10", "-m poisson --encoding BROTLI"]);
    }
}
