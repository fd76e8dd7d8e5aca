//! Blocks of the store while a unit puts its records back.

use crate::cloud::{BLOCK_BYTES, Checksum, Segment, Store, copy_record};
use crate::error::ConvertError;

/// The records of one source.
pub(super) struct Filling<'a> {
    store: &'a Store,
    stride: usize,
    source: u32,
    /// Records that are still to come.
    left: usize,
    /// The block that is filled.
    block: Option<u32>,
    records: Vec<u8>,
    /// The first of its records that no segment has.
    start: u32,
}

impl<'a> Filling<'a> {
    /// `count`: records that will come.
    pub(super) fn new(source: u32, count: usize, store: &'a Store, stride: usize) -> Self {
        Self { store, stride, source, left: count, block: None, records: Vec::new(), start: 0 }
    }

    /// Adds a record, and returns it. Where a block is full, the records of the cell so far become a segment.
    #[inline]
    pub(super) fn add(
        &mut self,
        record: &[u8],
        segments: &mut Vec<Segment>,
        put: &mut Checksum,
    ) -> Result<&mut [u8], ConvertError> {
        if self.records.len() + self.stride > self.records.capacity() || self.block.is_none() {
            self.next_block(segments, put)?;
        }
        let at = self.records.len();
        self.records.resize(at + self.stride, 0);
        copy_record(record, &mut self.records[at..]);
        self.left = self.left.saturating_sub(1);
        Ok(&mut self.records[at..])
    }

    #[cold]
    fn next_block(&mut self, segments: &mut Vec<Segment>, put: &mut Checksum) -> Result<(), ConvertError> {
        self.end_cell(segments);
        self.end_block(put)?;
        let most = (BLOCK_BYTES / self.stride).max(1);
        self.records = self.store.buffer(self.left.clamp(1, most) * self.stride)?;
        self.block = Some(self.store.open(self.source)?);
        Ok(())
    }

    /// The records since the last segment are one.
    pub(super) fn end_cell(&mut self, segments: &mut Vec<Segment>) {
        let end = (self.records.len() / self.stride) as u32;
        if let Some(block) = self.block.filter(|_| end > self.start) {
            segments.push(Segment { block, start: self.start, count: end - self.start });
            self.start = end;
        }
    }

    /// Gives the block to the store.
    pub(super) fn end_block(&mut self, put: &mut Checksum) -> Result<(), ConvertError> {
        self.start = 0;
        put.add_all(&self.records, self.stride);
        match self.block.take() {
            Some(block) => self.store.fill(block, &mut self.records),
            None => Ok(()),
        }
    }
}
