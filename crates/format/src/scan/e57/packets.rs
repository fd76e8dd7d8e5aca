//! Packets of a compressed vector section (ASTM E2807 §9.3): heads, chained by their lengths.

use super::pages::Pages;
use crate::{Advice, ReadError};

/// Bytes of the head of a compressed vector section.
pub(super) const SECTION_HEAD: usize = 32;
/// Bytes of the smallest packet.
const MIN_PACKET: u64 = 4;

/// Where the packets of a section lie: logical offsets.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section {
    /// Of the first packet.
    pub(super) packets: u64,
    /// Behind the last.
    pub(super) end: u64,
}

impl Section {
    /// Reads the head of the section at the logical offset `at`; packets end at `limit` at the latest.
    ///
    /// # Errors
    /// Why there is no section, as an offset and text.
    pub(super) fn read(pages: &mut Pages<'_>, at: u64, limit: u64) -> Result<Self, BrokenChain> {
        let mut head = [0; SECTION_HEAD];
        pages.read(at, &mut head)?;
        let field = |at: usize| head[at..].first_chunk::<8>().map_or(0, |b| u64::from_le_bytes(*b));
        if head[0] != 1 {
            return Err(BrokenChain::at(at, format!("no points here: the section is of type {}, not 1", head[0])));
        }
        // the length counts the head; the file's end bounds it, and the next scan's start
        let end = at.saturating_add(field(8)).min(limit);
        let packets = super::pages::logical(field(16));
        if packets < at + SECTION_HEAD as u64 || packets > end {
            return Err(BrokenChain::at(
                at,
                format!("the points should start at byte {}, outside their section", field(16)),
            ));
        }
        Ok(Self { packets, end })
    }
}

/// Why a chain of packets ends before its time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct BrokenChain {
    /// Physical offset.
    pub(super) byte: u64,
    pub(super) what: String,
    pub(super) advice: Advice,
}

impl BrokenChain {
    /// At a logical offset.
    fn at(logical: u64, what: String) -> Self {
        Self { byte: super::pages::physical(logical), what, advice: Advice::Damaged }
    }
}

impl From<ReadError> for BrokenChain {
    fn from(e: ReadError) -> Self {
        let advice = e.advice().cloned().unwrap_or(Advice::Damaged);
        Self { byte: e.offset().unwrap_or(0), what: e.what(), advice }
    }
}

/// One packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Packet {
    /// All its bytes.
    pub(super) len: u64,
    /// Bytes before the first stream; `None` if it holds no points (an index, or a packet to ignore).
    pub(super) streams: Option<u64>,
}

impl Packet {
    /// Reads the head of the packet at the logical offset `at`. `sizes` becomes the bytes of each stream: as many as
    /// there are `fields` in a data packet.
    ///
    /// # Errors
    /// An unknown type, lengths that contradict each other, more than fits before `end`, or an unreadable page.
    pub(super) fn read(
        pages: &mut Pages<'_>,
        at: u64,
        end: u64,
        fields: usize,
        sizes: &mut Vec<u64>,
    ) -> Result<Self, BrokenChain> {
        sizes.clear();
        let mut head = [0; MIN_PACKET as usize];
        pages.read(at, &mut head)?;
        let [kind, _, len @ ..] = head;
        let len = u64::from(u16::from_le_bytes(len)) + 1;
        if kind > 2 || !len.is_multiple_of(4) || at + len > end {
            let what = format!("no packet of points: type {kind}, {len} bytes, {} are left", end - at);
            return Err(BrokenChain::at(at, what));
        }
        if kind != 1 {
            return Ok(Self { len, streams: None });
        }
        let streams = 6 + 2 * fields as u64;
        if streams > len {
            return Err(BrokenChain::at(at, format!("a packet of {len} bytes cannot hold {fields} streams")));
        }
        let mut bytes = vec![0; streams as usize - MIN_PACKET as usize];
        pages.read(at + MIN_PACKET, &mut bytes)?;
        let mut words = bytes.as_chunks().0.iter().map(|b| u64::from(u16::from_le_bytes(*b)));
        let count = words.next().unwrap_or(0);
        if count != fields as u64 {
            return Err(BrokenChain::at(at, format!("a packet has {count} streams, a record {fields} fields")));
        }
        sizes.extend(words);
        let sum: u64 = sizes.iter().sum();
        if streams + sum > len {
            return Err(BrokenChain::at(at, format!("streams of {sum} bytes in a packet of {len}")));
        }
        Ok(Self { len, streams: Some(streams) })
    }
}
