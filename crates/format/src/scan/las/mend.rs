//! Chunk tables that are wrong in a way that the file itself puts right.
//!
//! Chunks of records without layers have no heads: where they are stands in the table alone. A table that does not add
//! up is mended in the ways in which writers are known to be wrong, and a mended table is believed only if every chunk
//! of a sample, the first and the last ones among them, decodes to exactly its points from exactly its bytes: an encoder
//! pads each chunk so that the decoder stops at its last byte.

use super::chunk_table::{Chunk, Entries, Layout, TableFault};
use super::decompress;
use super::laszip::LaszipRecord;
use crate::scan::source::Source;

/// Chunks that are decoded to prove a table, of each end and in between.
const PROVEN: usize = 3;

/// Points that are decoded for one proof at most: the largest chunks have some 100,000.
const MAX_PROVEN_POINTS: u64 = 1 << 23;

/// A table is searched for in so many bytes before the end of the points: one of 10,000 chunks has 40 kB.
const SEARCHED: u64 = 256 << 10;
/// Entries that are decoded in the search at most, so that no file makes it long.
const MAX_SEARCHED_ENTRIES: u64 = 1 << 20;

/// Tables of more entries are not mended: each way to mend one is a copy.
const MAX_MENDED: usize = 1 << 18;

/// The file whose table is to be mended.
pub(super) struct Mender<'a> {
    pub(super) source: &'a Source,
    pub(super) layout: Layout,
    pub(super) laszip: &'a LaszipRecord,
    /// As the header declares them.
    pub(super) points: u64,
    /// Where the points end at the latest.
    pub(super) end: u64,
}

/// A table that was proven, and what was wrong with it.
pub(super) struct Mended {
    pub(super) chunks: Vec<Chunk>,
    pub(super) how: String,
}

