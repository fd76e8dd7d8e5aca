//! The chunk of one node.

use std::sync::{Mutex, PoisonError};

use pointmill_format::scan::las::write::{ChunkEncoder, Tally};
use pointmill_format::{Changes, DatasetKind, NodeKey};

use serde::{Deserialize, Serialize};

use super::content::Content;
use crate::cloud::{Checksum, copy_record};
use crate::error::{ConvertError, Unsupported};
use crate::job::encode;
use crate::octree::NodeEncoder;
use crate::runtime::Events;

/// Points, and bytes, that an entry of the hierarchy can say.
const MOST: usize = i32::MAX as usize;

/// The memory of a node up to this size is kept for the next one; that of larger ones was reserved for them.
const KEPT_BYTES: usize = 4 << 20;

/// What all nodes share.
pub(super) struct Encoding<'a> {
    pub(super) content: Content,
    pub(super) chunks: ChunkEncoder,
    pub(super) counted: Mutex<Counted>,
    pub(super) events: &'a dyn Events,
}

/// What was counted.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Counted {
    pub(super) tally: Tally,
    /// Values that do not fit, by attribute that is kept.
    pub(super) changes: Vec<Changes>,
}

impl Counted {
    pub(super) fn merge(&mut self, other: &Self) {
        self.tally.merge(&other.tally);
        self.changes.resize(self.changes.len().max(other.changes.len()), Changes::default());
        self.changes.iter_mut().zip(&other.changes).for_each(|(all, one)| all.merge(one));
    }
}

/// Turns stored records into chunks; one for each thread.
pub(super) struct ChunkMaker<'a> {
    encoding: &'a Encoding<'a>,
    rows: Vec<u8>,
    /// The rows in the order of time.
    sorted: Vec<u8>,
    /// Times as integers of the same order, and where their rows are.
    order: Vec<(u64, u32)>,
    records: Vec<u8>,
    counted: Counted,
}

impl<'a> ChunkMaker<'a> {
    pub(super) fn new(encoding: &'a Encoding<'a>) -> Self {
        let changes = vec![Changes::default(); encoding.content.choice.kept.len()];
        let counted = Counted { tally: Tally::default(), changes };
        Self { encoding, rows: Vec::new(), sorted: Vec::new(), order: Vec::new(), records: Vec::new(), counted }
    }

    /// Puts the rows in the order of GPS time, those of one time as they are: fewer bytes, and what clients expect that select
    /// by time.
    fn sort_by_time(&mut self, at: usize) {
        let stride = self.encoding.content.stored_stride;
        let time = |row: &[u8]| row.get(at..).and_then(<[u8]>::first_chunk::<8>).map_or(0, |b| u64::from_le_bytes(*b));
        self.order.clear();
        self.order.extend(self.rows.chunks_exact(stride).zip(0..).map(|(row, i)| (ascending(time(row)), i)));
        if self.order.is_sorted() {
            return;
        }
        self.order.sort_unstable();
        self.sorted.resize(self.rows.len(), 0);
        for (slot, (_, i)) in self.sorted.chunks_exact_mut(stride).zip(&self.order) {
            copy_record(&self.rows[*i as usize * stride..][..stride], slot);
        }
        std::mem::swap(&mut self.rows, &mut self.sorted);
    }
}

/// The bits of a double as an integer of the same order.
const fn ascending(bits: u64) -> u64 {
    if bits >> 63 == 0 { bits | 1 << 63 } else { !bits }
}

impl Drop for ChunkMaker<'_> {
    fn drop(&mut self) {
        self.encoding.counted.lock().unwrap_or_else(PoisonError::into_inner).merge(&self.counted);
    }
}

impl NodeEncoder for ChunkMaker<'_> {
    fn encode<'r>(
        &mut self,
        _: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
        written: &mut Checksum,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError> {
        let Encoding { content, chunks, events, .. } = self.encoding;
        if events.stop_requested() {
            return Err(ConvertError::Interrupted);
        }
        let (count, stride) = (records.len(), content.stored_stride);
        if count > MOST {
            return Err(Unsupported::CrowdedNode { points: count as u64, max: MOST as u64 }.into());
        }
        self.rows.resize(count * stride, 0);
        self.rows.chunks_exact_mut(stride).zip(records).for_each(|(row, record)| copy_record(record, row));
        written.add_all(&self.rows, stride);
        if let Some(at) = content.time_at {
            self.sort_by_time(at);
        }
        self.records.clear();
        self.records.resize(count * content.layout.record_len(), 0);
        content.put(&mut self.rows, &mut self.records, &mut self.counted.changes);
        self.counted.tally.add(&content.layout, &self.records);
        let chunk = chunks.encode(&self.records).map_err(|e| ConvertError::Internal(format!("LAZ: {e}")))?;
        if chunk.len() > MOST {
            let what = format!("a node of {count} points takes {} bytes; it can have {MOST}", chunk.len());
            return Err(Unsupported::Format { kind: DatasetKind::Copc, what }.into());
        }
        out.extend_from_slice(&chunk);
        if self.rows.capacity() > KEPT_BYTES {
            (self.rows, self.sorted, self.records, self.order) = Default::default();
        }
        Ok(())
    }

    fn take_notes(&mut self) -> Result<Vec<u8>, ConvertError> {
        let changes = vec![Changes::default(); self.counted.changes.len()];
        encode(&std::mem::replace(&mut self.counted, Counted { tally: Tally::default(), changes }))
    }

    fn row_bytes(&self) -> Option<u64> {
        None
    }

    fn bytes_per_point(&self) -> u64 {
        let Content { layout, stored_stride, .. } = &self.encoding.content;
        // the records, their layers, and the chunk that these are put together in; the rows, twice, and their order
        3 * layout.record_len() as u64 + 2 * *stored_stride as u64 + size_of::<(u64, u32)>() as u64
    }
}
