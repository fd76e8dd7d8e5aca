//! The Markdown file that measurements are written into.

use std::fmt::Write as _;
use std::path::Path;
use std::{fs, io};

use crate::figures::{FIGURES, Target};
use crate::job::Job;
use crate::outcome::Outcome;

/// Heading of the table of figures, without the marks.
const FIGURES_TITLE: &str = "Figures and targets";

const HEAD: &str = "| figure | measured | target | | job |\n|---|---|---|---|---|\n";

/// Puts a section of that title, and the figures of `job` if there are `outcomes`, into the file at `path`.
///
/// # Errors
/// Of the operating system.
pub(crate) fn update(path: &Path, title: &str, section: &str, figures: Option<(Job, &[Outcome])>) -> io::Result<()> {
    let old = match fs::read_to_string(path) {
        Ok(old) => old,
        Err(e) if e.kind() == io::ErrorKind::NotFound => "# Benchmarks\n".into(),
        Err(e) => return Err(e),
    };
    let mut new = with_section(&old, title, section);
    if let Some((job, outcomes)) = figures {
        let table = figures_section(&old, job, outcomes);
        new = with_section(&new, FIGURES_TITLE, &table);
    }
    fs::write(path, new)
}

/// The figures of a job that were measured, as a table.
pub(crate) fn figures_of(job: Job, outcomes: &[Outcome]) -> String {
    let measured = FIGURES.iter().filter(|figure| figure.job == job).filter_map(|figure| {
        let measured = figure.measured(outcomes)?;
        Some(row(figure.what, Some(measured), figure.target, job))
    });
    format!("{HEAD}{}", measured.collect::<String>())
}

/// The table of all figures: those of `job` that were measured are new, the others as they are in `old`.
fn figures_section(old: &str, job: Job, outcomes: &[Outcome]) -> String {
    let mut out = format!(
        "## {FIGURES_TITLE}\n\nEach job of the command above measures its figures; its section below has the costs \
         they come from.\n\n{HEAD}"
    );
    for figure in FIGURES {
        let start = format!("| {} | ", figure.what);
        let measured = if figure.job == job { figure.measured(outcomes) } else { None };
        match old.lines().find(|line| line.starts_with(&start)) {
            Some(line) if measured.is_none() => {
                let _ = writeln!(out, "{line}");
            }
            _ => out.push_str(&row(figure.what, measured, figure.target, figure.job)),
        }
    }
    out
}

fn row(what: &str, measured: Option<f64>, target: Target, job: Job) -> String {
    let target_text = match target {
        Target::AtMost(most) => format!("≤ {most}"),
        Target::AtLeast(least) => format!("≥ {least}"),
        Target::None => "–".into(),
    };
    let reached = match measured {
        Some(_) if target == Target::None => "",
        Some(measured) if target.is_reached(measured) => "reached",
        Some(_) => "**not reached**",
        None => "",
    };
    let measured = measured.map_or("–".to_owned(), |v| format!("{v:.3}"));
    format!("| {what} | {measured} | {target_text} | {reached} | `{}` |\n", job.name())
}

/// `old` with `text` in the place of the section of that title, or at its end.
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
    use pointmill_bench::process::Cost;

    use super::*;
    use crate::cases;

    #[test]
    fn a_section_is_replaced_in_its_place_and_nothing_else_changes() {
        let old = "# Benchmarks\n\nWords.\n\n## a\n\nold\n### detail\n\n## b\n\nkept\n";
        assert_eq!(with_section(old, "a", "## a\n\nnew\n"), "# Benchmarks\n\nWords.\n\n## a\n\nnew\n\n## b\n\nkept\n");
        assert_eq!(with_section("# Benchmarks\n", "c", "## c\n\nx\n"), "# Benchmarks\n\n## c\n\nx\n");
    }

    #[test]
    fn a_job_changes_its_own_rows_of_the_table_and_no_others() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let kept = "| BROTLI: potree2 / PotreeConverter, CPU | 0.390 | ≤ 0.4 | reached | `brotli` |";
        let old = format!("# Benchmarks\n\n## {FIGURES_TITLE}\n\n{kept}\n\n## other\n\nwords\n");
        fs::write(file.path(), old).unwrap();
        let mut outcomes: Vec<Outcome> = cases::list(Job::RandomOrder, 10, "").into_iter().map(Outcome::new).collect();
        for (outcome, user_secs) in outcomes.iter_mut().zip([1.0, 0.5, 4.0]) {
            outcome.costs = vec![Cost { wall_secs: 1.0, user_secs, system_secs: 0.0, peak_bytes: 1, exit_code: 0 }];
        }
        update(file.path(), "volume", "## volume\n\nx\n", Some((Job::RandomOrder, &outcomes))).unwrap();
        let new = fs::read_to_string(file.path()).unwrap();
        let count = |line: &str| new.lines().filter(|l| *l == line).count();
        assert_eq!(count(kept), 1);
        assert_eq!(
            count(
                "| random order: potree2 / PotreeConverter, CPU | 0.250 | ≤ 0.2 | **not reached** | `random-order` |"
            ),
            1
        );
        assert_eq!(count("| random order: potree2 / floor, CPU | 2.000 | – |  | `random-order` |"), 1);
        assert_eq!(count("| aerial LAS: potree2 / floor, CPU | – | ≤ 1.5 |  | `aerial` |"), 1);
        assert_eq!(new.lines().filter(|line| line.starts_with("| ")).count(), FIGURES.len() + 1);
        assert!(new.ends_with("## other\n\nwords\n\n## volume\n\nx\n"), "{new}");
        assert!(new.lines().all(|line| line.chars().count() <= 120));
        update(file.path(), "volume", "## volume\n\nx\n", None).unwrap();
        assert_eq!(fs::read_to_string(file.path()).unwrap(), new, "other sizes of scene change no figures");
    }
}
