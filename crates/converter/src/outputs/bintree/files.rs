//! Where the bytes of leaves go: one file each, or one for all.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use pointmill_format::bintree::{Layout, PACKED_FILE, leaf_file_name};
use serde::{Deserialize, Serialize};

use crate::error::ConvertError;
use crate::job::{self, InPlace};
use crate::outputs::staging::{OutputFile, StagedDataset};
use crate::runtime::Runtime;

const WRITING: &str = "writing a leaf";

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

/// A leaf, as the nodes tell.
pub(super) struct Leaf {
    pub(super) path: Vec<bool>,
    /// Points in the leaves before it, and its own.
    pub(super) start: u64,
    pub(super) points: u64,
}

impl Place {
    /// True if so many points of it are in one of the leaves, which are in order.
    pub(super) fn is_in(&self, leaves: &[Leaf], points: u64) -> bool {
        let leaf = leaves.binary_search_by_key(&self.start, |leaf| leaf.start).ok().and_then(|at| leaves.get(at));
        let is_inside = |leaf: &&Leaf| self.from.checked_add(points).is_some_and(|end| end <= leaf.points);
        leaf.filter(is_inside).is_some_and(|leaf| leaf.path == self.path)
    }

    /// Points in the leaves before it, and in its own before this part.
    pub(super) fn first_point(&self) -> u64 {
        self.start + self.from
    }

    /// Where it begins in its file.
    pub(super) fn offset(&self, stride: u64, is_packed: bool) -> u64 {
        stride * if is_packed { self.first_point() } else { self.from }
    }

    /// The leaf, if each has a file of its own.
    fn file_name(&self) -> String {
        leaf_file_name(self.path.iter().copied())
    }
}

impl InPlace<Place> for Leaves<'_> {
    fn write(&self, place: &Place, records: &[u8]) -> Result<u64, ConvertError> {
        let at = place.offset(self.stride, self.is_packed);
        match &self.to {
            To::Unit(_) => return Err(ConvertError::Internal("a unit holds no leaves".into())),
            To::File(to) => {
                to.file.write_at(records, at, WRITING)?;
                return Ok(at);
            }
            To::Files { staged, .. } if place.from > 0 => {
                staged.open(&place.file_name())?.write_at(records, at, WRITING)
            }
            To::Files { staged, .. } => {
                let OutputFile { file, .. } = staged.create_kept(&place.file_name())?;
                file.set_len(0, WRITING)?;
                file.write_at(records, 0, WRITING)
            }
        }?;
        Ok(at)
    }

    fn holds(&self, place: &Place, at: &job::Place) -> Result<bool, ConvertError> {
        let holds = |file: &OutputFile| file.kept(0).map_or(Ok(false), |kept| kept.holds(at));
        match &self.to {
            To::Unit(_) => Ok(false),
            To::File(file) => holds(file),
            To::Files { staged, .. } => holds(&staged.create_kept(&place.file_name())?),
        }
    }
}

impl<'a> Leaves<'a> {
    pub(super) fn new(layout: Layout, stride: usize, staged: &'a StagedDataset) -> Result<Self, ConvertError> {
        let to = match layout {
            Layout::Packed => To::File(staged.past_cache(PACKED_FILE, staged.create_kept(PACKED_FILE)?)),
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
        let place = Place { path: path.to_vec(), start, from };
        if let To::Unit(put) = &self.to {
            return put(place, records);
        }
        self.write(&place, records)?;
        self.count(&place, records.len() as u64);
        Ok(())
    }

    /// Counts bytes that are there.
    fn count(&self, place: &Place, bytes: u64) {
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
        if let (To::Files { written, .. }, 0) = (&self.to, place.from) {
            written.lock().unwrap_or_else(PoisonError::into_inner).push(place.file_name());
        }
    }

    /// Takes over leaves of a unit that are there already: where each part begins in its file, and its bytes.
    pub(super) fn take(&self, parts: &[(Place, u64, u64)]) -> Result<(), ConvertError> {
        let mut ends: BTreeMap<String, u64> = BTreeMap::new();
        for (place, offset, bytes) in parts {
            self.count(place, *bytes);
            let end = ends.entry(place.file_name()).or_default();
            *end = (*end).max(offset + bytes);
        }
        let To::Files { staged, .. } = &self.to else { return Ok(()) };
        // a run before may have left more
        ends.iter().try_for_each(|(name, end)| staged.open(name)?.set_len(*end, "ending a leaf"))
    }

    /// Where units of a job put leaves at once, so that they outlive the run.
    pub(super) fn in_place(&self) -> Option<&dyn InPlace<Place>> {
        let is_kept = match &self.to {
            To::Unit(_) => false,
            To::File(file) => file.kept(0).is_some(),
            To::Files { staged, .. } => staged.can_keep(),
        };
        is_kept.then_some(self)
    }

    /// True if all leaves are in one file.
    pub(super) fn is_packed(&self) -> bool {
        self.is_packed
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
