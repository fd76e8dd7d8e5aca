//! Where the bytes of leaves go: one file each, or one for all.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill_format::bintree::{Layout, PACKED_FILE, leaf_file_name};

use crate::error::ConvertError;
use crate::outputs::staging::StagedDataset;
use crate::runtime::{DiskFile, Runtime};

/// The leaves of a dataset; any number of threads put them.
pub(super) struct Leaves<'a> {
    staged: &'a StagedDataset,
    stride: u64,
    packed: Option<DiskFile>,
    /// Names of the files of leaves, to be synced when all are written: write-back is then on its way.
    written: Mutex<Vec<String>>,
    bytes: AtomicU64,
}

impl<'a> Leaves<'a> {
    pub(super) fn new(layout: Layout, stride: usize, staged: &'a StagedDataset) -> Result<Self, ConvertError> {
        let packed = match layout {
            Layout::Packed => Some(staged.create(PACKED_FILE)?),
            Layout::Files => None,
        };
        Ok(Self { staged, stride: stride as u64, packed, written: Mutex::default(), bytes: AtomicU64::new(0) })
    }

    /// Writes the records of the leaf at the end of `path`, with `start` points in the leaves before it. Returns the byte
    /// where it starts in a packed file.
    pub(super) fn put(&self, path: &[bool], start: u64, records: &[u8]) -> Result<Option<u64>, ConvertError> {
        self.bytes.fetch_add(records.len() as u64, Ordering::Relaxed);
        if let Some(file) = &self.packed {
            let at = start * self.stride;
            file.write_at(records, at, "writing a leaf")?;
            return Ok(Some(at));
        }
        let name = leaf_file_name(path.iter().copied());
        self.staged.create(&name)?.write_at(records, 0, "writing a leaf")?;
        if let Ok(mut written) = self.written.lock() {
            written.push(name);
        }
        Ok(None)
    }

    /// The byte where a leaf with `start` points before it starts in a packed file.
    pub(super) fn start_of(&self, start: u64) -> Option<u64> {
        self.packed.as_ref().map(|_| start * self.stride)
    }

    /// [`Self::put`] for a part of the records of a leaf: those after the first `from`. The first part comes first.
    pub(super) fn put_part(&self, path: &[bool], start: u64, from: u64, records: &[u8]) -> Result<(), ConvertError> {
        if self.packed.is_some() || from == 0 {
            return self.put(path, start + from, records).map(drop);
        }
        self.bytes.fetch_add(records.len() as u64, Ordering::Relaxed);
        let file = self.staged.open(&leaf_file_name(path.iter().copied()))?;
        file.write_at(records, from * self.stride, "writing a leaf")
    }

    /// Syncs what was written; returns its bytes.
    pub(super) fn finish(self, rt: &Runtime<'_>) -> Result<u64, ConvertError> {
        if let Some(file) = &self.packed {
            file.sync("syncing the leaves")?;
        }
        let written = self.written.into_inner().unwrap_or_default();
        self.staged.sync_all(rt, written.len(), |leaf| written[leaf].clone(), &[])?;
        Ok(self.bytes.into_inner())
    }
}
