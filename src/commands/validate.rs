//! `pointmill validate`: checks a dataset against its format and its scans.

use std::path::{Path, PathBuf};

use pointmill_format::{ErrorKind, ReadError};
use pointmill_validate::{Options, Outcome, locate};

use crate::args::ValidateArgs;
use crate::datasets;
use crate::exit::{Failure, emit, print_line, to_json};
use crate::human::progress::Progress;
use crate::human::quantities::plural;
use crate::human::validation;
use crate::inputs;
use crate::{scan_choice, text_choice};

/// A folder with the outputs of one conversion to several formats is validated one after the other; all are
/// reported, and the first failure gives the exit code.
pub(crate) fn run(args: &ValidateArgs) -> Result<(), Failure> {
    args.reading.placing.refuse_idle_crs()?;
    if args.against.is_empty() {
        args.reading.refuse_without_scans()?;
    }
    let datasets = several(&args.dataset);
    if datasets.is_empty() {
        require_dataset(&args.dataset)?;
        return one(&args.dataset, args);
    }
    if args.json {
        let names = datasets.iter().map(|d| d.display().to_string()).collect::<Vec<_>>().join(", ");
        let line = format!("{}: several datasets; with --json, name one of them: {names}", args.dataset.display());
        return Err(Failure::Usage(line));
    }
    let mut first = None;
    for dataset in &datasets {
        match require_dataset(dataset).and_then(|()| one(dataset, args)) {
            Err(failure) if first.is_some() => failure.print(),
            Err(failure) => first = Some(failure),
            Ok(()) => {}
        }
    }
    first.map_or(Ok(()), Err)
}

/// The datasets that one conversion has put into `folder`; none if it is a dataset itself, or no such folder.
fn several(folder: &Path) -> Vec<PathBuf> {
    if locate(folder).is_ok() {
        return Vec::new();
    }
    datasets::inside(folder).into_iter().map(|dataset| folder.join(dataset.kind.name())).collect()
}

fn one(dataset: &Path, args: &ValidateArgs) -> Result<(), Failure> {
    let mut options = Options { neighbourhoods: !args.fast, open: args.reading.options()?, ..Options::default() };
    if !args.against.is_empty() {
        let found = inputs::expand(&args.against, &options.open)?;
        scan_choice::check(&found.files, &options.open)?;
        text_choice::check(&found.files, &options.open)?;
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
    if args.json {
        emit(&to_json(&outcome)?)?;
    } else if args.talk.quiet {
        emit(&validation::problems(&outcome))?;
    } else {
        emit(&validation::outcome(dataset, &outcome, args.talk.verbose))?;
    }
    verdict(dataset, &outcome)
}

fn verdict(dataset: &Path, outcome: &Outcome) -> Result<(), Failure> {
    if outcome.ok {
        return Ok(());
    }
    let broken: Vec<&str> = outcome.checks.iter().filter(|check| !check.ok).map(|check| check.name.name()).collect();
    let faults = plural(outcome.checks.iter().map(|check| check.found).sum(), "error");
    Err(Failure::Faults(format!("{}: {faults} found by {}", dataset.display(), broken.join(", "))))
}

/// A path without a dataset is a usage error; a file that is missing from a dataset is an error of the dataset.
fn require_dataset(dataset: &Path) -> Result<(), Failure> {
    let path = dataset.display();
    if !dataset.exists() {
        return Err(Failure::Usage(format!("{path}: no such dataset")));
    }
    let located = locate(dataset).map_err(|error| match error.kind() {
        ErrorKind::Io(_) => Failure::from(error),
        _ => Failure::Usage(error.to_string()),
    })?;
    match located.kind.required_files().iter().find(|name| !located.path.join(name).exists()) {
        Some(name) => Err(Failure::Faults(format!("{path}: {name} is missing; convert or copy the dataset again"))),
        None => Ok(()),
    }
}

/// A broken dataset is a result of the validation, also when a reader reports it.
fn failure(error: ReadError, dataset: &Path) -> Failure {
    let in_dataset = error.path().starts_with(dataset);
    match Failure::from(error) {
        Failure::Input(line) if in_dataset => Failure::Faults(line),
        other => other,
    }
}
