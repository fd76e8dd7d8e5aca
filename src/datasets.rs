//! The datasets that one conversion has put into its output.

use std::path::Path;

use pointmill_format::{DatasetKind, Located, locate};

/// The datasets in `folder`, each in a folder of its kind's name; none if this is no output of a conversion to several
/// formats.
pub(crate) fn inside(folder: &Path) -> Vec<Located> {
    if !folder.join("report.json").is_file() {
        return Vec::new();
    }
    DatasetKind::ALL.iter().filter_map(|kind| locate(folder.join(kind.name())).ok()).collect()
}
