//! Cutting a file into pieces that decode alone.

use super::chunk_table::{Chunk, Layout, TableFault};
use super::decompress;
use super::header::Header;
use super::laszip::{Arrangement, LaszipRecord};
use super::mend::{Mended, Mender};
use super::records::Records;
use crate::scan::source::Source;
use crate::{Advice, Counted, Piece, ReadError, ScanWarning};

/// Records of a LAS piece: 1.7 MB of format 3, one batch.
const LAS_PIECE_POINTS: u64 = 50_000;

/// Chunks whose heads are compared with the table when a file is opened; the others are checked when decoded.
const SAMPLED_CHUNKS: usize = 64;

/// How the bytes of a piece are to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Storage {
    /// Plain records.
    Records,
    /// A layered chunk.
    Layered,
    /// A chunk of records compressed one after the other.
    Chunk,
    /// All points in one piece: chunks of that many points without a table, or one run (`None`).
    Stream { chunk_points: Option<u32> },
}

/// The pieces and how to read them.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) storage: Storage,
    pub(super) pieces: Vec<Piece>,
}

/// Everything about the file that planning looks at.
pub(super) struct Planner<'a> {
    pub(super) source: &'a Source,
    pub(super) header: &'a Header,
    pub(super) records: &'a Records,
    pub(super) warnings: &'a mut Vec<ScanWarning>,
}

