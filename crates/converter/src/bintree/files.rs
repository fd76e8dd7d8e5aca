//! Where the bytes of leaves go: one file each, or one for all.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use pointmill_format::bintree::{Layout, PACKED_FILE, leaf_file_name};
use pointmill_format::bytes::write_all_at;

use crate::error::ConvertError;
use crate::write::dataset::StagedDataset;

/// The leaves of a dataset; any number of threads put them.
pub(super) struct Leaves<'a> {
    staged: &'a StagedDataset,
    stride: u64,
    packed: Option<(File, PathBuf)>,
    /// Files of leaves, to be synced when all are written: writeback is then on its way.
    written: Mutex<Vec<PathBuf>>,
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
        if let Some((file, path)) = &self.packed {
            let at = start * self.stride;
            write_all_at(file, records, at).map_err(|e| ConvertError::io(path, "writing a leaf", e))?;
            return Ok(Some(at));
        }
        let (mut file, path) = self.staged.create(&leaf_file_name(path.iter().copied()))?;
        file.write_all(records).map_err(|e| ConvertError::io(&path, "writing a leaf", e))?;
        if let Ok(mut written) = self.written.lock() {
            written.push(path);
        }
        Ok(None)
    }

    /// Syncs what was written; returns its bytes.
    pub(super) fn finish(self, pool: &rayon::ThreadPool) -> Result<u64, ConvertError> {
        if let Some((file, path)) = &self.packed {
            file.sync_all().map_err(|e| ConvertError::io(path, "syncing the leaves", e))?;
        }
        let written = self.written.into_inner().unwrap_or_default();
        let next = AtomicUsize::new(0);
        let results = pool.broadcast(|_| {
            while let Some(path) = written.get(next.fetch_add(1, Ordering::Relaxed)) {
                let sync = || File::open(path)?.sync_all();
                sync().map_err(|e| ConvertError::io(path, "syncing a leaf", e))?;
            }
            Ok(())
        });
        results.into_iter().collect::<Result<(), ConvertError>>()?;
        Ok(self.bytes.into_inner())
    }
}
