//! Columns of one entry per point, raw or as zstd blocks of whole batches (§8).

use std::collections::HashMap;
use std::sync::Arc;

use pointmill_format::bytes::try_resize;
use pointmill_format::{Advice, ReadError};
use rayon::prelude::*;

use super::bytes::{Bytes, u32_at, u64_at};
use super::extents::{beyond, raw_bytes, slot_range};
use super::formulas::BATCH;
use super::header::Header;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// No zstd frame gives more bytes than this per compressed byte: a block of 128 KiB takes 4 bytes at least
/// (RFC 8878, section 3.1.1.2).
const MAX_RATIO: u64 = 32_768;

/// Bytes that frames may have beyond what they hold, where it does not compress: more than any encoder adds.
const FRAME_SLACK: u64 = 64 << 10;

/// A section of one entry per point.
#[derive(Debug)]
pub(crate) struct Column {
    pub(crate) name: String,
    offset: u64,
    /// Bytes per point.
    pub(crate) stride: u64,
    /// Bytes of the section in the file.
    pub(crate) bytes: u64,
    table: Option<Table>,
}

/// The table of a compressed section.
#[derive(Debug)]
struct Table {
    /// k.
    batches_a_block: u64,
    /// Where blocks begin, relative to the section; one more than there are blocks.
    begins: Vec<u64>,
}

/// Finds a section that begins at `offset`; `None` if it is not wholly inside the file or its table is invalid.
pub(crate) fn open(
    bytes: &Bytes,
    header: &Header,
    name: &str,
    offset: u64,
    stride: u64,
    findings: &Findings,
) -> Result<Option<Column>, ReadError> {
    let column = |bytes, table| Column { name: name.to_owned(), offset, stride, bytes, table };
    if !header.compressed() {
        let len = raw_bytes(header, stride);
        if offset.checked_add(len).is_none_or(|end| end > bytes.len) {
            beyond(findings, name, offset, len, bytes.len);
            return Ok(None);
        }
        return Ok(Some(column(len, None)));
    }
    let mut raw = Vec::new();
    let room = bytes.len.saturating_sub(offset);
    if room < 16 {
        beyond(findings, name, offset, 16, bytes.len);
        return Ok(None);
    }
    bytes.read(offset, 8, &mut raw)?;
    let (k, count) = (u64::from(u32_at(&raw, 0)), u64::from(u32_at(&raw, 4)));
    findings.checked(Check::Blocks, count);
    let fault = |subject: &str, expected: String, found: String| {
        findings.push(Finding::new(Check::Blocks, format!("{subject} of {name}"), expected, found));
        Ok(None)
    };
    if !(1..=256).contains(&k) {
        return fault("batches per block", "1 to 256".into(), k.to_string());
    }
    if count != header.batches.div_ceil(k) {
        return fault("block count", header.batches.div_ceil(k).to_string(), count.to_string());
    }
    let head = 16 + 8 * count;
    if head > room {
        beyond(findings, name, offset, head, bytes.len);
        return Ok(None);
    }
    bytes.read(offset + 8, head - 8, &mut raw)?;
    let begins: Vec<u64> = raw.chunks_exact(8).map(|b| u64_at(b, 0)).collect();
    let (first, last) = (begins[0], begins[begins.len() - 1]);
    if first != head {
        return fault("first block", head.to_string(), first.to_string());
    }
    if let Some(pair) = begins.windows(2).find(|pair| pair[0] > pair[1]) {
        return fault("block table", "ascending".into(), format!("{} before {}", pair[0], pair[1]));
    }
    if last > room {
        beyond(findings, name, offset, last, bytes.len);
        return Ok(None);
    }
    Ok(Some(column(last, Some(Table { batches_a_block: k, begins }))))
}

/// Decompressed blocks by column and number; `None`: the block is broken.
type Decoded = HashMap<(usize, u64), Option<Arc<Vec<u8>>>>;

/// Blocks of several columns that are in use.
#[derive(Debug, Default)]
pub(crate) struct Cache {
    blocks: Decoded,
}

impl Cache {
    /// Makes the blocks of `slots` ready, in parallel, and forgets all others. Broken ones are findings, once each.
    ///
    /// # Errors
    /// The operating system cannot read the file.
    pub(crate) fn prepare(
        &mut self,
        bytes: &Bytes,
        header: &Header,
        columns: &[&Column],
        slots: &[u64],
        findings: &Reported<'_>,
    ) -> Result<(), ReadError> {
        let mut wanted: Vec<(usize, u64)> = Vec::new();
        for (c, column) in columns.iter().enumerate() {
            if let Some(table) = &column.table {
                wanted.extend(slots.iter().map(|slot| (c, slot / table.batches_a_block)));
            }
        }
        wanted.sort_unstable();
        wanted.dedup();
        let mut old = std::mem::take(&mut self.blocks);
        let have: Decoded = wanted.iter().filter_map(|key| Some((*key, old.remove(key)?))).collect();
        drop(old);
        self.blocks = have;
        let missing: Vec<_> = wanted.into_iter().filter(|key| !self.blocks.contains_key(key)).collect();
        let decode = |&(c, block): &(usize, u64)| {
            let data = columns[c].decompress(bytes, header, block, findings)?;
            Ok(((c, block), data.map(Arc::new)))
        };
        let new: Result<Vec<_>, ReadError> = missing.par_iter().map(decode).collect();
        self.blocks.extend(new?);
        Ok(())
    }

