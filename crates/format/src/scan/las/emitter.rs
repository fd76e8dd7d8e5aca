//! Records to batches.

use std::ops::ControlFlow;

use super::decompress::Decompressor;
use super::kernels;
use super::laz::Stop;
use super::schema::Schema;
use crate::scan::decode::resize;
use crate::scan::source::Source;
use crate::{Piece, PointBatch, ReadError, Sink, Wanted};

/// Plain records that are read at once: 139 kB of format 3, so that they are still in the second-level cache when
/// they become columns.
pub(super) const READ_RECORDS: usize = 8 * kernels::BLOCK;

/// Turns records into columns and hands them over.
pub(super) struct Emitter<'a, 's> {
    pub(super) record_len: usize,
    /// Records that become one batch.
    pub(super) batch_points: u64,
    pub(super) schema: &'a Schema,
    pub(super) wanted: &'a Wanted,
    pub(super) next_point: u64,
    pub(super) batch: &'a mut PointBatch,
    pub(super) sink: &'a mut Sink<'s>,
}

impl Emitter<'_, '_> {
    fn hand_over(&mut self) -> ControlFlow<()> {
        self.batch.first_point = self.next_point;
        self.next_point += self.batch.len() as u64;
        (self.sink)(self.batch)
    }

    /// Reads a piece of plain records, a little at a time, and hands it over.
    pub(super) fn records(&mut self, source: &Source, piece: &Piece, raw: &mut Vec<u8>) -> Result<(), ReadError> {
        let mut at = piece.byte_offset;
        let mut left = piece.points;
        while left > 0 {
            let points = left.min(self.batch_points) as usize;
            kernels::resize(points, &self.schema.fields, self.wanted, self.batch);
            for first in (0..points).step_by(READ_RECORDS) {
                let len = (points - first).min(READ_RECORDS) * self.record_len;
                let bytes = source.slice_at(at, len as u64, raw)?;
                kernels::fill(bytes, self.record_len, first, &self.schema.fields, self.wanted, self.batch);
                at += len as u64;
            }
            if self.hand_over().is_break() {
                return Ok(());
            }
            left -= points as u64;
        }
        Ok(())
    }

    /// Decodes `points` points and hands them over, until the sink breaks.
    pub(super) fn pump(
        &mut self,
        decompressor: &mut Decompressor<'_, '_>,
        points: u64,
        decoded: &mut Vec<u8>,
    ) -> Result<ControlFlow<()>, Stop> {
        let mut left = points;
        while left > 0 {
            let n = left.min(self.batch_points) as usize;
            let (good, result) = self.batch(decompressor, n, decoded);
            // what was decoded before corruption showed is not to be trusted; before the end of the bytes it is
            let keep = if result.as_ref().is_err_and(|stop| !stop.is_honest()) { 0 } else { good };
            if keep < n {
                kernels::resize(keep, &self.schema.fields, self.wanted, self.batch);
            }
            if keep > 0 && self.hand_over().is_break() {
                return Ok(ControlFlow::Break(()));
            }
            result?;
            left -= n as u64;
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Decodes up to `points` points to the batch, so many records at once as stay in the first-level cache.
    fn batch(
        &mut self,
        decompressor: &mut Decompressor<'_, '_>,
        points: usize,
        decoded: &mut Vec<u8>,
    ) -> (usize, Result<(), Stop>) {
        let most = points.min(kernels::BLOCK) * self.record_len;
        if decoded.len() < most {
            resize(decoded, most);
        }
        kernels::resize(points, &self.schema.fields, self.wanted, self.batch);
        let mut good = 0;
        while good < points {
            let block = (points - good).min(kernels::BLOCK);
            let (more, result) = decompressor.fill(&mut decoded[..block * self.record_len]);
            let records = &decoded[..more * self.record_len];
            kernels::fill(records, self.record_len, good, &self.schema.fields, self.wanted, self.batch);
            good += more;
            if result.is_err() {
                return (good, result);
            }
        }
        (good, Ok(()))
    }
}
