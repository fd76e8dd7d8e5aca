//! A piece to batches.

use std::ops::ControlFlow;

use super::ahead::{self, Ahead, Two};
use super::decompress::{self, Decompressor, LazModels};
use super::file::LasScan;
use super::kernels;
use super::laszip::LaszipRecord;
use super::laz::{Input, Pointwise, Stop};
use super::pieces::Storage;
use super::schema::Schema;
use crate::scan::decode::{batch_points, fitting_batch, point_bytes, resize};
use crate::scan::source::Source;
use crate::{Advice, Fault, Piece, PointBatch, ReadError, Scratch, Sink, Wanted};

/// A chunk larger than this is read through a buffer instead of at once.
pub(super) const MAX_CHUNK_IN_MEMORY: u64 = 64 << 20;

/// Plain records that are read at once: 139 kB of format 3, so that they are still in the second-level cache when
/// they become columns.
pub(super) const READ_RECORDS: usize = 8 * kernels::BLOCK;

/// [`crate::Scan::decode`].
pub(super) fn piece(
    scan: &LasScan,
    index: usize,
    wanted: &Wanted,
    scratch: &mut Scratch,
    sink: &mut Sink<'_>,
) -> Result<(), ReadError> {
    let Some(piece) = scan.plan.pieces.get(index) else {
        let fault = Fault::NoSuchPiece { piece: index, pieces: scan.plan.pieces.len() };
        return Err(ReadError::unsupported(scan.source.path(), fault));
    };
    let Scratch { raw, decoded, batch, next_piece, kept } = scratch;
    let next = next_piece.take();
    let batch = fitting_batch(batch, &scan.info.attributes, true);
    let mut out = Emitter {
        record_len: scan.record_len,
        batch_points: batch_points(scan.record_len.max(point_bytes(&scan.info.attributes, true))) as u64,
        schema: &scan.schema,
        wanted,
        next_point: piece.first_point,
        batch,
        sink,
    };
    let Some(laszip) = &scan.laszip else {
        return out.records(&scan.source, piece, raw);
    };
    let laz = Laz { scan, laszip, index, piece };
    let mut own = LazModels::default();
    let models = LazModels::of(kept).unwrap_or(&mut own);
    match scan.plan.storage {
        Storage::Records => Ok(()),
        Storage::Layered => laz.layered(models, raw, decoded, &mut out),
        Storage::Chunk => laz.chunk(models, next, raw, decoded, &mut out),
        Storage::Stream { chunk_points } => laz.stream(models, chunk_points, decoded, &mut out),
    }
}

/// Turns records into columns and hands them over.
struct Emitter<'a, 's> {
    record_len: usize,
    /// Records that become one batch.
    batch_points: u64,
    schema: &'a Schema,
    wanted: &'a Wanted,
    next_point: u64,
    batch: &'a mut PointBatch,
    sink: &'a mut Sink<'s>,
}

impl Emitter<'_, '_> {
    fn hand_over(&mut self) -> ControlFlow<()> {
        self.batch.first_point = self.next_point;
        self.next_point += self.batch.len() as u64;
        (self.sink)(self.batch)
    }

