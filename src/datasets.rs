//! The datasets that one conversion has put into its output.

use std::path::Path;

use pointmill_format::{DatasetKind, Located, locate};

use crate::exit::Failure;

/// The datasets in `folder`, each in a folder of its kind's name; none if this is no output of a conversion to several
/// formats.
pub(crate) fn inside(folder: &Path) -> Vec<Located> {
    if !folder.join("report.json").is_file() {
        return Vec::new();
    }
    DatasetKind::ALL.iter().filter_map(|kind| locate(folder.join(kind.name())).ok()).collect()
}

/// The dataset at `input`; `None` if it is none, and so may be scans.
///
/// # Errors
/// A dataset that may not be looked at; a folder with several.
pub(crate) fn named(input: &Path) -> Result<Option<Located>, Failure> {
    match locate(input) {
        Ok(dataset) => Ok(Some(dataset)),
        Err(error) if error.is_io() && error.path() != input => Err(error.into()),
        Err(_) => match &inside(input)[..] {
            [] => Ok(None),
            several => {
                let names: Vec<String> = several.iter().map(|one| one.path.display().to_string()).collect();
                let shown = input.display();
                Err(Failure::Usage(format!("{shown}: several datasets are in it; name one: {}", names.join(", "))))
            }
        },
    }
}
