//! A piece to batches.

use std::io::Read;
use std::ops::ControlFlow;

use super::decompress::{self, Decompressor, Stop};
use super::file::LasScan;
use super::kernels;
use super::laszip::LaszipRecord;
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
    let Scratch { raw, decoded, batch } = scratch;
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
    match scan.plan.storage {
        Storage::Records => Ok(()),
        Storage::Layered => laz.layered(raw, decoded, &mut out),
        Storage::Chunk => laz.chunk(raw, decoded, &mut out),
        Storage::Stream { chunk_points } => laz.stream(chunk_points, decoded, &mut out),
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
    /// `records`: whole ones, at most [`Self::batch_points`].
    fn emit(&mut self, records: &[u8]) -> ControlFlow<()> {
        if records.is_empty() {
            return ControlFlow::Continue(());
        }
        kernels::resize(records.len() / self.record_len, &self.schema.fields, self.wanted, self.batch);
        kernels::fill(records, self.record_len, 0, &self.schema.fields, self.wanted, self.batch);
        self.hand_over()
    }

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
    fn pump<R>(
        &mut self,
        decompressor: &mut Decompressor<'_, R>,
        points: u64,
        decoded: &mut Vec<u8>,
    ) -> Result<ControlFlow<()>, Stop> {
        let mut left = points;
        while left > 0 {
            let n = left.min(self.batch_points);
            let len = n as usize * self.record_len;
            if decoded.len() < len {
                resize(decoded, len);
            }
            let (good, result) = decompressor.fill(&mut decoded[..len]);
            // what was decoded before corruption showed is not to be trusted; before the end of the bytes it is
            let keep = if matches!(result, Err(Stop::Corrupt(_))) { 0 } else { good };
            if self.emit(&decoded[..keep * self.record_len]).is_break() {
                return Ok(ControlFlow::Break(()));
            }
            result?;
            left -= n;
        }
        Ok(ControlFlow::Continue(()))
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
    fn layered(&self, raw: &mut Vec<u8>, decoded: &mut Vec<u8>, out: &mut Emitter<'_, '_>) -> Result<(), ReadError> {
        let Piece { points, byte_offset, byte_len, .. } = *self.piece;
        let bytes = self.scan.source.slice_at(byte_offset, byte_len, raw)?;
        let layout = self.scan.layout(self.laszip);
        let selection = decompress::selection(&self.scan.schema, out.wanted);
        Decompressor::layered(&self.laszip.items, layout, selection, bytes, points)
            .and_then(|mut d| out.pump(&mut d, points, decoded))
            .map(drop)
            // the layers lie inside the chunk: one that ends early is damaged, not cut
            .map_err(|stop| self.error(out, if stop == Stop::CutShort { corrupt("a layer ends early") } else { stop }))
    }

    fn chunk(&self, raw: &mut Vec<u8>, decoded: &mut Vec<u8>, out: &mut Emitter<'_, '_>) -> Result<(), ReadError> {
        let Piece { byte_offset, byte_len, .. } = *self.piece;
        if byte_len > MAX_CHUNK_IN_MEMORY {
            return self.sequential(self.scan.source.reader(byte_offset, byte_offset + byte_len), None, decoded, out);
        }
        let bytes = self.scan.source.slice_at(byte_offset, byte_len, raw)?;
        self.sequential(bytes, None, decoded, out)
    }

    fn stream(
        &self,
        chunk_points: Option<u32>,
        decoded: &mut Vec<u8>,
        out: &mut Emitter<'_, '_>,
    ) -> Result<(), ReadError> {
        let Piece { byte_offset, byte_len, .. } = *self.piece;
        self.sequential(self.scan.source.reader(byte_offset, byte_offset + byte_len), chunk_points, decoded, out)
    }

    /// Records one after the other; a chunk ends after `chunk_points` points and the next one follows at once (the
    /// encoder pads each chunk so that the decoder stops reading at its last byte).
    fn sequential<R: Read>(
        &self,
        mut reader: R,
        chunk_points: Option<u32>,
        decoded: &mut Vec<u8>,
        out: &mut Emitter<'_, '_>,
    ) -> Result<(), ReadError> {
        let mut left = self.piece.points;
        while left > 0 {
            let n = left.min(chunk_points.map_or(u64::MAX, u64::from));
            let mut decompressor = Decompressor::sequential(&self.laszip.items, self.scan.record_len, reader)
                .map_err(|stop| self.error(out, stop))?;
            let flow = out.pump(&mut decompressor, n, decoded).map_err(|stop| self.error(out, stop))?;
            if flow.is_break() {
                return Ok(());
            }
            left -= n;
            reader = decompressor.into_inner();
        }
        Ok(())
    }

    fn error(&self, out: &Emitter<'_, '_>, stop: Stop) -> ReadError {
        let Piece { first_point, points, byte_offset, byte_len } = *self.piece;
        let decoded = out.next_point - first_point;
        let pieces = self.scan.plan.pieces.len();
        let (why, advice) = match stop {
            Stop::CutShort => ("the bytes end".to_owned(), Advice::CutShort),
            Stop::Corrupt(why) => (why, Advice::Damaged),
        };
        let (piece, bytes) = (self.index, byte_len);
        let fault = Fault::Decode { piece, pieces, bytes, decoded, points, why };
        ReadError::broken(self.scan.source.path(), byte_offset, fault).advise(advice)
    }
}

fn corrupt(why: &str) -> Stop {
    Stop::Corrupt(why.to_owned())
}