impl Mender<'_> {
    /// The chunks, if one way to mend the table is proven right.
    pub(super) fn mend(&self, fault: &TableFault) -> Option<Mended> {
        let is_small = |entries: &&Entries| entries.chunks.len() <= MAX_MENDED;
        let mut ways: Vec<Mended> =
            fault.entries.iter().filter(is_small).flat_map(|entries| self.corrected(entries)).collect();
        ways.extend(self.found_elsewhere());
        ways.extend(self.one_chunk(fault));
        ways.into_iter().filter_map(|way| self.with_all_points(way)).find(|way| self.is_proven(&way.chunks))
    }

    /// One entry put right so that all together have the bytes that are there.
    fn corrected(&self, entries: &Entries) -> Vec<Mended> {
        let Entries { chunks, data_bytes } = entries;
        let sum: u64 = chunks.iter().map(|c| c.bytes).sum();
        let Some(last) = chunks.iter().rposition(|c| c.points > 0) else { return Vec::new() };
        let with = |index: usize, bytes: u64, how: &str| {
            let mut chunks = chunks.clone();
            chunks[index].bytes = bytes;
            Mended { chunks, how: how.to_owned() }
        };
        let mut ways = Vec::new();
        // whatever else is odd about the table, such as bytes behind the last chunk
        if let Some(bytes) = chunks[0].bytes.checked_sub(self.layout.chunks_start()).filter(|bytes| *bytes > 0) {
            ways.push(with(0, bytes, "its first entry counts from the start of the file"));
        }
        match sum.checked_sub(*data_bytes) {
            Some(excess @ 1..) => {
                let less = |i: usize| chunks[i].bytes.checked_sub(excess);
                ways.extend(less(0).map(|bytes| with(0, bytes, "its first entry is too large")));
                ways.extend(less(last).map(|bytes| with(last, bytes, "its last entry is too large")));
            }
            _ => {
                let missing = data_bytes - sum.min(*data_bytes);
                ways.push(Mended { chunks: chunks.clone(), how: format!("{missing} bytes follow the last chunk") });
                ways.push(with(last, chunks[last].bytes + missing, "its last entry is too small"));
                ways.push(with(0, chunks[0].bytes + missing, "its first entry is too small"));
                ways.push(self.with_another(chunks, missing));
            }
        }
        ways
    }

    /// The entry of the last chunk is missing.
    fn with_another(&self, chunks: &[Chunk], bytes: u64) -> Mended {
        let there: u64 = chunks.iter().map(|c| c.points).sum();
        let points = self.layout.chunk_points.map_or(self.points.saturating_sub(there), u64::from);
        let chunks = chunks.iter().copied().chain([Chunk { points, bytes }]).collect();
        Mended { chunks, how: "the entry of the last chunk is missing".to_owned() }
    }

    /// A table that adds up, at another place than the file says.
    fn found_elsewhere(&self) -> Option<Mended> {
        let start = self.end.saturating_sub(SEARCHED).max(self.layout.chunks_start());
        let window = self.source.vec_at(start, self.end.saturating_sub(start)).ok()?;
        let mut left = MAX_SEARCHED_ENTRIES;
        for (i, head) in window.windows(8).enumerate().rev() {
            let [0, 0, 0, 0, a, b, c, d] = *head else { continue };
            let count = u64::from(u32::from_le_bytes([a, b, c, d]));
            let (at_least, at_most) = match self.layout.chunk_points {
                Some(full) => {
                    let chunks = self.points.div_ceil(u64::from(full).max(1));
                    (chunks, chunks + 1)
                }
                None => (1, self.points + 1),
            };
            if count == 0 || count < at_least || count > at_most || count > left {
                continue;
            }
            left -= count;
            let at = start + i as u64;
            let entries = self.layout.read_entries(self.source, at);
            if let Some(e) = entries.ok().filter(|e| self.layout.check(&e.chunks, e.data_bytes).is_ok()) {
                return Some(Mended { chunks: e.chunks, how: format!("it was found at byte {at}") });
            }
        }
        None
    }

    /// All points are in one chunk.
    fn one_chunk(&self, fault: &TableFault) -> Option<Mended> {
        let there = self.end.saturating_sub(self.layout.chunks_start());
        let bytes = fault.entries.as_ref().map_or(there, |entries| entries.data_bytes);
        let one = || Mended {
            chunks: vec![Chunk { points: self.points, bytes }],
            how: "all points are in one chunk".to_owned(),
        };
        self.layout.chunk_points.is_none().then(one)
    }

    /// `way` with the declared number of points, if its chunks can hold these.
    fn with_all_points(&self, mut way: Mended) -> Option<Mended> {
        while way.chunks.pop_if(|chunk| chunk.points == 0).is_some() {}
        if self.layout.chunk_points.is_some() {
            let (last, before) = way.chunks.split_last_mut()?;
            let rest = self.points.checked_sub(before.iter().map(|c| c.points).sum())?;
            last.points = Some(rest).filter(|rest| (1..=last.points).contains(rest))?;
        }
        let bytes: u64 = way.chunks.iter().map(|c| c.bytes).sum();
        let holds = |chunk: &Chunk| chunk.points <= self.layout.max_points(chunk.bytes);
        let fits = way.chunks.iter().map(|c| c.points).sum::<u64>() == self.points
            && way.chunks.iter().all(holds)
            && self.layout.chunks_start() + bytes <= self.end;
        fits.then_some(way)
    }

    /// True if a sample of the chunks decodes to exactly its points from exactly its bytes.
    fn is_proven(&self, chunks: &[Chunk]) -> bool {
        let step = (chunks.len() / PROVEN).max(1);
        let (mut at, mut points) = (self.layout.chunks_start(), 0);
        for (i, chunk) in chunks.iter().enumerate() {
            let is_in_sample = i < PROVEN || i + PROVEN >= chunks.len() || i.is_multiple_of(step);
            if is_in_sample {
                points += chunk.points;
                let is_short = points <= MAX_PROVEN_POINTS;
                if !is_short || !decompress::is_exactly(self.source, &self.laszip.items, at, *chunk) {
                    return false;
                }
            }
            at += chunk.bytes;
        }
        true
    }
}