    /// The raw bytes of `slot` of column `c` into `out`; false if they cannot be had.
    ///
    /// # Errors
    /// The operating system cannot read the file.
    pub(crate) fn slot(
        &self,
        bytes: &Bytes,
        header: &Header,
        (c, column): (usize, &Column),
        slot: u64,
        out: &mut Vec<u8>,
    ) -> Result<bool, ReadError> {
        let (first, len) = slot_range(header, slot, column.stride);
        let Some(table) = &column.table else {
            bytes.read(column.offset + first, len, out)?;
            return Ok(true);
        };
        let block = slot / table.batches_a_block;
        let begin = first - block * table.batches_a_block * BATCH * column.stride;
        let data = self.blocks.get(&(c, block)).and_then(Option::as_ref);
        let Some(data) = data.and_then(|d| d.get(begin as usize..(begin + len) as usize)) else { return Ok(false) };
        out.clear();
        out.extend_from_slice(data);
        Ok(true)
    }
}

/// Findings, and the blocks that were found broken already: a block may be decompressed more than once.
pub(crate) struct Reported<'a> {
    pub(crate) findings: &'a Findings,
    broken: std::sync::Mutex<std::collections::HashSet<(String, u64)>>,
}

impl<'a> Reported<'a> {
    pub(crate) fn new(findings: &'a Findings) -> Self {
        Self { findings, broken: std::sync::Mutex::default() }
    }

    fn once(&self, name: &str, block: u64, expected: String, found: String) {
        let new = self.broken.lock().is_ok_and(|mut broken| broken.insert((name.to_owned(), block)));
        if new {
            let subject = format!("block {block} of {name}");
            self.findings.push(Finding::new(Check::Blocks, subject, expected, found));
        }
    }
}

impl Column {
    /// Batches that are decompressed to have `batches` in a row and those that are exchanged with them; none of a section
    /// that is not compressed.
    pub(crate) fn batches_decompressed_for(&self, batches: u64) -> u64 {
        self.table.as_ref().map_or(0, |table| {
            let k = table.batches_a_block;
            2 * (batches.div_ceil(k) + 1) * k
        })
    }

    /// Block number `block`, if it decompresses to exactly its batches.
    fn decompress(
        &self,
        bytes: &Bytes,
        header: &Header,
        block: u64,
        reported: &Reported<'_>,
    ) -> Result<Option<Vec<u8>>, ReadError> {
        let Some(table) = &self.table else { return Ok(None) };
        let (begin, end) = (table.begins[block as usize], table.begins[block as usize + 1]);
        let first = block * table.batches_a_block * BATCH;
        let points = (header.points - first.min(header.points)).min(table.batches_a_block * BATCH);
        let expected = points * self.stride;
        let mut frame = Vec::new();
        let len = end - begin;
        let is_read = len <= expected + expected / 64 + FRAME_SLACK;
        bytes.read(self.offset + begin, if is_read { len } else { 0 }, &mut frame)?;
        let stated = zstd::zstd_safe::get_frame_content_size(&frame);
        let fault = |found: String| {
            reported.once(&self.name, block, format!("a zstd frame of {expected} bytes"), found);
            Ok(None)
        };
        match stated {
            _ if !is_read => return fault(format!("{len} bytes, more than a frame of these takes")),
            _ if expected > len * MAX_RATIO => return fault(format!("{len} bytes, which cannot hold that")),
            Ok(Some(stated)) if stated == expected => {}
            Ok(Some(stated)) => return fault(format!("{stated} bytes, by its header")),
            Ok(None) => return fault("a frame that does not state its size".into()),
            Err(_) => return fault("not a zstd frame".into()),
        }
        match zstd::zstd_safe::find_frame_compressed_size(&frame) {
            Ok(len) if len == frame.len() => {}
            Ok(len) => return fault(format!("{} bytes behind the frame", frame.len() - len.min(frame.len()))),
            Err(_) => return fault("a frame that is cut short".into()),
        }
        let mut out = Vec::new();
        try_resize(&mut out, expected).map_err(|_| {
            let what = format!("{expected} bytes of a block do not fit memory");
            ReadError::unsupported(&bytes.path, what).advise(Advice::MoreMemory)
        })?;
        match zstd::bulk::decompress_to_buffer(&frame, &mut out[..]) {
            Ok(len) if len as u64 == expected => Ok(Some(out)),
            Ok(len) => fault(format!("{len} bytes")),
            Err(error) => fault(error.to_string()),
        }
    }
}
