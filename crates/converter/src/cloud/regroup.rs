//! Records put back into the store in another grouping: how a cell that is too large, or that does not fit the grid of an
//! output, is divided.

use super::grouping::Grouping;
use super::segments::Segment;
use super::store::{BLOCK_BYTES, Store};
use crate::error::ConvertError;

/// Records looked at together: many, so that the groups come in long segments.
const POINTS: usize = 65_536;

/// Bytes of wide records that are looked at together.
const BYTES: usize = 4 << 20;

/// What became of some records of one block.
pub(crate) enum Sifted<'r> {
    /// Those of a code lie behind one another.
    Group { code: u64, segment: Segment, records: &'r [u8] },
    /// As they came, since they have too many codes; and how many of them have each.
    Loose { segment: Segment, codes: &'r [(u64, u32)] },
}

/// Regroups records; keeps its memory from one use to the next, and that of emptied blocks in the store
/// ([`Store::drop_spare`] once all is regrouped).
pub(crate) struct Regrouper<'a> {
    store: &'a Store,
    stride: usize,
    /// Records that are looked at together.
    points: usize,
    /// For all outputs, not for one.
    is_for_all: bool,
    grouping: Grouping,
    records: Vec<u8>,
    codes: Vec<u64>,
    /// The block that is filled, and its source.
    open: Option<(u32, u32)>,
    /// Its records.
    sorted: Vec<u8>,
    /// Bytes that a block grows to.
    block_bytes: usize,
}

impl<'a> Regrouper<'a> {
    /// For an output, which takes each record once.
    pub(crate) fn new(store: &'a Store, stride: usize) -> Self {
        let (records, codes, sorted) = (Vec::new(), Vec::new(), Vec::new());
        let points = (BYTES / stride).clamp(1, POINTS);
        let (is_for_all, block_bytes, open, grouping) = (false, 0, None, Grouping::default());
        Self { store, stride, points, is_for_all, grouping, records, codes, open, sorted, block_bytes }
    }

    /// For all outputs, before the first of them takes a record; `points`: of all that are regrouped.
    pub(crate) fn for_all(store: &'a Store, stride: usize, points: u64) -> Self {
        let block_bytes = (points * stride as u64).min(BLOCK_BYTES as u64) as usize;
        Self { is_for_all: true, block_bytes, ..Self::new(store, stride) }
    }

    /// Takes the records of `segments` and puts them back grouped by `code` (a Morton code: groups that are near in space
    /// are near in the store). `found` gets the code of each group and where it is; a code may come several times.
    pub(crate) fn regroup<'s>(
        &mut self,
        segments: impl IntoIterator<Item = &'s Segment>,
        code: impl FnMut(&[u8]) -> u64,
        mut found: impl FnMut(u64, Segment),
    ) -> Result<(), ConvertError> {
        self.sift(segments, 0, code, |sifted| {
            if let Sifted::Group { code, segment, .. } = sifted {
                found(code, segment);
            }
        })
    }

    /// [`Self::regroup`], but records that are looked at together stay as they are if fewer than `least` of them have the
    /// same code, on average.
    pub(crate) fn sift<'s>(
        &mut self,
        segments: impl IntoIterator<Item = &'s Segment>,
        least: usize,
        mut code: impl FnMut(&[u8]) -> u64,
        mut found: impl FnMut(Sifted<'_>),
    ) -> Result<(), ConvertError> {
        let mut source = None;
        for segment in segments {
            let mut start = 0;
            while start < segment.count {
                let before = self.records.len();
                let room = self.points - before / self.stride;
                let count = (segment.count - start).min(room as u32);
                let part = Segment { block: segment.block, start: segment.start + start, count };
                start += count;
                let from = self.store.take_to_put_back(part, self.is_for_all, &mut self.records)?;
                if let Some(source) = source.filter(|s| *s != from) {
                    // A block holds records of one source.
                    let rest = self.records.split_off(before);
                    self.put_back(source, least, &mut code, &mut found)?;
                    self.records = rest;
                }
                source = Some(from);
                if self.records.len() >= self.points * self.stride {
                    self.put_back(from, least, &mut code, &mut found)?;
                }
            }
        }
        source.map_or(Ok(()), |source| self.put_back(source, least, &mut code, &mut found))?;
        self.close()
    }

    /// Puts the records of one source behind those of the open block, or into a new one.
    fn put_back(
        &mut self,
        source: u32,
        least: usize,
        code: &mut impl FnMut(&[u8]) -> u64,
        found: &mut impl FnMut(Sifted<'_>),
    ) -> Result<(), ConvertError> {
        let stride = self.stride;
        if self.records.is_empty() {
            return Ok(());
        }
        self.codes.clear();
        self.codes.extend(self.records.chunks_exact(stride).map(code));
        self.grouping.count(&self.codes);
        let block = self.room_for(source)?;
        let first = (self.sorted.len() / stride) as u32;
        if self.grouping.groups.len() * least > self.codes.len() {
            self.grouping.leave();
            self.sorted.extend_from_slice(&self.records);
            let segment = Segment { block, start: first, count: self.codes.len() as u32 };
            found(Sifted::Loose { segment, codes: &self.grouping.groups });
        } else {
            self.grouping.arrange(|code| code);
            for &i in &self.grouping.order {
                self.sorted.extend_from_slice(&self.records[i as usize * stride..][..stride]);
            }
            let mut start = first;
            for &(code, count) in &self.grouping.groups {
                let records = &self.sorted[start as usize * stride..][..count as usize * stride];
                found(Sifted::Group { code, segment: Segment { block, start, count }, records });
                start += count;
            }
        }
        self.records.clear();
        Ok(())
    }

    /// The block that takes the records that are looked at.
    fn room_for(&mut self, source: u32) -> Result<u32, ConvertError> {
        let bytes = self.records.len();
        let is_full = self.sorted.len() + bytes > self.block_bytes;
        if is_full || self.open.is_some_and(|(_, of)| of != source) {
            self.close()?;
        }
        if let Some((block, _)) = self.open {
            return Ok(block);
        }
        if self.sorted.capacity() < bytes.max(self.block_bytes) {
            self.sorted = self.store.buffer(bytes.max(self.block_bytes))?;
        }
        let block = self.store.open(source)?;
        self.open = Some((block, source));
        Ok(block)
    }

    fn close(&mut self) -> Result<(), ConvertError> {
        match self.open.take() {
            Some((block, _)) if self.is_for_all => self.store.fill(block, &mut self.sorted),
            Some((block, _)) => self.store.refill(block, &mut self.sorted),
            None => Ok(()),
        }
    }
}
