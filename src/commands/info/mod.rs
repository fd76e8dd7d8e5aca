//! `pointmill info`: describes scans and datasets.

mod batches;
mod bintree;
mod copc;
mod description;
mod measure;
mod parts;
mod potree1;
mod potree2;
mod scan;

use std::path::{Path, PathBuf};

use description::Description;
use pointmill_format::{DatasetKind, Located, OpenOptions, locate};
use serde_json::Value;

use crate::args::InfoArgs;
use crate::datasets;
use crate::exit::{Failure, emit, print_line, to_json};
use crate::inputs;
use crate::{depth_choice, scan_choice, text_choice};

/// Describes a dataset; each kind has a file here. COPC is a scan, too, and described as one.
fn describe_dataset(dataset: &Located, options: &OpenOptions, deep: bool) -> Result<Description, Failure> {
    let marker = dataset.marker_path();
    match dataset.kind {
        DatasetKind::Potree2 => potree2::describe(&marker),
        DatasetKind::Potree1 => potree1::describe(&marker),
        DatasetKind::Bintree => bintree::describe(&marker),
        DatasetKind::Batches => batches::describe(&marker),
        DatasetKind::Copc => scan::describe(&marker, options, deep),
        other => Err(Failure::Usage(format!("{}: info does not read datasets of kind {other}", marker.display()))),
    }
}

/// Describes what a search has found.
fn describe(path: &Path, options: &OpenOptions, deep: bool) -> Result<Description, Failure> {
    match DatasetKind::detect(path).filter(|kind| *kind != DatasetKind::Copc).and_then(|_| locate(path).ok()) {
        Some(dataset) => describe_dataset(&dataset, options, deep),
        None => scan::describe(path, options, deep),
    }
}

/// The datasets at `path`: the one that it is, or those that one conversion has put into it. A COPC file is found as the scan
/// that it is, among others of its folder.
fn datasets(path: &Path) -> Vec<Located> {
    match locate(path) {
        Ok(Located { kind: DatasetKind::Copc, .. }) => Vec::new(),
        Ok(one) => vec![one],
        Err(_) => datasets::inside(path),
    }
}

/// What is named like the first file of a dataset and cannot be read: a pipe, or what may not be looked at.
fn unreadable_marker(path: &Path) -> Option<Failure> {
    let error = locate(path).err().filter(|error| error.is_io() && error.path() != path)?;
    Some(error.into())
}

/// Describes every path; the exit code is that of the first failure.
pub(crate) fn run(args: &InfoArgs) -> Result<(), Failure> {
    args.reading.placing.refuse_idle_crs()?;
    let options = args.reading.options()?;
    check_choice(&args.paths, &options)?;
    let mut out = Output { json: args.json, objects: 0, first_failure: None };
    for path in &args.paths {
        if let Some(failure) = unreadable_marker(path) {
            out.fail(failure);
            continue;
        }
        let datasets = datasets(path);
        for dataset in &datasets {
            out.show(describe_dataset(dataset, &options, args.deep))?;
        }
        if !datasets.is_empty() {
            continue;
        }
        match inputs::expand(std::slice::from_ref(path), &options, None) {
            Err(failure) => out.fail(failure),
            Ok(found) => {
                found.all_notes().for_each(|note| print_line(&note));
                found.unread_failure("").into_iter().for_each(|failure| out.fail(failure));
                for file in &found.files {
                    out.show(describe(file, &options, args.deep))?;
                }
            }
        }
    }
    out.end()?;
    out.first_failure.map_or(Ok(()), Err)
}

/// Checks that the scans that were chosen are in one of all inputs.
fn check_choice(paths: &[PathBuf], options: &OpenOptions) -> Result<(), Failure> {
    if options.scans.is_none() && !text_choice::is_given(options) && !depth_choice::is_given(options) {
        return Ok(());
    }
    // what cannot be found is reported in its turn
    let expanded = paths.iter().filter_map(|path| inputs::expand(std::slice::from_ref(path), options, None).ok());
    let files: Vec<PathBuf> = expanded.flat_map(|found| found.files).collect();
    scan_choice::check(&files, options)?;
    if files.is_empty() {
        return Ok(());
    }
    text_choice::check(&files, options)?;
    depth_choice::check(&files, options)
}

/// The output so far: of very many scans nothing is kept.
struct Output {
    json: bool,
    /// Objects of the array that were written.
    objects: usize,
    first_failure: Option<Failure>,
}

impl Output {
    fn show(&mut self, description: Result<Description, Failure>) -> Result<(), Failure> {
        match description {
            Ok(Description { text, json, fault }) => {
                if self.json {
                    emit(&element(&json, self.objects == 0)?)?;
                    self.objects += 1;
                } else {
                    emit(&text)?;
                }
                fault.into_iter().for_each(|fault| self.fail(fault));
            }
            Err(failure) => self.fail(failure),
        }
        Ok(())
    }

    /// Closes the array.
    fn end(&self) -> Result<(), Failure> {
        match (self.json, self.objects) {
            (false, _) => Ok(()),
            (true, 0) => emit("[]\n"),
            (true, _) => emit("\n]\n"),
        }
    }

    /// Reports failures as they occur, except the first, which `main` reports and which gives the exit code.
    fn fail(&mut self, failure: Failure) {
        match self.first_failure {
            None => self.first_failure = Some(failure),
            Some(_) => failure.print(),
        }
    }
}

/// The text of an element of an array that is written piece by piece.
fn element(object: &Value, is_first: bool) -> Result<String, Failure> {
    let lines = to_json(object)?.trim_end().replace('\n', "\n  "); // texts in JSON have no line breaks
    Ok(format!("{}  {lines}", if is_first { "[\n" } else { ",\n" }))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn an_array_written_piece_by_piece_is_that_of_the_library() {
        let objects = [json!({"a": [1, 2], "b": {"c": "x\ny"}}), json!({}), json!({"d": null})];
        let pieces: String = objects.iter().enumerate().map(|(i, object)| element(object, i == 0).unwrap()).collect();
        assert_eq!(pieces + "\n]\n", to_json(&objects).unwrap());
    }
}
