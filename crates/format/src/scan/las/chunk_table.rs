//! The chunks of a LAZ file: from its chunk table, or, for layered chunks, found by walking from one to the next.

use super::bytes::{i64_at, u32_at};
use super::laz::decode_entries;
use crate::ReadError;
use crate::scan::source::Source;

/// Maximum number of empty chunks (some writers close a chunk that they never fill).
const EMPTY_CHUNKS: u64 = 16;

/// Chunks of a file that are read: each is described in memory, and those of 50,000 points would be 10^11 points.
pub(super) const MAX_CHUNKS: u64 = 1 << 21;

/// One chunk, in file order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Chunk {
    pub(super) points: u64,
    pub(super) bytes: u64,
}

/// What a chunk table says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Entries {
    /// In file order. With chunks of a fixed size, each has the most points it can have.
    pub(super) chunks: Vec<Chunk>,
    /// Bytes between the first chunk and the table.
    pub(super) data_bytes: u64,
}

/// Why a chunk table cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct TableFault {
    pub(super) why: String,
    /// The entries, if it has some and they contradict the file.
    pub(super) entries: Option<Entries>,
}

impl From<String> for TableFault {
    fn from(why: String) -> Self {
        Self { why, entries: None }
    }
}

/// What the search for chunks needs to know.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// First byte of the compressed points: the 8-byte offset of the chunk table.
    pub(super) points_start: u64,
    pub(super) record_len: usize,
    /// Points a chunk, the last one excepted; `None` if the table says it for each.
    pub(super) chunk_points: Option<u32>,
    /// Layers of a chunk, 0 if it has none.
    pub(super) layers: usize,
}

impl Layout {
    /// First byte of the first chunk.
    pub(super) fn chunks_start(&self) -> u64 {
        self.points_start + 8
    }

    /// The most points that `bytes` of one chunk can hold.
    ///
    /// The first record is stored as it is. Each further point costs several symbols of adaptive models, whose
    /// likeliest symbol never reaches a probability of 1 (the counts of a model of n symbols sum to 32,768 and none is
    /// 0): more than 0.007 bits per point in every format, which is 1,100 points per byte.
    pub(super) fn max_points(&self, bytes: u64) -> u64 {
        let rest = bytes.saturating_sub(self.record_len as u64);
        if bytes < self.record_len as u64 { 0 } else { rest.saturating_mul(2048).saturating_add(1) }
    }

    /// Reads the chunk table. With chunks of a fixed size the last one's `points` is the most it can have.
    ///
    /// # Errors
    /// Why the table cannot be used; the points may still be whole.
    pub(super) fn read_table(&self, source: &Source) -> Result<Vec<Chunk>, TableFault> {
        let table = self.table_offset(source)?;
        let Entries { mut chunks, data_bytes } = self.read_entries(source, table)?;
        if let Err(why) = self.check(&chunks, data_bytes) {
            return Err(TableFault { why, entries: Some(Entries { chunks, data_bytes }) });
        }
        while chunks.pop_if(|chunk| chunk.points == 0).is_some() {}
        Ok(chunks)
    }

    /// The entries of the table at byte `table`, whatever they say.
    pub(super) fn read_entries(&self, source: &Source, table: u64) -> Result<Entries, TableFault> {
        let head: [u8; 8] = source.array_at(table).map_err(|e| e.what())?;
        let (version, count) = (u32_at(&head, 0), u64::from(u32_at(&head, 4)));
        let data_bytes = table - self.chunks_start();
        if version != 0 || count > data_bytes / self.record_len as u64 + EMPTY_CHUNKS {
            let why = format!("it declares version {version} and {count} chunks in {data_bytes} bytes of points");
            return Err(why.into());
        }
        if count > MAX_CHUNKS {
            return Err(format!("it declares {count} chunks, more than the {MAX_CHUNKS} that are read").into());
        }
        // an entry is two corrected integers of at most 32 bits and their contexts: 16 bytes are ample
        let coded = source.vec_at(table + 8, 16 * count + 64).map_err(|e| e.what())?;
        let chunks = self.decode_entries(&coded, count as usize)?;
        Ok(Entries { chunks, data_bytes })
    }

