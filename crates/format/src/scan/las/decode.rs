//! A piece to batches.

use super::compressed::Compressed;
use super::decompress::{self, LazModels};
use super::emitter::Emitter;
use super::file::LasScan;
use crate::scan::decode::{batch_points, fitting_batch, point_bytes};
use crate::{Fault, ReadError, Scratch, Sink, Wanted};

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
    let parts = decompress::parts(&scan.schema, wanted);
    let mut own = LazModels::default();
    let models = LazModels::of(kept).unwrap_or(&mut own);
    Compressed { scan, laszip, index, piece, parts, out, models, decoded }.decode(raw, next)
}
