//! Chunks of LAZ and COPC files.

use std::io::{Cursor, Write};

use laz::LazVlr;
use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::record::{LayeredPointRecordCompressor, RecordCompressor, SequentialPointRecordCompressor};

use super::layout::RecordLayout;
use super::records;
use crate::WriteError;

/// Compresses records, each chunk alone: of layers in point formats 6 and above, else record by record. Any number of threads
/// may share one.
pub struct ChunkEncoder {
    vlr: LazVlr,
    record_len: usize,
}

impl std::fmt::Debug for ChunkEncoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ChunkEncoder").field("items", self.vlr.items()).finish_non_exhaustive()
    }
}

impl ChunkEncoder {
    /// Points of a usual chunk, and the most that [`Self::encode`] is meant for: programs read chunks as a whole.
    pub const POINTS: usize = 50_000;

    /// For records of that layout.
    ///
    /// # Errors
    /// More extra bytes than LAZ readers take.
    pub fn new(layout: &RecordLayout) -> Result<Self, WriteError> {
        Self::of_format(layout.point_format(), layout.extra_bytes().iter().map(crate::Attribute::size).sum())
    }

    /// For records of that point format with that many extra bytes.
    ///
    /// # Errors
    /// More than 2048 extra bytes.
    pub fn of_format(point_format: u8, extra_bytes: usize) -> Result<Self, WriteError> {
        let extra = u16::try_from(extra_bytes).ok().filter(|bytes| *bytes <= 2048);
        let extra = extra.ok_or_else(|| {
            WriteError::input(format!("{extra_bytes} extra bytes a point; compressed points have 2048"))
        })?;
        let vlr = LazVlr::from_buffer(records::laszip(point_format, extra)).map_err(|e| failed(&e))?;
        let record_len = usize::try_from(vlr.items_size()).unwrap_or(usize::MAX);
        Ok(Self { vlr, record_len })
    }

    /// The chunk of these records, at least one.
    ///
    /// # Errors
    /// Bytes that are no whole records, or none.
    pub fn encode(&self, records: &[u8]) -> Result<Vec<u8>, WriteError> {
        if records.is_empty() || !records.len().is_multiple_of(self.record_len) {
            return Err(WriteError::input(format!("{} bytes are no records of {}", records.len(), self.record_len)));
        }
        let out = Vec::with_capacity(records.len() / 2);
        if self.vlr.items()[0].version() < 3 {
            compress(SequentialPointRecordCompressor::new(Cursor::new(out)), &self.vlr, self.record_len, records)
        } else {
            compress(LayeredPointRecordCompressor::new(Cursor::new(out)), &self.vlr, self.record_len, records)
        }
    }

    /// The chunk table: points and bytes of each chunk, in the order of the file.
    ///
    /// # Errors
    /// Never, as far as is known.
    pub fn table(&self, chunks: &[(u32, u32)]) -> Result<Vec<u8>, WriteError> {
        let mut table = ChunkTable::with_capacity(chunks.len());
        for (points, bytes) in chunks {
            table.push(ChunkTableEntry { point_count: u64::from(*points), byte_count: u64::from(*bytes) });
        }
        let mut out = Vec::new();
        table.write_to(&mut out, &self.vlr).map_err(WriteError::Io)?;
        Ok(out)
    }
}

fn compress<W: RecordCompressor<Cursor<Vec<u8>>>>(
    mut encoder: W,
    vlr: &LazVlr,
    record_len: usize,
    records: &[u8],
) -> Result<Vec<u8>, WriteError> {
    encoder.set_fields_from(vlr.items()).map_err(|e| failed(&e))?;
    for record in records.chunks_exact(record_len) {
        encoder.compress_next(record).map_err(WriteError::Io)?;
    }
    encoder.done().map_err(WriteError::Io)?;
    encoder.get_mut().flush().map_err(WriteError::Io)?;
    Ok(Box::new(encoder).box_into_inner().into_inner())
}

fn failed(error: &laz::LasZipError) -> WriteError {
    WriteError::Compress(error.to_string())
}
