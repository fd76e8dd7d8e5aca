//! Options of text scans: whether any input is text.

use std::path::PathBuf;

use pointmill_format::{DatasetKind, Decimal, OpenOptions, ScanKind};

use crate::exit::Failure;

/// True if there is an option of text scans.
pub(crate) fn is_given(options: &OpenOptions) -> bool {
    options.columns.is_some() || options.separator.is_some() || options.decimal != Decimal::Auto
}

/// Refuses an option that no input can follow; without one nothing is opened.
pub(crate) fn check(files: &[PathBuf], options: &OpenOptions) -> Result<(), Failure> {
    let given = [
        ("--columns", options.columns.is_some()),
        ("--separator", options.separator.is_some()),
        ("--decimal", options.decimal != Decimal::Auto),
    ];
    let Some((option, _)) = given.iter().find(|(_, is_given)| *is_given) else { return Ok(()) };
    // what is of no kind, or cannot be read, is reported by its reader, or is made text by its columns
    let is_other = |file: &PathBuf| match ScanKind::of_file(file) {
        Ok(Some(kind)) => !matches!(kind, ScanKind::Text(_)),
        _ => DatasetKind::detect(file).is_some(),
    };
    if !files.iter().all(is_other) {
        return Ok(());
    }
    Err(Failure::Usage(format!("{option}: no input is a text scan, to which alone it applies; leave it out")))
}
