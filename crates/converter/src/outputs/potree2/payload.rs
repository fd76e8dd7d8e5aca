//! The payload of one node, DEFAULT or BROTLI.

use pointmill_format::potree2::{BrotliScratch, encode_brotli};
use pointmill_format::{Attribute, AttributeType, NodeKey};

use super::layout::OutputLayout;
use super::settings::Encoding;
use crate::cloud::{Checksum, copy_record};
use crate::error::ConvertError;
use crate::octree::NodeEncoder;

/// Records are first copied into a small tile: the copies are short and independent, so that the processor waits for
/// many scattered records at once, and what is done with them then happens in the first-level cache.
const TILE_RECORDS: usize = 128;

/// Bytes of a position in a Brotli payload.
const BROTLI_POSITION_BYTES: u64 = 16;

/// Turns stored records into payloads; one for each thread.
pub(crate) struct PayloadEncoder {
    layout: OutputLayout,
    encoding: Encoding,
    attributes: Vec<Attribute>,
    tile: Vec<u8>,
    plain: Vec<u8>,
    scratch: BrotliScratch,
}

impl PayloadEncoder {
    pub(crate) fn new(layout: OutputLayout, encoding: Encoding) -> Self {
        let mut attributes = vec![Attribute::new("position", AttributeType::Int32, 3)];
        attributes.extend(layout.attributes.iter().cloned());
        let (tile, plain, scratch) = (Vec::new(), Vec::new(), BrotliScratch::default());
        Self { layout, encoding, attributes, tile, plain, scratch }
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

impl NodeEncoder for PayloadEncoder {
    fn encode<'r>(
        &mut self,
        _: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
        written: &mut Checksum,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError> {
        match self.encoding {
            Encoding::Default => self.interleave(records, out, written),
            Encoding::Brotli { quality } => {
                let mut plain = std::mem::take(&mut self.plain);
                plain.clear();
                self.interleave(records, &mut plain, written);
                let encoded = encode_brotli(&self.attributes, &plain, quality, &mut self.scratch, out);
                self.plain = plain;
                encoded.map_err(|e| ConvertError::Internal(format!("Brotli: {e}")))?;
            }
        }
        Ok(())
    }

    fn is_row_by_row(&self) -> bool {
        self.encoding == Encoding::Default
    }

    fn bytes_per_point(&self) -> u64 {
        // plain and sorted records, planes and their compressed bytes; codes, keys, and the order of the points
        4 * (self.layout.stride as u64 + BROTLI_POSITION_BYTES) + 16 + 16 + 4
    }
}