    /// Reads a piece of plain records, a little at a time, and hands it over.
    fn records(&mut self, source: &Source, piece: &Piece, raw: &mut Vec<u8>) -> Result<(), ReadError> {
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
    fn pump(
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

/// Decoding of one compressed piece.
struct Laz<'a> {
    scan: &'a LasScan,
    laszip: &'a LaszipRecord,
    index: usize,
    piece: &'a Piece,
}

impl Laz<'_> {
    fn layered(
        &self,
        models: &mut LazModels,
        raw: &mut Vec<u8>,
        decoded: &mut Vec<u8>,
        out: &mut Emitter<'_, '_>,
    ) -> Result<(), ReadError> {
        let Piece { points, byte_offset, byte_len, .. } = *self.piece;
        let bytes = self.scan.source.slice_at(byte_offset, byte_len, raw)?;
        let layout = self.scan.layout(self.laszip);
        let parts = decompress::parts(&self.scan.schema, out.wanted);
        Decompressor::layered(models.layered(&self.laszip.items), layout, parts, bytes, points)
            .and_then(|mut decompressor| out.pump(&mut decompressor, points, decoded))
            .map(drop)
            .map_err(|stop| self.error(out, stop))
    }

    fn chunk(
        &self,
        models: &mut LazModels,
        next: Option<usize>,
        raw: &mut Vec<u8>,
        decoded: &mut Vec<u8>,
        out: &mut Emitter<'_, '_>,
    ) -> Result<(), ReadError> {
        let of = (self.scan.id, self.index);
        if let Some(mut ahead) = models.ahead.take_if(|ahead| ahead.of == of) {
            let mut decompressor = Decompressor::Ahead(ahead.reader(), self.scan.record_len);
            let pumped = out.pump(&mut decompressor, self.piece.points, decoded);
            models.spare = ahead.records;
            return pumped.map(drop).map_err(|stop| self.error(out, stop));
        }
        let Piece { byte_offset, byte_len, .. } = *self.piece;
        if byte_len > MAX_CHUNK_IN_MEMORY {
            return self.stream(models, None, decoded, out);
        }
        if let Some(second) = next.and_then(|next| self.behind(next)) {
            return self.two(models, second, raw, decoded, out);
        }
        let bytes = self.scan.source.slice_at(byte_offset, byte_len, raw)?;
        self.pointwise(models, Input::Whole(bytes), None, decoded, out)
    }

    /// The piece `next`, if it is the one behind this one and may be decoded ahead.
    fn behind(&self, next: usize) -> Option<&Piece> {
        let piece = self.scan.plan.pieces.get(next).filter(|_| next == self.index + 1)?;
        let is_behind = piece.byte_offset == self.piece.byte_offset + self.piece.byte_len;
        let records = piece.points.saturating_mul(self.scan.record_len as u64);
        (is_behind && records.max(piece.byte_len) <= ahead::MOST_BYTES).then_some(piece)
    }

    /// Decodes this piece, and the one behind it ahead.
    fn two(
        &self,
        models: &mut LazModels,
        second: &Piece,
        raw: &mut Vec<u8>,
        decoded: &mut Vec<u8>,
        out: &mut Emitter<'_, '_>,
    ) -> Result<(), ReadError> {
        let Piece { points, byte_offset, byte_len, .. } = *self.piece;
        let bytes = self.scan.source.slice_at(byte_offset, byte_len + second.byte_len, raw)?;
        let (record_len, mut records) = (self.scan.record_len, std::mem::take(&mut models.spare));
        resize(&mut records, second.points as usize * record_len);
        let ahead = Ahead { of: (self.scan.id, self.index + 1), records, good: 0, result: Ok(()) };
        let chunks = bytes.split_at(byte_len as usize);
        let two = Two::new(models.pointwise(&self.laszip.items), record_len, chunks.into(), ahead);
        let mut decompressor = Decompressor::Two(two);
        let pumped = out.pump(&mut decompressor, points, decoded);
        let flow = pumped.map_err(|stop| self.error(out, stop))?;
        if let Decompressor::Two(two) = decompressor
            && flow.is_continue()
        {
            models.ahead = Some(two.finish());
        }
        Ok(())
    }

    fn stream(
        &self,
        models: &mut LazModels,
        chunk_points: Option<u32>,
        decoded: &mut Vec<u8>,
        out: &mut Emitter<'_, '_>,
    ) -> Result<(), ReadError> {
        let Piece { byte_offset, byte_len, .. } = *self.piece;
        let input = Input::of_file(&self.scan.source, byte_offset, byte_offset + byte_len);
        self.pointwise(models, input, chunk_points, decoded, out)
    }

    /// Records one after the other; a chunk ends after `chunk_points` points and the next one follows at once (the
    /// encoder pads each chunk so that the decoder stops reading at its last byte).
    fn pointwise(
        &self,
        models: &mut LazModels,
        input: Input<'_>,
        chunk_points: Option<u32>,
        decoded: &mut Vec<u8>,
        out: &mut Emitter<'_, '_>,
    ) -> Result<(), ReadError> {
        let models = models.pointwise(&self.laszip.items);
        let mut decompressor = Decompressor::Pointwise(Pointwise::new(models, input));
        let mut left = self.piece.points;
        while left > 0 {
            let n = left.min(chunk_points.map_or(u64::MAX, u64::from));
            let flow = out.pump(&mut decompressor, n, decoded).map_err(|stop| self.error(out, stop))?;
            if flow.is_break() {
                return Ok(());
            }
            left -= n;
            decompressor.next_chunk();
        }
        Ok(())
    }

    fn error(&self, out: &Emitter<'_, '_>, stop: Stop) -> ReadError {
        let Piece { first_point, points, byte_offset, byte_len } = *self.piece;
        let decoded = out.next_point - first_point;
        let pieces = self.scan.plan.pieces.len();
        let (at, why, advice) = match stop {
            Stop::CutShort => (byte_len, "the bytes end".to_owned(), Advice::CutShort),
            // the layers lie inside the chunk: one that ends early is damaged, not cut
            Stop::LayerEnds { at, layer } => (at as u64, format!("the layer of {layer} ends early"), Advice::Damaged),
            Stop::Corrupt { at, why } => (at, why, Advice::Damaged),
            Stop::Read(error) => return error,
        };
        let (piece, bytes) = (self.index, byte_len);
        let fault = Fault::Decode { piece, pieces, bytes, decoded, points, why };
        ReadError::broken(self.scan.source.path(), byte_offset + at.min(byte_len), fault).advise(advice)
    }
}
