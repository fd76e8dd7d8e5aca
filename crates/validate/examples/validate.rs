//! The shortest use of this crate: `validate DATASET [SCAN...]` prints what was found, or with `--json` the outcome.
//! `--quick` leaves out spacing, coverage and quality.

use std::path::PathBuf;
use std::process::ExitCode;

use pointmill_validate::{Options, validate};

fn main() -> ExitCode {
    let mut paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let mut flag = |word: &str| {
        let before = paths.len();
        paths.retain(|p| p.as_os_str() != word);
        paths.len() < before
    };
    let (json, quick) = (flag("--json"), flag("--quick"));
    if paths.is_empty() {
        eprintln!("usage: validate [--json] [--quick] DATASET [SCAN...]");
        return ExitCode::from(2);
    }
    let dataset = paths.remove(0);
    let options = Options { against: paths, neighbourhoods: !quick, ..Options::default() };
    let outcome = match validate(&dataset, &options, &|_| {}) {
        Ok(outcome) => outcome,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(3);
        }
    };
    if json {
        println!("{}", serde_json::to_string_pretty(&outcome).unwrap_or_default());
    } else {
        outcome.checks.iter().for_each(|check| println!("{check}"));
        outcome.problems.iter().for_each(|problem| println!("{problem}"));
        outcome.quality.iter().for_each(|level| println!("{level:?}"));
    }
    ExitCode::from(if outcome.ok { 0 } else { 7 })
}
