//! Compressed pieces to batches.

use std::ops::ControlFlow;

use super::ahead::{self, Ahead, Chunks, Two};
use super::decompress::{self, Decompressor, LazModels};
use super::emitter::Emitter;
use super::file::LasScan;
use super::laszip::LaszipRecord;
use super::laz::{Input, Layered, LayeredPair, Pair, Parts, Pointwise, Stop};
use super::pieces::Storage;
use crate::scan::decode::resize;
use crate::{Advice, Fault, Piece, ReadError};

/// A chunk larger than this is read through a buffer instead of at once.
pub(super) const MAX_CHUNK_IN_MEMORY: u64 = 64 << 20;

/// Decoding of one compressed piece.
pub(super) struct Compressed<'a, 's> {
    pub(super) scan: &'a LasScan,
    pub(super) laszip: &'a LaszipRecord,
    pub(super) index: usize,
    pub(super) piece: &'a Piece,
    /// What is decoded of layers.
    pub(super) parts: Parts,
    pub(super) out: Emitter<'a, 's>,
    pub(super) models: &'a mut LazModels,
    pub(super) decoded: &'a mut Vec<u8>,
}

impl<'a> Compressed<'a, '_> {
    /// `next`: the piece that will be asked for after this one, if that is known.
    pub(super) fn decode(self, raw: &mut Vec<u8>, next: Option<usize>) -> Result<(), ReadError> {
        let Piece { byte_offset, byte_len, .. } = *self.piece;
        let storage = self.scan.plan.storage;
        match storage {
            Storage::Records => return Ok(()),
            Storage::Stream { chunk_points } => return self.stream(chunk_points),
            Storage::Chunk if byte_len > MAX_CHUNK_IN_MEMORY => return self.stream(None),
            Storage::Chunk | Storage::Layered => {}
        }
        let of = self.name(self.index);
        if let Some(ahead) = self.models.ahead.take_if(|ahead| ahead.of == of) {
            return self.hand_over(ahead);
        }
        let second = next.and_then(|next| self.behind(next));
        let bytes = self.scan.source.slice_at(byte_offset, byte_len + second.map_or(0, |piece| piece.byte_len), raw)?;
        let (first, behind) = bytes.split_at(bytes.len().min(byte_len as usize));
        match second {
            Some(second) => self.two(storage, second, [first, behind]),
            None => self.one(storage, first),
        }
    }

    /// What a piece is known by.
    fn name(&self, index: usize) -> (u64, usize, Parts) {
        (self.scan.id, index, self.parts)
    }

    /// The piece `next`, if it is the one behind this one and may be decoded ahead.
    fn behind(&self, next: usize) -> Option<&'a Piece> {
        let scan = self.scan;
        let piece = scan.plan.pieces.get(next).filter(|_| next == self.index + 1)?;
        let is_behind = piece.byte_offset == self.piece.byte_offset + self.piece.byte_len
            && piece.byte_offset + piece.byte_len <= self.scan.source.len();
        (is_behind && ahead::is_small(piece, self.scan.record_len)).then_some(piece)
    }

    /// Hands over what was decoded with the piece before.
    fn hand_over(mut self, mut ahead: Ahead) -> Result<(), ReadError> {
        let mut decompressor = Decompressor::Ahead(ahead.reader(self.scan.record_len));
        let pumped = self.out.pump(&mut decompressor, self.piece.points, self.decoded);
        self.models.spare = ahead.records;
        pumped.map(drop).map_err(|stop| self.error(stop))
    }

    fn one(mut self, storage: Storage, bytes: &[u8]) -> Result<(), ReadError> {
        if storage != Storage::Layered {
            return self.pointwise(Input::Whole(bytes), None);
        }
        let points = self.piece.points;
        decompress::check_layered(self.scan.layout(self.laszip), bytes, points)
            .and_then(|()| Layered::new(self.models.layered(&self.laszip.items), bytes, self.parts))
            .map(Decompressor::Layered)
            .and_then(|mut decompressor| self.out.pump(&mut decompressor, points, self.decoded))
            .map(drop)
            .map_err(|stop| self.error(stop))
    }

    /// Decodes this piece, and the one behind it ahead.
    fn two(mut self, storage: Storage, second: &Piece, chunks: [&[u8]; 2]) -> Result<(), ReadError> {
        let (record_len, items) = (self.scan.record_len, &self.laszip.items);
        let mut records = std::mem::take(&mut self.models.spare);
        resize(&mut records, second.points as usize * record_len);
        let ahead = Ahead { of: self.name(self.index + 1), records, good: 0, result: Ok(()) };
        let pair = match storage {
            Storage::Layered => {
                let layout = self.scan.layout(self.laszip);
                let mut pieces = chunks.into_iter().zip([self.piece, second]);
                let is_sound = |(chunk, piece): (&[u8], &Piece)| decompress::check_layered(layout, chunk, piece.points);
                // a chunk that is not sound has its error alone
                match pieces.try_for_each(is_sound) {
                    Ok(()) => LayeredPair::new(self.models.layered(items), chunks, self.parts).map(Chunks::Layered),
                    Err(stop) => Err(stop),
                }
            }
            _ => Ok(Chunks::Pointwise(Pair::new(self.models.pointwise(items), chunks))),
        };
        let Ok(pair) = pair else { return self.one(storage, chunks[0]) };
        let mut decompressor = Decompressor::Two(Two::new(pair, record_len, ahead));
        let pumped = self.out.pump(&mut decompressor, self.piece.points, self.decoded);
        if let (Ok(ControlFlow::Continue(())), Decompressor::Two(two)) = (&pumped, decompressor) {
            self.models.ahead = Some(two.finish());
        }
        pumped.map(drop).map_err(|stop| self.error(stop))
    }

    fn stream(self, chunk_points: Option<u32>) -> Result<(), ReadError> {
        let Piece { byte_offset, byte_len, .. } = *self.piece;
        let input = Input::of_file(&self.scan.source, byte_offset, byte_offset + byte_len);
        self.pointwise(input, chunk_points)
    }

    /// Records one after the other; a chunk ends after `chunk_points` points and the next one follows at once (the
    /// encoder pads each chunk so that the decoder stops reading at its last byte).
    fn pointwise(mut self, input: Input<'_>, chunk_points: Option<u32>) -> Result<(), ReadError> {
        let models = self.models.pointwise(&self.laszip.items);
        let mut decompressor = Decompressor::Pointwise(Pointwise::new(models, input));
        let mut left = self.piece.points;
        while left > 0 {
            let n = left.min(chunk_points.map_or(u64::MAX, u64::from));
            match self.out.pump(&mut decompressor, n, self.decoded) {
                Ok(ControlFlow::Continue(())) => left -= n,
                Ok(ControlFlow::Break(())) => return Ok(()),
                Err(stop) => return Err(self.error(stop)),
            }
            decompressor.next_chunk();
        }
        Ok(())
    }

    fn error(&self, stop: Stop) -> ReadError {
        let Piece { first_point, points, byte_offset, byte_len } = *self.piece;
        let decoded = self.out.next_point - first_point;
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
