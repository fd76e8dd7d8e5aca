//! The measurements of a job as Markdown.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::args::Args;
use crate::cases::{Case, Program};
use crate::job::Job;
use crate::outcome::{Outcome, median};
use crate::programs::Programs;

/// The whole section: machine, programs, costs, command lines.
pub(crate) fn section(args: &Args, job: Job, points: u64, outcomes: &[Outcome], programs: &Programs) -> String {
    let mut out = format!("## {}\n\n{}\n", job.title(points), machine());
    for program in Program::ALL.into_iter().filter(|program| !matches!(program, Program::Floor | Program::Reader)) {
        if outcomes.iter().any(|o| o.case.program == program) {
            let _ = writeln!(out, "- {}", version(program, programs));
        }
    }
    for note in &args.note {
        let _ = writeln!(out, "- {note}");
    }
    let runs = args.runs.unwrap_or(job.runs());
    let _ = writeln!(
        out,
        "\nMedian of {runs} run(s) in turn (least–most). CPU is user and system time of the whole process.{}",
        if job == Job::HalfBillion { "" } else { " The input is\nin the page cache." }
    );
    out.push_str(&costs(outcomes));
    out.push_str("\n```sh\n");
    for o in outcomes {
        let _ = writeln!(out, "{}", command_line(&o.case));
    }
    out.push_str("```\n");
    out
}

fn costs(outcomes: &[Outcome]) -> String {
    let floor = outcomes.iter().find(|o| o.case.program == Program::Floor && !o.costs.is_empty());
    let has_temporary = outcomes.iter().any(|o| o.temp_bytes > 0);
    let mut head = vec!["program", "wall s", "CPU s", "user s", "system s", "CPU µs/point"];
    head.extend(floor.map(|_| "CPU / floor"));
    head.push("peak MiB");
    head.extend(has_temporary.then_some("temporary MiB"));
    head.push("bytes/point");
    let mut out = format!("\n| {} |\n|{}\n", head.join(" | "), "---|".repeat(head.len()));
    for o in outcomes {
        let label = &o.case.label;
        if let Some(fault) = &o.fault {
            let _ = writeln!(out, "| {label} | failed: {} |{}", fault.replace('|', "/"), " |".repeat(head.len() - 2));
            continue;
        }
        let mut cells = vec![
            label.clone(),
            spread(&o.values(|c| c.wall_secs)),
            spread(&o.values(|c| c.cpu_secs())),
            format!("{:.2}", o.user()),
            format!("{:.2}", o.system()),
            format!("{:.3}", o.cpu_per_point() * 1e6),
        ];
        cells.extend(floor.map(|floor| format!("{:.2}", o.cpu() / floor.cpu())));
        cells.push(format!("{:.0}", o.peak_bytes() / f64::from(1 << 20)));
        cells.extend(has_temporary.then(|| format!("{}", o.temp_bytes >> 20)));
        let bytes = o.output_bytes as f64 / o.case.scene.points as f64;
        cells.push(if o.case.program.is_writer() { format!("{bytes:.2}") } else { "–".into() });
        let _ = writeln!(out, "| {} |", cells.join(" | "));
    }
    for (o, cost) in outcomes.iter().filter_map(|o| Some((o, o.validation?))) {
        let found = if cost.exit_code == 0 { "no fault" } else { "**faults**" };
        let _ = writeln!(
            out,
            "\n`pointmill validate --against` of \"{}\": {found}, {:.1} s, {:.1} s of CPU, peak {} MiB.",
            o.case.label,
            cost.wall_secs,
            cost.cpu_secs(),
            cost.peak_bytes >> 20
        );
    }
    out
}

fn command_line(case: &Case) -> String {
    let output = format!("./{}", case.output());
    let words = case.arguments(Path::new(&case.scene.file_name()), Path::new(&output));
    let words: Vec<_> = words.iter().map(|w| w.to_string_lossy()).collect();
    format!("{} {}", case.program.binary(), words.join(" "))
}

/// Of sorted values.
fn spread(sorted: &[f64]) -> String {
    match sorted {
        [least, .., most] => format!("{:.2} ({least:.2}–{most:.2})", median(sorted)),
        _ => format!("{:.2}", median(sorted)),
    }
}

fn machine() -> String {
    let value = |path: &str, key: &str| {
        let text = fs::read_to_string(path).ok()?;
        let line = text.lines().find(|l| l.starts_with(key))?;
        line.split_once(':').map(|(_, v)| v.trim().to_owned())
    };
    let cpu = value("/proc/cpuinfo", "model name").unwrap_or_else(|| std::env::consts::ARCH.into());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let kib = value("/proc/meminfo", "MemTotal").and_then(|v| v.trim_end_matches(" kB").parse::<u64>().ok());
    let memory = kib.map_or(String::new(), |kib| format!(", {} GiB", (kib + (1 << 19)) >> 20));
    format!("- {cpu}, {threads} threads{memory}, {}", std::env::consts::OS)
}

fn version(program: Program, programs: &Programs) -> String {
    // PotreeConverter knows no --version and would take it for a file.
    let said = match program {
        Program::Pointmill | Program::CopcConverter => {
            Command::new(programs.path(program)).arg("--version").output().ok()
        }
        _ => None,
    };
    match said.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned()).filter(|v| !v.is_empty()) {
        Some(version) => version,
        None if program == Program::Laz => "laz, the Rust crate".to_owned(),
        None => format!("{} (reports no version)", program.name()),
    }
}

#[cfg(test)]
mod tests {
    use pointmill_bench::process::Cost;

    use super::*;
    use crate::cases;

    #[test]
    fn costs_are_told_beside_those_of_the_floor() {
        let cases = cases::list(Job::RandomOrder, 1_000_000, "").into_iter();
        let mut outcomes: Vec<Outcome> = cases.map(Outcome::new).collect();
        let cost = |user_secs| Cost { wall_secs: 2.0, user_secs, system_secs: 0.5, peak_bytes: 3 << 20, exit_code: 0 };
        outcomes[0].costs = vec![cost(2.5), cost(3.5), cost(5.5)];
        outcomes[0].output_bytes = 38_010_000;
        outcomes[1].costs = vec![cost(1.5)];
        outcomes[1].output_bytes = 38_000_000;
        outcomes[2].fault = Some("exit code 1".into());
        let lines = [
            "| program | wall s | CPU s | user s | system s | CPU µs/point | CPU / floor | peak MiB | bytes/point |",
            "|---|---|---|---|---|---|---|---|---|",
            "| pointmill | 2.00 (2.00–2.00) | 4.00 (3.00–6.00) | 3.50 | 0.50 | 4.000 | 2.00 | 3 | 38.01 |",
            "| floor | 2.00 | 2.00 | 1.50 | 0.50 | 2.000 | 1.00 | 3 | 38.00 |",
            "| PotreeConverter | failed: exit code 1 | | | | | | | |",
        ];
        assert_eq!(costs(&outcomes).lines().skip(1).collect::<Vec<_>>(), lines);
    }

    #[test]
    fn generated_lines_fit_into_the_width_of_the_documents() {
        use clap::ValueEnum as _;
        for job in Job::value_variants() {
            for case in cases::list(*job, job.points(), "") {
                let line = command_line(&case);
                assert!(line.chars().count() <= 120, "{line}");
            }
        }
    }
}
