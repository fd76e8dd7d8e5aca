//! The one door to points, of whatever kind of file or dataset.

use std::path::Path;

use crate::dataset_kind::{DatasetKind, Located, locate};
use crate::scan::{mapped, open_file};
use crate::{OpenOptions, ReadError, Scan, dataset_scan};

/// Opens a scan or a dataset of any kind that this build reads. The kind of a scan is detected from the content, the extension
/// is ignored; that of a dataset by the file that it is known by ([`DatasetKind::detect`]), which may be named, too.
///
/// A COPC file is read as the LAZ file that it is, unless [`OpenOptions::max_level`] or [`OpenOptions::min_spacing`] chooses
/// some of its levels.
///
/// # Errors
/// A file that is empty, or of no kind that is read here, those of the reader of its kind, and of
/// [`OpenOptions::maps`]; levels are chosen of what is no octree.
pub fn open_scan(path: impl AsRef<Path>, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    let scan = open_as_it_is(path.as_ref(), options)?;
    match &options.maps {
        Some(maps) => mapped(scan, &**maps),
        None => Ok(scan),
    }
}

fn open_as_it_is(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    match dataset_at(path) {
        Some(Located { kind: DatasetKind::Copc, path, .. }) => open_copc(&path, options),
        Some(dataset) => dataset_scan::open(&dataset, options),
        None if options.has_levels() => {
            // what is no scan at all says so
            open_file(path, options).and(Err(dataset_scan::no_levels(path)))
        }
        None => open_file(path, options),
    }
}

#[cfg(feature = "las")]
fn open_copc(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    if options.has_levels() { dataset_scan::open_copc(path, options) } else { open_file(path, options) }
}

#[cfg(not(feature = "las"))]
fn open_copc(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    open_file(path, options)
}

/// The dataset that is read as a scan if `path` is named: a folder or its marker file, or an archive.
fn dataset_at(path: &Path) -> Option<Located> {
    DatasetKind::detect(path)?;
    locate(path).ok()
}
