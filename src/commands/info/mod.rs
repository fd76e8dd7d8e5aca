//! `pointmill info`: what scans and datasets are.

mod batches;
mod bintree;
mod description;
mod measure;
mod potree2;
mod scan;

use std::path::{Path, PathBuf};

use description::Told;
use serde_json::Value;

use crate::args::InfoArgs;
use crate::exit::{Failure, emit, tell};
use crate::inputs;

/// A kind of dataset.
struct DatasetKind {
    /// The file in its folder that it is known by.
    marker: &'static str,
    /// Given that file.
    tell: fn(&Path) -> Result<Told, Failure>,
}

/// The kinds that are told of; each has a file here.
const DATASET_KINDS: [DatasetKind; 3] = [
    DatasetKind { marker: "metadata.json", tell: potree2::tell },
    DatasetKind { marker: "index.json", tell: bintree::tell },
    DatasetKind { marker: "points.qbatch", tell: batches::tell },
];

/// Folders that a conversion to several formats makes in its output.
const OUTPUT_FOLDERS: [&str; 3] = ["potree2", "bintree", "batches"];

impl DatasetKind {
    /// The datasets at `path`: the one that it is, or those that one conversion has put into it.
    fn find_all(path: &Path) -> Vec<(&'static Self, PathBuf)> {
        match Self::find(path) {
            Some(one) => vec![one],
            None if path.join("report.json").is_file() => {
                OUTPUT_FOLDERS.iter().filter_map(|folder| Self::find(&path.join(folder))).collect()
            }
            None => Vec::new(),
        }
    }

    /// The kind of the dataset that `path` is (its folder, or the file it is known by), and that file.
    fn find(path: &Path) -> Option<(&'static Self, PathBuf)> {
        if path.is_file() && path.extension().is_some_and(|e| e == "qbatch") {
            return DATASET_KINDS.last().map(|kind| (kind, path.to_path_buf()));
        }
        DATASET_KINDS.iter().find_map(|kind| {
            let inside = path.join(kind.marker);
            let is_marker = || path.is_file() && path.file_name().is_some_and(|name| name == kind.marker);
            let file = if inside.is_file() { inside } else { is_marker().then(|| path.to_path_buf())? };
            Some((kind, file))
        })
    }
}

/// Every path is told of; the exit code is that of the first that could not be.
pub(crate) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let options = args.reading.options()?;
    let mut out = Output { json: args.json, objects: Vec::new(), first_failure: None };
    for path in &args.paths {
        let datasets = DatasetKind::find_all(path);
        for (kind, file) in &datasets {
            out.show((kind.tell)(file))?;
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
