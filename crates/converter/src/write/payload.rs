//! The payload of one node, DEFAULT or BROTLI.

use pointmill_format::potree2::{BrotliScratch, NodeEntry, encode_brotli};
use pointmill_format::{Attribute, AttributeType, NodeKey};

use crate::checksum::Checksum;
use crate::error::ConvertError;
use crate::plan::Encoding;
use crate::records::OutputLayout;

/// Turns stored records into payloads; one for each thread.
pub(crate) struct PayloadWriter {
    layout: OutputLayout,
    encoding: Encoding,
    attributes: Vec<Attribute>,
    plain: Vec<u8>,
    scratch: BrotliScratch,
}

impl PayloadWriter {
    pub(crate) fn new(layout: OutputLayout, encoding: Encoding) -> Self {
        let mut attributes = vec![Attribute::new("position", AttributeType::Int32, 3)];
        attributes.extend(layout.attributes.iter().cloned());
        Self { layout, encoding, attributes, plain: Vec::new(), scratch: BrotliScratch::default() }
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
            Encoding::Default => {
                out.reserve(points as usize * self.layout.stride);
                for record in records {
                    checksum.add(record);
                    self.layout.write(record, out);
                }
            }
            Encoding::Brotli { quality } => {
                self.plain.clear();
                for record in records {
                    checksum.add(record);
                    self.layout.write(record, &mut self.plain);
                }
                encode_brotli(&self.attributes, &self.plain, quality, &mut self.scratch, out)
                    .map_err(|e| ConvertError::Internal(format!("Brotli: {e}")))?;
            }
        }
        Ok(NodeEntry { key, points, byte_offset: start as u64, byte_size: (out.len() - start) as u64 })
    }
}
