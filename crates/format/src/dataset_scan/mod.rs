//! Datasets as scans: the points of a dataset are decoded in pieces, as those of any other scan, and a converter need not
//! know where they come from.
//!
//! It stands above the readers of datasets, which know nothing of it. `node_scan.rs` is the scan of them all; a file for
//! each format says what of it becomes which attribute, and on what lattice its positions are.

mod batches;
mod bintree;
mod columns;
#[cfg(feature = "las")]
mod copc;
mod crs;
mod described;
mod node_scan;
mod nodes;
mod octree_nodes;
mod own_key;
mod pieces;
mod placing;
mod potree1;
mod potree2;
mod restored;

use std::path::Path;

use crate::dataset_kind::{DatasetKind, Located};
use crate::{OpenOptions, ReadError, Scan};

/// Opens the dataset that was found, as a scan.
///
/// # Errors
/// Those of its reader; levels are chosen, and it has none.
pub(crate) fn open(located: &Located, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    let path = &located.path;
    match located.kind {
        DatasetKind::Potree2 => potree2::open(path, options),
        DatasetKind::Potree1 => potree1::open(path, options),
        _ if options.has_levels() => Err(no_levels(path)),
        DatasetKind::Bintree => bintree::open(path, options),
        DatasetKind::Batches => batches::open(path),
        DatasetKind::Copc => Err(ReadError::unsupported(path, "a COPC file is read as the LAZ file that it is")),
    }
}

/// Opens a COPC file as the octree that it is, for the levels that `options` choose.
///
/// # Errors
/// Those of its reader.
#[cfg(feature = "las")]
pub(crate) fn open_copc(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    copc::open(path, options)
}

/// What is refused if levels are chosen of something that has none.
pub(crate) fn no_levels(path: &Path) -> ReadError {
    let what = "it has no levels to choose from: it is no octree";
    ReadError::unsupported(path, what).advise("name a Potree or COPC dataset, or read all of it")
}
