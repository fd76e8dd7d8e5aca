//! The payload of one node, DEFAULT or BROTLI.

use pointmill_format::potree2::{BrotliScratch, NodeEntry, encode_brotli};
use pointmill_format::{Attribute, AttributeType, NodeKey};

use crate::checksum::Checksum;
use crate::error::ConvertError;
use crate::plan::Encoding;
use crate::records::{OutputLayout, copy_record};

/// Records are first copied into a small tile: the copies are short and independent, so that the processor waits for
/// many scattered records at once, and what is done with them then happens in the first-level cache.
const TILE_RECORDS: usize = 128;

/// Turns stored records into payloads; one for each thread.
pub(crate) struct PayloadWriter {
    layout: OutputLayout,
    encoding: Encoding,
    attributes: Vec<Attribute>,
    tile: Vec<u8>,
    plain: Vec<u8>,
    scratch: BrotliScratch,
}

impl PayloadWriter {
    pub(crate) fn new(layout: OutputLayout, encoding: Encoding) -> Self {
        let mut attributes = vec![Attribute::new("position", AttributeType::Int32, 3)];
        attributes.extend(layout.attributes.iter().cloned());
        let (tile, plain, scratch) = (Vec::new(), Vec::new(), BrotliScratch::default());
        Self { layout, encoding, attributes, tile, plain, scratch }
    }

    /// Appends the payload of a node to `out`; `records` are as stored. The entry's offset is relative to `out`.
    pub(crate) fn write<'r>(
        &mut self,
        key: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
        out: &mut Vec<u8>,
        checksum: &mut Checksum,
    ) -> Result<NodeEntry, ConvertError> {
        let points = u32::try_from(records.len()).map_err(|_| {
            ConvertError::Unsupported(format!(
                "{} points share one place; a node holds at most {}; pass --duplicates drop",
                records.len(),
                u32::MAX
            ))
        })?;
        let start = out.len();
        match self.encoding {
            Encoding::Default => self.interleave(records, out, checksum),
            Encoding::Brotli { quality } => {
                let mut plain = std::mem::take(&mut self.plain);
                plain.clear();
                self.interleave(records, &mut plain, checksum);
                let encoded = encode_brotli(&self.attributes, &plain, quality, &mut self.scratch, out);
                self.plain = plain;
                encoded.map_err(|e| ConvertError::Internal(format!("Brotli: {e}")))?;
            }
        }
        Ok(NodeEntry { key, points, byte_offset: start as u64, byte_size: (out.len() - start) as u64 })
    }

    fn interleave<'r>(
        &mut self,
        mut records: impl ExactSizeIterator<Item = &'r [u8]>,
        out: &mut Vec<u8>,
        checksum: &mut Checksum,
    ) {
        let stride = self.layout.stored_stride;
        out.reserve(records.len() * self.layout.stride);
        self.tile.resize(TILE_RECORDS * stride, 0);
        loop {
            let mut count = 0;
            for (slot, record) in self.tile.chunks_exact_mut(stride).zip(&mut records) {
                copy_record(record, slot);
                count += 1;
            }
            let tile = &self.tile[..count * stride];
            checksum.add_all(tile, stride);
            self.layout.write_all(tile, out);
            if count < TILE_RECORDS {
                break;
            }
        }
    }
}
