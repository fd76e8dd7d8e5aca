//! How much memory decoding takes.

use super::ahead::is_small;
use super::compressed::MAX_CHUNK_IN_MEMORY;
use super::emitter::READ_RECORDS;
use super::file::LasScan;
use super::kernels::BLOCK;
use super::laz::WINDOW;
use super::pieces::Storage;
use crate::scan::decode::{batch_bytes, batch_points, point_bytes};
use crate::{Piece, Wanted};

/// The models of two chunks that are decoded in turn and have met every value in every scanner channel, but for those of
/// extra bytes.
const MODELS: u64 = 4 << 20;
/// What is longer in a record than this may be extra bytes.
const SHORTEST_RECORD: u64 = 20;
/// The models of one extra byte of two chunks.
const EXTRA_BYTE_MODELS: u64 = 12 << 10;

/// [`crate::Scan::decode_bytes`].
pub(super) fn decode_bytes(scan: &LasScan, wanted: &Wanted) -> u64 {
    let most = |of: fn(&Piece) -> u64| scan.plan.pieces.iter().map(of).max().unwrap_or(0);
    let (points, bytes) = (most(|piece| piece.points), most(|piece| piece.byte_len));
    let attributes = &scan.info.attributes;
    let record_len = scan.record_len as u64;
    let points = points.min(batch_points(scan.record_len.max(point_bytes(attributes, true))) as u64);
    let batch = batch_bytes(attributes, true, wanted, points);
    if scan.laszip.is_none() {
        return batch + points.min(READ_RECORDS as u64) * record_len;
    }
    let compressed = match scan.plan.storage {
        Storage::Records => 0,
        Storage::Layered => bytes,
        Storage::Chunk if bytes <= MAX_CHUNK_IN_MEMORY => bytes,
        Storage::Chunk | Storage::Stream { .. } => bytes.min(WINDOW as u64),
    };
    let extra = record_len.saturating_sub(SHORTEST_RECORD);
    batch + compressed + ahead(scan) + points.min(BLOCK as u64) * record_len + MODELS + extra * EXTRA_BYTE_MODELS
}

/// Bytes and records of a chunk that is decoded with the one before.
fn ahead(scan: &LasScan) -> u64 {
    if !matches!(scan.plan.storage, Storage::Layered | Storage::Chunk) {
        return 0;
    }
    let behind = scan.plan.pieces.iter().skip(1).filter(|piece| is_small(piece, scan.record_len));
    behind.map(|piece| piece.byte_len + piece.points * scan.record_len as u64).max().unwrap_or(0)
}
