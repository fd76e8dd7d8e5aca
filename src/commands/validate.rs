//! `pointmill validate`: checks a dataset against its format and its scans.

use std::path::Path;

use pointmill_converter::memory::default_ceiling_bytes;
use pointmill_format::{ErrorKind, ReadError};
use pointmill_validate::{Options, Outcome, Several, locate};
use serde_json::json;

use crate::args::ValidateArgs;
use crate::exit::{Failure, emit, print_line, to_json};
use crate::human::progress::Progress;
use crate::human::quantities::plural;
use crate::human::validation;
use crate::inputs;
use crate::printable::printable;
use crate::{depth_choice, scan_choice, text_choice};

/// A folder with the outputs of one conversion to several formats is validated one after the other, and held against its
/// report; all are reported, and the first failure gives the exit code.
pub(crate) fn run(args: &ValidateArgs) -> Result<(), Failure> {
    let mut objects = Objects { json: args.json, shown: false };
    let result = checked(args, &mut objects);
    match &result {
        Err(failure) if !objects.shown => objects.show(&without_outcome(failure))?,
        _ => {}
    }
    result
}

fn checked(args: &ValidateArgs, objects: &mut Objects) -> Result<(), Failure> {
    args.reading.placing.refuse_idle_crs()?;
    if args.against.is_empty() {
        args.reading.refuse_without_scans()?;
    }
    let folder = &args.dataset;
    let several = match locate(folder) {
        Ok(_) => None,
        Err(_) if !folder.is_dir() => None,
        Err(_) => pointmill_validate::several(folder).map_err(|e| failure(e, folder))?,
    };
    let Some(several) = several else {
        require_dataset(folder)?;
        let (outcome, result) = one(folder, args)?;
        objects.show(&outcome)?;
        return result;
    };
    let mut result = several_verdict(folder, &several, args)?;
    let mut outcomes = Vec::new();
    for dataset in &several.datasets {
        let path = folder.join(dataset.kind.name());
        let name = path.to_string_lossy();
        let ended = match one(&path, args) {
            Ok((outcome, ended)) => {
                outcomes.push(json!({ "path": name, "outcome": outcome }));
                ended
            }
            Err(failure) => {
                outcomes.push(json!({ "path": name, "error": failure.line() }));
                Err(failure)
            }
        };
        match (ended, &result) {
            (Err(failure), Err(_)) => failure.print(),
            (Err(failure), Ok(())) => result = Err(failure),
            (Ok(()), _) => {}
        }
    }
    objects.show(&json!({
        "ok": result.is_ok(),
        "datasets": outcomes,
        "problems": several.problems,
        "skipped": several.unchecked,
    }))?;
    result
}

/// What is printed with --json: one object, whatever happens.
struct Objects {
    json: bool,
    shown: bool,
}

impl Objects {
    fn show(&mut self, object: &impl serde::Serialize) -> Result<(), Failure> {
        if self.json {
            self.shown = true;
            emit(&to_json(object)?)?;
        }
        Ok(())
    }
}

/// The object for a validation that could not be done.
fn without_outcome(failure: &Failure) -> serde_json::Value {
    json!({ "ok": false, "format": null, "points": 0, "checks": [], "problems": [], "error": failure.line() })
}

/// What the report has to say of the outputs of one conversion, printed; a failure if they are not these.
fn several_verdict(folder: &Path, several: &Several, args: &ValidateArgs) -> Result<Result<(), Failure>, Failure> {
    if let Some(why) = several.unchecked.filter(|_| !args.talk.quiet) {
        print_line(&format!("{}: {why}", folder.display()));
    }
    if several.problems.is_empty() {
        return Ok(Ok(()));
    }
    if !args.json {
        emit(
            &several
                .problems
                .iter()
                .map(|problem| printable(&problem.to_string()).into_owned() + "\n")
                .collect::<String>(),
        )?;
    }
    let names: Vec<&str> = several.problems.iter().map(|problem| problem.subject.as_ref()).collect();
    let line = format!("{}: report.json names other outputs than are there: {}", folder.display(), names.join(", "));
    Ok(Err(Failure::Faults(line)))
}

/// Validates a dataset and prints what was found, unless it is to be printed as JSON.
fn one(dataset: &Path, args: &ValidateArgs) -> Result<(Outcome, Result<(), Failure>), Failure> {
    let mut options = Options {
        neighbourhoods: !args.fast,
        open: args.reading.options()?,
        memory_bytes: args.memory.unwrap_or_else(default_ceiling_bytes),
        ..Options::default()
    };
    if !args.against.is_empty() {
        let found = inputs::expand(&args.against, &options.open, Some(dataset))?;
        scan_choice::check(&found.files, &options.open)?;
        text_choice::check(&found.files, &options.open)?;
        depth_choice::check(&found.files, &options.open)?;
        if !args.talk.quiet {
            found.all_notes().chain(found.unread_notes()).for_each(|note| print_line(&note));
        }
        options.against = found.files;
    }
    if let Some(threads) = args.threads {
        options.threads = usize::from(threads.get());
    }
    let progress = Progress::new(&args.talk, None);
    let result = pointmill_validate::validate(dataset, &options, &|p| progress.at(p.phase, p.done, p.total));
    progress.end();
    let outcome = result.map_err(|e| failure(e, dataset))?;
    if !args.json {
        let text = match args.talk.quiet {
            true => validation::problems(&outcome),
            false => validation::outcome(dataset, &outcome, args.talk.verbose),
        };
        emit(&text)?;
    }
    let verdict = verdict(dataset, &outcome);
    Ok((outcome, verdict))
}

fn verdict(dataset: &Path, outcome: &Outcome) -> Result<(), Failure> {
    if outcome.ok {
        return Ok(());
    }
    if let Some(name) = missing_file(dataset) {
        let path = dataset.display();
        return Err(Failure::Faults(format!("{path}: {name} is missing; convert or copy the dataset again")));
    }
    let broken: Vec<&str> = outcome.checks.iter().filter(|check| !check.ok).map(|check| check.name.name()).collect();
    let faults = plural(outcome.checks.iter().map(|check| check.found).sum(), "error");
    Err(Failure::Faults(format!("{}: {faults} found by {}", dataset.display(), broken.join(", "))))
}

/// A path without a dataset is a usage error.
fn require_dataset(dataset: &Path) -> Result<(), Failure> {
    if !dataset.exists() {
        return Err(Failure::Usage(format!("{}: no such dataset", dataset.display())));
    }
    locate(dataset).map(|_| ()).map_err(|error| match error.kind() {
        ErrorKind::Io(_) => Failure::from(error),
        _ => Failure::Usage(error.to_string()),
    })
}

/// A file that is missing from a dataset.
fn missing_file(dataset: &Path) -> Option<&'static str> {
    let located = locate(dataset).ok()?;
    located.kind.required_files().iter().copied().find(|name| !located.path.join(name).exists())
}

/// A broken dataset is a result of the validation, also when a reader reports it.
fn failure(error: ReadError, dataset: &Path) -> Failure {
    // the dataset may have been named by its marker file
    let folder = locate(dataset).map_or_else(|_| dataset.to_path_buf(), |located| located.path);
    let in_dataset = error.path().starts_with(dataset) || error.path().starts_with(folder);
    match Failure::from(error) {
        Failure::Input(line) if in_dataset => Failure::Faults(line),
        other => other,
    }
}
