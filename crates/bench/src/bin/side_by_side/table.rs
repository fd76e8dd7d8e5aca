//! The measurements as Markdown.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::{fs, io};

use pointmill_bench::process::Cost;

use crate::args::{Args, Format, Job};
use crate::cases::Program;
use crate::outcome::Outcome;

/// Heading of a scene's section, without the marks.
pub(crate) fn title(args: &Args) -> String {
    let format = if matches!(args.format, Format::Las) { "LAS" } else { "LAZ" };
    format!("{}, {format}, {} points", args.scene().name(), args.points)
}

/// The whole section: machine, programs, costs, ratios, commands.
pub(crate) fn section(args: &Args, outcomes: &[Outcome], pointmill: &Path) -> String {
    let mut out = format!("## {}\n\n{}\n", title(args), machine());
    for program in [Program::Pointmill, Program::PotreeConverter, Program::CopcConverter] {
        if outcomes.iter().any(|o| o.case.program == program) {
            let path = if program == Program::Pointmill { pointmill } else { Path::new(program.name()) };
            let _ = writeln!(out, "- {}", version(program, path));
        }
    }
    for note in &args.note {
        let _ = writeln!(out, "- {note}");
    }
    let _ = write!(
        out,
        "\nMedian of {} run(s) in turn (least–most); CPU is user + system time of the whole process; the input is in \
         the page cache.\n\n\
         | program | wall s | CPU s | CPU µs/point | peak MiB | bytes/point |\n|---|---|---|---|---|---|\n",
        args.runs
    );
    for o in outcomes {
        let label = &o.case.label;
        if let Some(fault) = &o.fault {
            let _ = writeln!(out, "| {label} | failed: {} | | | | |", fault.replace('|', "/"));
            continue;
        }
        let points = o.case.points as f64;
        let _ = writeln!(
            out,
            "| {label} | {} | {} | {:.3} | {:.0} | {:.2} |",
            spread(&values(o, |c| c.wall_secs)),
            spread(&values(o, |c| c.cpu_secs)),
            cpu(o) / points * 1e6,
            peak(o) / f64::from(1 << 20),
            o.output_bytes as f64 / points,
        );
    }
    out.push_str("\n| ratio | measured | target | |\n|---|---|---|---|\n");
    for ratio in ratios(args, outcomes) {
        let reached = if ratio.reached() { "reached" } else { "**not reached**" };
        let sign = if ratio.at_most { "≤" } else { "≥" };
        let _ = writeln!(out, "| {} | {:.3} | {sign} {:.3} | {reached} |", ratio.what, ratio.measured, ratio.target);
    }
    out.push_str("\n```sh\n");
    for o in outcomes {
        let input = Path::new(o.case.input.file_name().unwrap_or_default());
        let is_copc = o.case.program == Program::CopcConverter;
        let words = o.case.arguments(input, Path::new(if is_copc { "./out.copc.laz" } else { "./out" }));
        let words: Vec<_> = words.iter().map(|w| w.to_string_lossy()).collect();
        let _ = writeln!(out, "{} {}", o.case.program.name(), words.join(" "));
    }
    out.push_str("```\n");
    out
}

struct Ratio {
    what: String,
    measured: f64,
    target: f64,
    at_most: bool,
}

impl Ratio {
    fn reached(&self) -> bool {
        if self.at_most { self.measured <= self.target } else { self.measured >= self.target }
    }
}

/// Every ratio whose two sides were measured.
fn ratios(args: &Args, outcomes: &[Outcome]) -> Vec<Ratio> {
    let find = |label: &str| outcomes.iter().find(|o| o.case.label == label && !o.costs.is_empty());
    let mut out = Vec::new();
    let mut at_most = |what: &str, of: Option<f64>, by: Option<f64>, target: f64| {
        if let (Some(of), Some(by)) = (of, by) {
            out.push(Ratio { what: what.to_owned(), measured: of / by, target, at_most: true });
        }
    };
    let bytes = |o: &Outcome| o.output_bytes as f64;
    let poisson = find("pointmill poisson");
    let reference = find("PotreeConverter poisson");
    let random = find("PotreeConverter random");
    if matches!(args.format, Format::Las) {
        at_most("CPU: poisson / PotreeConverter poisson", poisson.map(cpu), reference.map(cpu), 1.0 / 8.0);
        at_most("wall: poisson / PotreeConverter poisson", poisson.map(wall), reference.map(wall), 1.0 / 8.0);
        at_most("CPU: poisson / PotreeConverter random", poisson.map(cpu), random.map(cpu), 1.0 / 3.5);
        at_most("wall: poisson / PotreeConverter random", poisson.map(wall), random.map(wall), 1.0 / 3.5);
    } else {
        // LAZ decoding bounds what can be gained.
        at_most("CPU: poisson / PotreeConverter poisson", poisson.map(cpu), reference.map(cpu), 1.0 / 3.5);
    }
    let (ours, theirs) = (find("pointmill poisson BROTLI"), find("PotreeConverter poisson BROTLI"));
    at_most("CPU: BROTLI / PotreeConverter BROTLI", ours.map(cpu), theirs.map(cpu), 1.0 / 3.0);
    at_most("bytes: BROTLI / PotreeConverter BROTLI", ours.map(bytes), theirs.map(bytes), 1.0);
    for (format, target) in [("bintree", 1.2), ("batches", 1.0)] {
        let alone = find(&format!("pointmill {format}"));
        let both = find(&format!("pointmill poisson and {format}"));
        at_most(&format!("CPU: {format} / poisson"), alone.map(cpu), poisson.map(cpu), target);
        at_most(&format!("wall: {format} / poisson"), alone.map(wall), poisson.map(wall), target);
        let second = both.zip(poisson).map(|(both, poisson)| wall(both) - wall(poisson));
        at_most(&format!("wall: {format} as the second output / alone"), second, alone.map(wall), 0.6);
    }
    // A ceiling that the job stays below anyway proves nothing.
    let ceiling = args.memory as f64;
    let capped = find("pointmill poisson, memory ceiling").filter(|_| poisson.is_some_and(|p| peak(p) > ceiling));
    at_most("peak memory / ceiling", capped.map(peak), Some(ceiling), 1.0);
    at_most("wall: under the ceiling / in memory", capped.map(wall), poisson.map(wall), 1.5);
    if let (true, [small, large]) = (args.jobs.contains(&Job::Growth), &args.growth[..]) {
        let per_point = |n: &u64| find(&format!("pointmill poisson, {n} points")).map(|o| cpu(o) / *n as f64);
        at_most(&format!("CPU per point: {large} / {small} points"), per_point(large), per_point(small), 1.25);
    }
    if let (Some(one), Some(two)) = (find("pointmill poisson, threads 1"), find("pointmill poisson, threads 2")) {
        let measured = wall(one) / wall(two);
        out.push(Ratio { what: "wall: one thread / two threads".into(), measured, target: 1.8, at_most: false });
    }
    out
}

