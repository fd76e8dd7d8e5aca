//! The records of one node.

use std::sync::{Mutex, PoisonError};

use pointmill_format::batches::eight_bit;
use pointmill_format::potree1::Metadata;
use pointmill_format::{Changes, NodeKey};
use serde::{Deserialize, Serialize};

use super::archive;
use super::content::{COLOUR_BYTES, Colour, Content};
use super::errors::{Meter, Seen};
use super::steps::Steps;
use crate::cloud::{Checksum, copy_record};
use crate::error::ConvertError;
use crate::job::encode;
use crate::octree::NodeEncoder;
use crate::outputs::colour::grey_of;
use crate::runtime::Events;
use crate::sources::POSITION_BYTES;

/// Records are first copied into a small tile: the processor then waits for many scattered records at once.
const TILE_RECORDS: usize = 128;

/// What all nodes share.
pub(super) struct Encoding<'a> {
    pub(super) content: Content,
    pub(super) steps: Steps,
    pub(super) tally: Mutex<Tally>,
    stored_stride: usize,
    meter: Option<Meter>,
    /// What files are called, if nodes have the heads of those of an archive.
    pub(super) archived: Option<Metadata>,
    events: &'a dyn Events,
}

impl<'a> Encoding<'a> {
    /// `meter`: looks at positions that are rounded.
    pub(super) fn new(
        content: Content,
        steps: Steps,
        stored_stride: usize,
        meter: Option<Meter>,
        events: &'a dyn Events,
    ) -> Self {
        Self { content, steps, tally: Mutex::default(), stored_stride, meter, archived: None, events }
    }
}

/// What was counted.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Tally {
    /// By column.
    pub(super) changes: Vec<Changes>,
    pub(super) positions: Seen,
}

/// Turns stored records into those of a node; one for each thread.
pub(super) struct RecordEncoder<'a> {
    encoding: &'a Encoding<'a>,
    tile: Vec<u8>,
    tally: Tally,
}

impl<'a> RecordEncoder<'a> {
    pub(super) fn new(encoding: &'a Encoding<'a>) -> Self {
        let changes = vec![Changes::default(); encoding.content.columns.len()];
        Self { encoding, tile: Vec::new(), tally: Tally { changes, ..Tally::default() } }
    }
}

impl Tally {
    pub(super) fn merge(&mut self, other: &Self) {
        self.changes.resize(self.changes.len().max(other.changes.len()), Changes::default());
        self.changes.iter_mut().zip(&other.changes).for_each(|(all, one)| all.merge(one));
        self.positions.merge(&other.positions);
    }
}

impl Drop for RecordEncoder<'_> {
    fn drop(&mut self) {
        self.encoding.tally.lock().unwrap_or_else(PoisonError::into_inner).merge(&self.tally);
    }
}

impl NodeEncoder for RecordEncoder<'_> {
    fn encode<'r>(
        &mut self,
        key: NodeKey,
        mut records: impl ExactSizeIterator<Item = &'r [u8]>,
        written: &mut Checksum,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError> {
        let Encoding { content, steps, stored_stride, meter, archived, events, .. } = self.encoding;
        if events.stop_requested() {
            return Err(ConvertError::Interrupted);
        }
        let first = out.len();
        let head = archived.as_ref().map(|metadata| archive::begin(metadata, key, out));
        let (stride, steps) = (content.stride, steps.of(key));
        out.reserve(records.len() * stride);
        self.tile.resize(TILE_RECORDS * stored_stride, 0);
        while records.len() > 0 {
            let (start, count) = (out.len(), records.len().min(TILE_RECORDS));
            let tile = &mut self.tile[..count * stored_stride];
            for (slot, record) in tile.chunks_exact_mut(*stored_stride).zip(&mut records) {
                copy_record(record, slot);
            }
            written.add_all(tile, *stored_stride);
            out.resize(start + count * stride, 0);
            let made = &mut out[start..];
            steps.put(tile, made, stride);
            content.colour.put(tile, *stored_stride, made, stride);
            for (column, changes) in content.columns.iter().zip(&mut self.tally.changes) {
                column.source.fill(tile, *stored_stride, made, (column.at, stride), changes);
            }
            if let Some(meter) = meter {
                meter.look(tile, &mut self.tally.positions);
            }
        }
        if let Some(head) = head {
            archive::end(first, head, out);
        }
        Ok(())
    }

    fn take_notes(&mut self) -> Result<Vec<u8>, ConvertError> {
        let changes = vec![Changes::default(); self.tally.changes.len()];
        encode(&std::mem::replace(&mut self.tally, Tally { changes, ..Tally::default() }))
    }

    fn row_bytes(&self) -> Option<u64> {
        Some(self.encoding.content.stride as u64)
    }

    fn head_bytes(&self, key: NodeKey) -> u64 {
        self.encoding.archived.as_ref().map_or(0, |metadata| archive::head_len(metadata, key) as u64)
    }

    fn bytes_per_point(&self) -> u64 {
        self.encoding.content.stride as u64
    }
}

impl Colour {
    /// Puts the colours of `records`, stored back to back, behind the positions of records of `stride` bytes.
    fn put(self, records: &[u8], stored_stride: usize, out: &mut [u8], stride: usize) {
        let colours = out.chunks_exact_mut(stride).filter_map(|record| {
            record.get_mut(POSITION_BYTES..POSITION_BYTES + COLOUR_BYTES)?.first_chunk_mut::<COLOUR_BYTES>()
        });
        let records = records.chunks_exact(stored_stride);
        match self {
            Self::Rgb { at } => {
                for (record, colour) in records.zip(colours) {
                    let channels = record.get(at..).and_then(<[u8]>::first_chunk::<6>);
                    let Some(&[a, b, c, d, e, f]) = channels else { return };
                    let [r, g, b] = [[a, b], [c, d], [e, f]].map(|v| eight_bit(u16::from_le_bytes(v)));
                    *colour = [r, g, b, 255];
                }
            }
            Self::Grey { at, ty, least, greatest } => {
                for (record, colour) in records.zip(colours) {
                    let grey = grey_of(&record[at..], ty, least, greatest);
                    *colour = [grey, grey, grey, 255];
                }
            }
            Self::White => colours.for_each(|colour| *colour = [255; COLOUR_BYTES]),
        }
    }
}
