//! Columns of numbers as one Brotli stream (RFC 7932), made for what nodes hold.
//!
//! A library looks for repeated bytes anywhere. Here it is known where elements begin, that neighbours share their high
//! bytes, and that a column is unlike the next: each has a meta-block of its own, with its own codes, and elements are
//! compared with elements. That takes a fraction of the time, and fewer bytes. Whole numbers alone decide, so the bytes are
//! the same on every machine.

mod bits;
mod commands;
mod contexts;
mod literals;
mod logs;
mod meta_block;
mod numbers;
mod parse;
mod prefix;
#[cfg(test)]
mod tests;

use bits::BitWriter;
use commands::Recent;
use meta_block::MetaBlocks;
use parse::{Kind, Part};

use crate::WriteError;

/// Numbers of more bytes are not encoded here.
pub(super) const MAX_NUMBER: usize = numbers::MAX_NUMBER;

/// Bytes of a column that a meta-block holds at most: so many that its own codes cost little, and the question whether to
/// go on is asked often.
const MAX_BYTES: usize = 1 << 20;

/// With columns of one value there may be more.
const MAX_BLOCK: usize = 8 << 20;

/// The bits at the start that say: window 22.
const WINDOW: (u64, u32) = (0b1011, 4);

/// The bits at the end: the last meta-block, which is empty.
const END: (u64, u32) = (0b11, 2);

/// What is known of the values of an attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Column {
    /// Two words of a Morton code, sorted: 16 bytes.
    Positions,
    /// The Morton code of a colour: 8 bytes. Where colours had 8 bits, the second three bytes are the first.
    Colours,
    /// Numbers of that many bytes, 1 to [`MAX_NUMBER`].
    Numbers(usize),
}

impl Column {
    /// Bytes of an element.
    fn size(self) -> usize {
        match self {
            Self::Positions => 16,
            Self::Colours => 8,
            Self::Numbers(size) => size,
        }
    }

    /// How `bytes` of it are looked at.
    fn kind(self, bytes: &[u8]) -> Kind {
        match self {
            _ if bytes[self.size()..] == bytes[..bytes.len() - self.size()] => Kind::Constant,
            Self::Positions => Kind::Sorted,
            Self::Colours => Kind::Numbers { inner: 3 },
            Self::Numbers(1) => Kind::Bytes,
            Self::Numbers(_) => Kind::Numbers { inner: 0 },
        }
    }
}

/// Encodes columns; keeps memory from node to node.
#[derive(Debug, Default)]
pub(super) struct ColumnEncoder {
    blocks: MetaBlocks,
    parts: Vec<Part>,
}

impl ColumnEncoder {
    /// Appends one complete stream to `out` that gives `planes`: all `columns` of `count` points, one behind the other.
    /// `goes_on` is asked for each megabyte.
    ///
    /// # Errors
    /// [`WriteError::Stopped`] once `goes_on` has said no, with `out` as it was.
    pub(super) fn encode(
        &mut self,
        planes: &[u8],
        columns: &[Column],
        count: usize,
        goes_on: &dyn Fn() -> bool,
        out: &mut Vec<u8>,
    ) -> Result<(), WriteError> {
        let start = out.len();
        let mut bits = BitWriter::new(out);
        let mut recent = Recent::default();
        bits.write(WINDOW.0, WINDOW.1);
        self.parts.clear();
        let (mut block, mut at) = (0, 0);
        for column in columns {
            let end = at + count * column.size();
            while at < end {
                let len = (end - at).min(MAX_BYTES / column.size() * column.size());
                let kind = column.kind(&planes[at..at + len]);
                // a column of one value needs no codes of its own
                if kind != Kind::Constant || at + len - block > MAX_BLOCK {
                    if !goes_on() {
                        bits.finish().truncate(start);
                        return Err(WriteError::Stopped);
                    }
                    self.blocks.write(planes, block, &self.parts, &mut recent, &mut bits);
                    self.parts.clear();
                    block = at;
                }
                self.parts.push(Part { len, size: column.size(), kind });
                at += len;
            }
        }
        self.blocks.write(planes, block, &self.parts, &mut recent, &mut bits);
        bits.write(END.0, END.1);
        bits.finish();
        Ok(())
    }
}
