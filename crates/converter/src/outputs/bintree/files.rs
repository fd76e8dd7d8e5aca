//! Where the bytes of leaves go: one file each, or one for all.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill_format::bintree::{Layout, PACKED_FILE, leaf_file_name};
use serde::{Deserialize, Serialize};

use crate::error::ConvertError;
use crate::job::KeptFile;
use crate::outputs::staging::{OutputFile, StagedDataset};
use crate::runtime::Runtime;

pub(super) const WRITING: &str = "writing a leaf";

/// The leaves of a dataset; any number of threads put them.
pub(super) struct Leaves<'a> {
    stride: u64,
    is_packed: bool,
    to: To<'a>,
    bytes: AtomicU64,
}

/// Where the leaves go.
enum To<'a> {
    /// Into the one file for all.
    File(OutputFile),
    Files {
        staged: &'a StagedDataset,
        /// Names of the files of leaves, to be synced when all are written: write-back is then on its way.
        written: Mutex<Vec<String>>,
    },
    /// Into the file of a unit, to be put into the dataset later.
    Unit(&'a PutPlace<'a>),
}

/// Takes the bytes of a part of a leaf.
pub(super) type PutPlace<'a> = dyn Fn(Place, &[u8]) -> Result<(), ConvertError> + Sync + 'a;

/// A part of a leaf.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Place {
    path: Vec<bool>,
    /// Points in the leaves before it.
    start: u64,
    /// Points of the leaf before this part.
    from: u64,
}

impl Place {
    /// Where it begins in a packed file.
    pub(super) fn offset(&self, stride: u64) -> u64 {
        (self.start + self.from) * stride
    }
}

impl<'a> Leaves<'a> {
    pub(super) fn new(layout: Layout, stride: usize, staged: &'a StagedDataset) -> Result<Self, ConvertError> {
        let to = match layout {
            Layout::Packed => To::File(staged.create_kept(PACKED_FILE)?),
            Layout::Files => To::Files { staged, written: Mutex::default() },
        };
        Ok(Self::to(to, layout, stride))
    }

    /// Into the file of a unit.
    pub(super) fn of_unit(layout: Layout, stride: usize, put: &'a PutPlace<'a>) -> Self {
        Self::to(To::Unit(put), layout, stride)
    }

    fn to(to: To<'a>, layout: Layout, stride: usize) -> Self {
        Self { stride: stride as u64, is_packed: layout == Layout::Packed, to, bytes: AtomicU64::new(0) }
    }

    /// Writes the records of the leaf at the end of `path`, with `start` points in the leaves before it. Returns the byte
    /// where it starts in a packed file.
    pub(super) fn put(&self, path: &[bool], start: u64, records: &[u8]) -> Result<Option<u64>, ConvertError> {
        self.put_part(path, start, 0, records)?;
        Ok(self.start_of(start))
    }

    /// The byte where a leaf with `start` points before it starts in a packed file.
    pub(super) fn start_of(&self, start: u64) -> Option<u64> {
        self.is_packed.then_some(start * self.stride)
    }

    /// [`Self::put`] for a part of the records of a leaf: those after the first `from`. The first part comes first.
    pub(super) fn put_part(&self, path: &[bool], start: u64, from: u64, records: &[u8]) -> Result<(), ConvertError> {
        self.bytes.fetch_add(records.len() as u64, Ordering::Relaxed);
        let (staged, written) = match &self.to {
            To::Unit(put) => return put(Place { path: path.to_vec(), start, from }, records),
            To::File(to) => return to.file.write_at(records, (start + from) * self.stride, WRITING),
            To::Files { staged, written } => (staged, written),
        };
        let name = leaf_file_name(path.iter().copied());
        if from > 0 {
            return staged.open(&name)?.write_at(records, from * self.stride, WRITING);
        }
        staged.create(&name)?.write_at(records, 0, WRITING)?;
        if let Ok(mut written) = written.lock() {
            written.push(name);
        }
        Ok(())
    }

    /// The file, if a job has it, too.
    pub(super) fn kept(&self) -> Option<KeptFile<'_>> {
        match &self.to {
            To::File(file) => file.kept(0),
            _ => None,
        }
    }

    /// Counts bytes that are there already.
    pub(super) fn count(&self, bytes: u64) {
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Bytes of a point.
    pub(super) fn stride(&self) -> u64 {
        self.stride
    }

    /// Puts what a unit has left, `byte` bytes into the part: whole records.
    pub(super) fn put_back(&self, place: &Place, byte: u64, records: &[u8]) -> Result<(), ConvertError> {
        self.put_part(&place.path, place.start, place.from + byte / self.stride, records)
    }

    /// Syncs what was written; returns its bytes.
    pub(super) fn finish(self, rt: &Runtime<'_>) -> Result<u64, ConvertError> {
        match self.to {
            To::Unit(_) => {}
            To::File(OutputFile { file, .. }) => {
                file.set_len(self.bytes.load(Ordering::Relaxed), "ending the leaves")?;
                file.sync("syncing the leaves")?;
            }
            To::Files { staged, written } => {
                let written = written.into_inner().unwrap_or_default();
                staged.sync_all(rt, written.len(), |leaf| written[leaf].clone(), &[])?;
            }
        }
        Ok(self.bytes.into_inner())
    }
}