fn values(o: &Outcome, of: impl Fn(&Cost) -> f64) -> Vec<f64> {
    let mut values: Vec<f64> = o.costs.iter().map(of).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Of sorted values; NaN of none.
fn median(sorted: &[f64]) -> f64 {
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

fn spread(sorted: &[f64]) -> String {
    match sorted {
        [least, .., most] => format!("{:.2} ({least:.2}–{most:.2})", median(sorted)),
        _ => format!("{:.2}", median(sorted)),
    }
}

fn cpu(o: &Outcome) -> f64 {
    median(&values(o, |c| c.cpu_secs))
}

fn wall(o: &Outcome) -> f64 {
    median(&values(o, |c| c.wall_secs))
}

fn peak(o: &Outcome) -> f64 {
    o.costs.iter().map(|c| c.peak_bytes).max().unwrap_or(0) as f64
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

fn version(program: Program, path: &Path) -> String {
    // PotreeConverter knows no --version and would take it for a file.
    let said = match program {
        Program::PotreeConverter => None,
        _ => Command::new(path).arg("--version").output().ok(),
    };
    match said.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned()).filter(|v| !v.is_empty()) {
        Some(version) => version,
        None => format!("{} (reports no version)", program.name()),
    }
}

/// Puts `text` in the place of the section with that title in the file at `path`, or at its end.
///
/// # Errors
/// Of the operating system.
pub(crate) fn replace_section(path: &Path, title: &str, text: &str) -> io::Result<()> {
    let old = match fs::read_to_string(path) {
        Ok(old) => old,
        Err(e) if e.kind() == io::ErrorKind::NotFound => "# Benchmarks\n".into(),
        Err(e) => return Err(e),
    };
    fs::write(path, with_section(&old, title, text))
}

fn with_section(old: &str, title: &str, text: &str) -> String {
    let heading = format!("## {title}");
    let is_second_level = |line: &str| line.starts_with("## ") || line.starts_with("# ");
    let mut lines = old.lines();
    let before: Vec<&str> = lines.by_ref().take_while(|l| l.trim_end() != heading).collect();
    let after: Vec<&str> = lines.skip_while(|l| !is_second_level(l)).collect();
    let mut out = format!("{}\n\n{text}", before.join("\n").trim_end());
    if !after.is_empty() {
        let _ = writeln!(out, "\n{}", after.join("\n").trim_end());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_replaced_in_its_place_and_nothing_else_changes() {
        let old = "# Benchmarks\n\nWords.\n\n## a\n\nold\n### detail\n\n## b\n\nkept\n";
        assert_eq!(with_section(old, "a", "## a\n\nnew\n"), "# Benchmarks\n\nWords.\n\n## a\n\nnew\n\n## b\n\nkept\n");
        assert_eq!(with_section("# Benchmarks\n", "c", "## c\n\nx\n"), "# Benchmarks\n\n## c\n\nx\n");
    }

    #[test]
    fn the_median_is_the_middle_and_a_missed_target_is_told() {
        assert_eq!((median(&[1.0, 2.0, 9.0]), median(&[1.0, 3.0])), (2.0, 2.0));
        let ratio = |measured, at_most| Ratio { what: String::new(), measured, target: 1.5, at_most }.reached();
        assert_eq!(
            [ratio(1.4, true), ratio(1.6, true), ratio(1.4, false), ratio(1.6, false)],
            [true, false, false, true]
        );
    }
}
