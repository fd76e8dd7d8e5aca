//! From stored records to the records of the dataset: positions relative to the cube, columns that are not kept left
//! out.

use pointmill_format::Attribute;

use crate::cloud::RecordFrame;
use crate::sources::{POSITION_BYTES, Schema};

/// Which bytes of a stored record go where.
#[derive(Debug, Clone)]
pub(crate) struct OutputLayout {
    /// Attributes of the output beside the position, in order.
    pub(crate) attributes: Vec<Attribute>,
    /// Bytes of an output record.
    pub(crate) stride: usize,
    /// Bytes of a stored record.
    pub(crate) stored_stride: usize,
    /// Runs of bytes to copy: (from, to) of the stored record, in output order.
    runs: Vec<(usize, usize)>,
    /// Added to a stored coordinate (modulo 2^32) it gives the output integer.
    shift: [u32; 3],
}

impl OutputLayout {
    pub(crate) fn new(schema: &Schema, kept: &[usize], frame: &RecordFrame) -> Self {
        let mut runs: Vec<(usize, usize)> = Vec::new();
        let mut stride = POSITION_BYTES;
        for &i in kept {
            let (from, to) = (schema.offsets[i], schema.offsets[i] + schema.attributes[i].size());
            stride += to - from;
            match runs.last_mut() {
                Some(last) if last.1 == from => last.1 = to,
                _ => runs.push((from, to)),
            }
        }
        let attributes = kept.iter().map(|&i| schema.attributes[i].clone()).collect();
        let shift = std::array::from_fn(|a| (frame.origin.0[a] - frame.cube.min[a]) as u32);
        Self { attributes, stride, stored_stride: schema.stride, runs, shift }
    }

    /// Appends the output form of stored records that lie back to back.
    pub(crate) fn write_all(&self, records: &[u8], out: &mut Vec<u8>) {
        let start = out.len();
        if self.stride == self.stored_stride && self.runs.len() <= 1 {
            out.extend_from_slice(records);
        } else {
            for record in records.chunks_exact(self.stored_stride) {
                out.extend_from_slice(&record[..POSITION_BYTES]);
                for &(from, to) in &self.runs {
                    out.extend_from_slice(&record[from..to]);
                }
            }
        }
        for record in out[start..].chunks_exact_mut(self.stride) {
            for (axis, shift) in record[..POSITION_BYTES].as_chunks_mut::<4>().0.iter_mut().zip(self.shift) {
                *axis = u32::from_le_bytes(*axis).wrapping_add(shift).to_le_bytes();
            }
        }
    }
}