    /// # Errors
    /// Why `chunks` cannot be those of `data_bytes` bytes.
    pub(super) fn check(&self, chunks: &[Chunk], data_bytes: u64) -> Result<(), String> {
        let last = chunks.len().saturating_sub(1);
        for (i, chunk) in chunks.iter().enumerate() {
            let exact = i < last || self.chunk_points.is_none();
            if chunk.points == 0 {
                continue;
            }
            if chunk.bytes < self.record_len as u64 || (exact && chunk.points > self.max_points(chunk.bytes)) {
                return Err(format!("chunk {i} claims {} points in {} bytes", chunk.points, chunk.bytes));
            }
        }
        match chunks.iter().map(|c| c.bytes).sum::<u64>() {
            sum if sum == data_bytes => Ok(()),
            0 => Err(format!("it has no entries for {data_bytes} bytes of points")),
            sum => Err(format!("its chunks have {sum} bytes, the points {data_bytes}")),
        }
    }

    /// The table's place stands before the points or, if the writer could not go back, in the last 8 bytes.
    fn table_offset(&self, source: &Source) -> Result<u64, String> {
        let fits = |offset: i64| {
            let offset = u64::try_from(offset).ok()?;
            (offset >= self.chunks_start() && offset.checked_add(8)? <= source.len()).then_some(offset)
        };
        let head: [u8; 8] = source.array_at(self.points_start).map_err(|e| e.what())?;
        let first = i64_at(&head, 0);
        if let Some(offset) = fits(first) {
            return Ok(offset);
        }
        let tail: [u8; 8] = source.array_at(source.len().saturating_sub(8)).map_err(|e| e.what())?;
        fits(i64_at(&tail, 0)).ok_or_else(|| match first {
            -1 | 0 => "the file does not say where it is".to_owned(),
            _ => format!("it should be at byte {first} of {}", source.len()),
        })
    }

    fn decode_entries(&self, coded: &[u8], count: usize) -> Result<Vec<Chunk>, String> {
        let entries = decode_entries(coded, count, self.chunk_points.is_none());
        let entries = entries.ok_or("it does not decode: its bytes end, or make no sense")?;
        let chunk = |(points, bytes): (u32, u32)| {
            let points = self.chunk_points.filter(|_| bytes != 0).unwrap_or(points);
            Chunk { points: u64::from(points), bytes: u64::from(bytes) }
        };
        Ok(entries.into_iter().map(chunk).collect())
    }

    /// Finds layered chunks without a table, up to `end` or until `point_limit` points are found. What follows the
    /// last whole chunk is omitted.
    pub(super) fn walk(&self, source: &Source, end: u64, point_limit: u64) -> Result<Vec<Chunk>, ReadError> {
        let (mut at, mut points, mut chunks) = (self.chunks_start(), 0, Vec::new());
        while points < point_limit {
            let Some(chunk) = self.layered_chunk(source, at, end)? else { break };
            if self.chunk_points.is_some_and(|n| chunk.points > u64::from(n)) {
                break;
            }
            if chunks.len() as u64 == MAX_CHUNKS {
                return Err(ReadError::unsupported(
                    source.path(),
                    format!("there are more than {MAX_CHUNKS} chunks in it"),
                )
                .advise("compress it again, with larger chunks"));
            }
            points += chunk.points;
            at += chunk.bytes;
            chunks.push(chunk);
        }
        Ok(chunks)
    }

    /// The layered chunk at `at`, as its head describes it: one record, the count, the layers' sizes.
    pub(super) fn layered_chunk(&self, source: &Source, at: u64, end: u64) -> Result<Option<Chunk>, ReadError> {
        let head_len = self.layered_head_len() as u64;
        if at.checked_add(head_len).is_none_or(|e| e > end.min(source.len())) {
            return Ok(None);
        }
        let head = source.vec_at(at, head_len)?;
        Ok(self.layered_head(&head).filter(|chunk| chunk.bytes <= end - at))
    }

    fn layered_head_len(&self) -> usize {
        self.record_len + 4 + 4 * self.layers
    }

    /// What the head of a layered chunk claims; `None` if it is cut or cannot be true.
    pub(super) fn layered_head(&self, head: &[u8]) -> Option<Chunk> {
        let len = self.layered_head_len();
        let sizes = head.get(self.record_len + 4..len)?;
        let layers: u64 = sizes.chunks_exact(4).map(|size| u64::from(u32_at(size, 0))).sum();
        let chunk = Chunk { points: u64::from(u32_at(head, self.record_len)), bytes: len as u64 + layers };
        (1..=self.max_points(chunk.bytes)).contains(&chunk.points).then_some(chunk)
    }
}
