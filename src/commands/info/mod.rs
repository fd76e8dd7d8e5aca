//! `pointmill info`: what scans and datasets are.

mod batches;
mod bintree;
mod description;
mod measure;
mod potree2;
mod scan;

use std::path::Path;

use description::Told;
use pointmill_format::{DatasetKind, Located, locate};
use serde_json::Value;

use crate::args::InfoArgs;
use crate::datasets;
use crate::exit::{Failure, emit, tell};
use crate::inputs;

/// Tells of a dataset; each kind has a file here.
fn tell_dataset(dataset: &Located) -> Result<Told, Failure> {
    let marker = dataset.marker_path();
    match dataset.kind {
        DatasetKind::Potree2 => potree2::tell(&marker),
        DatasetKind::Bintree => bintree::tell(&marker),
        DatasetKind::Batches => batches::tell(&marker),
        other => Err(Failure::Usage(format!("{}: info does not read datasets of kind {other}", marker.display()))),
    }
}

/// The datasets at `path`: the one that it is, or those that one conversion has put into it.
fn datasets(path: &Path) -> Vec<Located> {
    locate(path).map_or_else(|_| datasets::inside(path), |one| vec![one])
}

/// Every path is told of; the exit code is that of the first that could not be.
pub(crate) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let options = args.reading.options()?;
    let mut out = Output { json: args.json, objects: Vec::new(), first_failure: None };
    for path in &args.paths {
        let datasets = datasets(path);
        for dataset in &datasets {
            out.show(tell_dataset(dataset))?;
        }
        if !datasets.is_empty() {
            continue;
        }
        match inputs::expand(std::slice::from_ref(path), &options) {
            Err(failure) => out.fail(failure),
            Ok(found) => {
                found.notes.iter().for_each(|note| tell(note));
                for file in &found.files {
                    out.show(scan::tell(file, &options, args.deep))?;
                }
            }
        }
    }
    if args.json {
        emit(&format!("{:#}\n", Value::Array(out.objects)))?;
    }
    out.first_failure.map_or(Ok(()), Err)
}

/// What was told so far.
struct Output {
    json: bool,
    objects: Vec<Value>,
    first_failure: Option<Failure>,
}

impl Output {
    fn show(&mut self, told: Result<Told, Failure>) -> Result<(), Failure> {
        match told {
            Ok(Told { text, json, fault }) => {
                if self.json {
                    self.objects.push(json);
                } else {
                    emit(&text)?;
                }
                fault.into_iter().for_each(|fault| self.fail(fault));
            }
            Err(failure) => self.fail(failure),
        }
        Ok(())
    }

    /// Failures are told as they are met, save the first, which is left to `main` and gives the exit code.
    fn fail(&mut self, failure: Failure) {
        match self.first_failure {
            None => self.first_failure = Some(failure),
            Some(_) => failure.tell(),
        }
    }
}
