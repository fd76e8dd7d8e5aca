//! Binary rows with lists in them: what stands between the lists is kept.

use super::binary;
use super::number::Endian;
use crate::scan::source::Source;
use crate::{AttributeType, ReadError};

/// Bytes that are read at once. Lists that are longer are passed over unread.
pub(super) const WINDOW: u64 = 128 << 10;

/// A run of bytes of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// This number of bytes, kept.
    Plain(usize),
    /// A count, and that many items: skipped.
    List { count: AttributeType, item_bytes: u64 },
}

/// Records with lists in them.
pub(super) struct ListRows<'a> {
    pub(super) parts: &'a [Part],
    /// Bytes of a record without its lists.
    pub(super) stride: usize,
    pub(super) endian: Endian,
}

impl ListRows<'_> {
    /// Appends the record at `at` without its lists; returns where the next one starts, `None` where the bytes end.
    pub(super) fn compact(
        &self,
        bytes: &mut Window<'_>,
        mut at: u64,
        out: &mut Vec<u8>,
    ) -> Result<Option<u64>, ReadError> {
        for part in self.parts {
            let next = match *part {
                Part::Plain(len) => bytes.get(at, len)?.map(|plain| {
                    out.extend_from_slice(plain);
                    at + len as u64
                }),
                Part::List { count, item_bytes } => {
                    let items = bytes.get(at, count.size())?.and_then(|b| binary::count(b, count, self.endian));
                    let len = items.and_then(|items| items.checked_mul(item_bytes)?.checked_add(count.size() as u64));
                    len.and_then(|len| at.checked_add(len))
                }
            };
            let Some(next) = next else { return Ok(None) };
            at = next;
        }
        Ok(Some(at))
    }
}

/// A part of a file, read a little at a time.
pub(super) struct Window<'a> {
    source: &'a Source,
    end: u64,
    bytes: &'a mut Vec<u8>,
    /// What is in `bytes`: the place of the first, and how many.
    at: u64,
    len: usize,
}

impl<'a> Window<'a> {
    /// The bytes before `end`; `bytes` is memory to use.
    pub(super) fn new(source: &'a Source, end: u64, bytes: &'a mut Vec<u8>) -> Self {
        Self { source, end, bytes, at: 0, len: 0 }
    }

    /// `len` bytes from `at`; `None` if they end outside.
    fn get(&mut self, at: u64, len: usize) -> Result<Option<&[u8]>, ReadError> {
        let Some(left) = self.end.checked_sub(at).filter(|left| *left >= len as u64) else { return Ok(None) };
        let is_inside = at >= self.at && at + len as u64 <= self.at + self.len as u64;
        if !is_inside {
            self.len = 0;
            self.len = self.source.slice_at(at, left.min(WINDOW.max(len as u64)), self.bytes)?.len();
            self.at = at;
        }
        let start = (at - self.at) as usize;
        Ok(self.bytes.get(start..start + len))
    }
}
