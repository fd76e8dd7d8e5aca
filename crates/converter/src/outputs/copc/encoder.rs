//! The chunk of one node.

use std::sync::{Mutex, PoisonError};

use pointmill_format::scan::las::write::{ChunkEncoder, Tally};
use pointmill_format::{Changes, DatasetKind, NodeKey};

use super::content::Content;
use crate::cloud::{Checksum, copy_record};
use crate::error::{ConvertError, Unsupported};
use crate::octree::NodeEncoder;
use crate::runtime::Events;

/// Points, and bytes, that an entry of the hierarchy can say.
const MOST: usize = i32::MAX as usize;

/// What all nodes share.
pub(super) struct Encoding<'a> {
    pub(super) content: Content,
    pub(super) chunks: ChunkEncoder,
    pub(super) counted: Mutex<Counted>,
    pub(super) events: &'a dyn Events,
}

/// What was counted.
#[derive(Debug, Clone, Default)]
pub(super) struct Counted {
    pub(super) tally: Tally,
    /// Values that do not fit, by attribute that is kept.
    pub(super) changes: Vec<Changes>,
}

impl Counted {
    fn merge(&mut self, other: &Self) {
        self.tally.merge(&other.tally);
        self.changes.resize(self.changes.len().max(other.changes.len()), Changes::default());
        self.changes.iter_mut().zip(&other.changes).for_each(|(all, one)| all.merge(one));
    }
}

/// Turns stored records into chunks; one for each thread.
pub(super) struct ChunkMaker<'a> {
    encoding: &'a Encoding<'a>,
    rows: Vec<u8>,
    records: Vec<u8>,
    counted: Counted,
}

impl<'a> ChunkMaker<'a> {
    pub(super) fn new(encoding: &'a Encoding<'a>) -> Self {
        let changes = vec![Changes::default(); encoding.content.choice.kept.len()];
        let counted = Counted { tally: Tally::default(), changes };
        Self { encoding, rows: Vec::new(), records: Vec::new(), counted }
    }
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
        Ok(())
    }

    fn row_bytes(&self) -> Option<u64> {
        None
    }

    fn bytes_per_point(&self) -> u64 {
        // the records, their layers, and the chunk that these are put together in
        3 * self.encoding.content.layout.record_len() as u64 + self.encoding.content.stored_stride as u64
    }
}
