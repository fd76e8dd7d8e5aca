//! What a dataset says of itself, in the words of scans.

use std::path::{Path, PathBuf};

use crate::scan::DatasetNote;
use crate::{Aabb, Crs, Lattice, ReadError, ScanInfo, ScanWarning};

use super::columns::Columns;

/// What the formats have to say beside their nodes.
pub(super) struct Described {
    pub(super) path: PathBuf,
    /// For people: "Potree 2.0, BROTLI".
    pub(super) format: String,
    /// Where the points are.
    pub(super) bounds: Option<Aabb>,
    /// What all positions are on; `None`: they become world coordinates, stored in steps of `step`.
    pub(super) lattice: Option<Lattice>,
    /// World units of a stored step.
    pub(super) step: [f64; 3],
    pub(super) columns: Columns,
    pub(super) crs: Crs,
    pub(super) rgb_is_16_bit: bool,
    /// Bytes of all files.
    pub(super) bytes: u64,
    pub(super) warnings: Vec<ScanWarning>,
    /// Memory that decoding takes beside the points of a node.
    pub(super) memory: NodeMemory,
}

/// Memory that decoding a node takes.
#[derive(Debug, Clone, Copy)]
pub(super) struct NodeMemory {
    /// Bytes a point, whatever is stored of it: unpacked, and as columns.
    pub(super) per_point: u64,
    /// What a decompressor keeps.
    pub(super) decompressor: u64,
}

impl Described {
    /// The description of the scan of `points` points.
    pub(super) fn info(&self, points: u64) -> ScanInfo {
        let mut info = ScanInfo::new(&self.path, &self.format, points);
        info.bounds_declared =
            self.bounds.filter(|b| !b.is_empty() && b.min.iter().chain(&b.max).all(|v| v.is_finite()));
        info.lattice = self.lattice;
        info.resolution = self.step.map(crate::Resolution::Step);
        info.attributes = self.columns.attributes();
        info.rgb_is_16_bit = self.rgb_is_16_bit;
        info.crs.clone_from(&self.crs);
        info.file_bytes = self.bytes;
        info.warnings.clone_from(&self.warnings);
        info
    }

    /// Notes that the description counts other points than the nodes have.
    pub(super) fn compare_count(&mut self, declared: Option<u64>, found: u64) {
        if let Some(declared) = declared.filter(|declared| *declared != found) {
            self.warnings.push(ScanWarning::Dataset(DatasetNote::PointsDiffer { declared, found }));
        }
    }
}

/// An error of a reader of datasets, with advice.
pub(super) fn advised(error: ReadError) -> ReadError {
    match error.kind() {
        crate::ErrorKind::Broken if error.advice().is_none() => error.advise("copy or convert the dataset again"),
        _ => error,
    }
}

/// The bytes of a file; 0 if there is none.
pub(super) fn file_bytes(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |meta| meta.len())
}