impl Planner<'_> {
    /// Plain records.
    pub(super) fn las(&mut self) -> Plan {
        let Header { points_start, record_len, point_count, .. } = *self.header;
        let record_len = record_len as u64;
        let bytes = self.points_end() - points_start;
        let there = bytes / record_len;
        let points = point_count.min(there);
        if there < point_count {
            let (declared, found, counted) = (point_count, there, Counted::Records);
            self.warnings.push(ScanWarning::PointsMissing { declared, found, counted });
        } else if there > point_count {
            let bytes = bytes - point_count * record_len;
            self.warnings.push(ScanWarning::BytesIgnored { declared: point_count, bytes });
        }
        let mut pieces = Vec::new();
        for first_point in (0..points).step_by(LAS_PIECE_POINTS as usize) {
            let points = LAS_PIECE_POINTS.min(points - first_point);
            let byte_offset = points_start + first_point * record_len;
            pieces.push(Piece { first_point, points, byte_offset, byte_len: points * record_len });
        }
        Plan { storage: Storage::Records, pieces }
    }

    /// Compressed points.
    pub(super) fn laz(&mut self, laszip: &LaszipRecord) -> Result<Plan, ReadError> {
        let layout = Layout {
            points_start: self.header.points_start,
            record_len: self.header.record_len,
            chunk_points: laszip.chunk_points,
            layers: laszip.layers(),
        };
        if self.header.point_count == 0 {
            let rest = self.points_end() - layout.points_start;
            // an empty LAZ file has an offset and a table without entries
            if rest > 32 {
                self.warnings.push(ScanWarning::BytesIgnored { declared: 0, bytes: rest });
            }
            return Ok(Plan { storage: Storage::Layered, pieces: Vec::new() });
        }
        match laszip.arrangement {
            Arrangement::Plain => Ok(self.las()),
            Arrangement::Pointwise => Ok(self.stream(layout, layout.points_start, None)),
            Arrangement::Layered => self.layered(layout),
            Arrangement::Chunked => self.chunked(layout, laszip),
        }
    }

    /// Where the points end at the latest: at the EVLRs, if these are sound, else with the file.
    fn points_end(&self) -> u64 {
        let start = self.header.points_start;
        self.records.evlr_start.filter(|evlr| *evlr >= start).unwrap_or(self.source.len()).max(start)
    }

    fn layered(&mut self, layout: Layout) -> Result<Plan, ReadError> {
        let table = layout.read_table(self.source).and_then(|chunks| Ok(self.verify_layered(layout, chunks)?));
        let chunks = match table {
            Ok(chunks) => chunks,
            Err(TableFault { why, .. }) => {
                let chunks = layout.walk(self.source, self.points_end(), self.header.point_count)?;
                self.warnings.push(ScanWarning::ChunkTable { why, chunks: Some(chunks.len()) });
                chunks
            }
        };
        Ok(self.plan(layout, Storage::Layered, &chunks))
    }

    /// Compares the table with what a sample of the chunks, and always the last, say of themselves. The last chunk's
    /// own count replaces the table's.
    fn verify_layered(&self, layout: Layout, mut chunks: Vec<Chunk>) -> Result<Vec<Chunk>, String> {
        let Some(last) = chunks.len().checked_sub(1) else { return Ok(chunks) };
        let step = chunks.len().div_ceil(SAMPLED_CHUNKS);
        let mut at = layout.chunks_start();
        for (i, chunk) in chunks.iter_mut().enumerate() {
            let next = at + chunk.bytes;
            if (i % step == 0 || i == last) && chunk.points > 0 {
                let own = layout.layered_chunk(self.source, at, next).map_err(|e| e.what())?;
                let own = own.ok_or_else(|| format!("no chunk starts at byte {at}"))?;
                let fewer_at_the_end = i == last && layout.chunk_points.is_some() && own.points <= chunk.points;
                if own.bytes != chunk.bytes || (own.points != chunk.points && !fewer_at_the_end) {
                    return Err(format!(
                        "it gives chunk {i} {} points in {} bytes; it has {} in {}",
                        chunk.points, chunk.bytes, own.points, own.bytes
                    ));
                }
                *chunk = own;
            }
            at = next;
        }
        Ok(chunks)
    }

    fn chunked(&mut self, layout: Layout, laszip: &LaszipRecord) -> Result<Plan, ReadError> {
        let mut chunks = match layout.read_table(self.source) {
            Ok(chunks) => chunks,
            Err(fault) => {
                let (source, points, end) = (self.source, self.header.point_count, self.points_end());
                let mended = Mender { source, layout, laszip, points, end }.mend(&fault);
                let TableFault { why, .. } = fault;
                if let Some(Mended { chunks, how }) = mended {
                    self.warnings.push(ScanWarning::ChunkTableMended { why, how });
                    return Ok(self.plan(layout, Storage::Chunk, &chunks));
                }
                let Some(chunk_points) = layout.chunk_points else {
                    let what = format!(
                        "the chunk table is unusable ({why}), and nothing else says where chunks of differing size are"
                    );
                    let broken = ReadError::broken(self.source.path(), layout.points_start, what);
                    return Err(broken.advise(Advice::ExportAgain));
                };
                self.warnings.push(ScanWarning::ChunkTable { why, chunks: None });
                return Ok(self.stream(layout, layout.chunks_start(), Some(chunk_points)));
            }
        };
        if let (Some(full), Some((last, before))) = (layout.chunk_points, chunks.split_last_mut()) {
            let full = u64::from(full);
            let declared = self.header.point_count.saturating_sub(before.len() as u64 * full);
            let possible = 1..=full.min(layout.max_points(last.bytes));
            last.points = if possible.contains(&declared) {
                declared
            } else {
                // the header cannot be right: count
                let at = layout.chunks_start() + before.iter().map(|c| c.bytes).sum::<u64>();
                decompress::count_points(self.source, &laszip.items, at, Chunk { points: full, ..*last })
            };
        }
        Ok(self.plan(layout, Storage::Chunk, &chunks))
    }

    /// Pieces for `chunks`, no more points than the header declares.
    fn plan(&mut self, layout: Layout, storage: Storage, chunks: &[Chunk]) -> Plan {
        let declared = self.header.point_count;
        let there: u64 = chunks.iter().map(|c| c.points).sum();
        if there < declared {
            let counted = Counted::Chunks;
            self.warnings.push(ScanWarning::PointsMissing { declared, found: there, counted });
        } else if there > declared {
            self.warnings.push(ScanWarning::PointsIgnored { declared, found: there });
        }
        let (mut first_point, mut byte_offset) = (0, layout.chunks_start());
        let mut pieces = Vec::with_capacity(chunks.len());
        for chunk in chunks {
            let points = chunk.points.min(declared - first_point);
            if points > 0 {
                pieces.push(Piece { first_point, points, byte_offset, byte_len: chunk.bytes });
            }
            first_point += points;
            byte_offset += chunk.bytes;
        }
        Plan { storage, pieces }
    }

    /// One piece from `byte_offset` to the end.
    fn stream(&mut self, layout: Layout, byte_offset: u64, chunk_points: Option<u32>) -> Plan {
        let declared = self.header.point_count;
        let byte_len = self.points_end().saturating_sub(byte_offset);
        let points = declared.min(layout.max_points(byte_len));
        if points < declared {
            self.warnings.push(ScanWarning::PointsImpossible { declared, bytes: byte_len });
        }
        let pieces =
            if points > 0 { vec![Piece { first_point: 0, points, byte_offset, byte_len }] } else { Vec::new() };
        Plan { storage: Storage::Stream { chunk_points }, pieces }
    }
}
