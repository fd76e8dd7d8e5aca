//! Records as they are stored while they wait, and as they are written.

use pointmill_format::Attribute;

use crate::grid::Cube;
use crate::schema::{POSITION_BYTES, Schema};

/// How stored records are to be understood.
#[derive(Debug, Clone)]
pub(crate) struct RecordFrame {
    /// Bytes of a stored record.
    pub(crate) stride: usize,
    pub(crate) cube: Cube,
    /// Added to a stored coordinate it gives the job lattice coordinate.
    pub(crate) base: [i64; 3],
}

impl RecordFrame {
    /// Tree coordinates of a stored record.
    #[inline]
    pub(crate) fn tree(&self, record: &[u8]) -> [u32; 3] {
        let q = position(record);
        self.cube.tree(std::array::from_fn(|a| i64::from(q[a]) + self.base[a]))
    }
}

/// The stored integers of a record.
#[inline]
pub(crate) fn position(record: &[u8]) -> [i32; 3] {
    match record.first_chunk::<POSITION_BYTES>() {
        Some(&[a, b, c, d, e, f, g, h, i, j, k, l]) => {
            [i32::from_le_bytes([a, b, c, d]), i32::from_le_bytes([e, f, g, h]), i32::from_le_bytes([i, j, k, l])]
        }
        None => [0; 3],
    }
}

/// Copies one record: a few 16-byte moves instead of a call, since records are short and their length varies.
#[inline]
pub(crate) fn copy_record(from: &[u8], to: &mut [u8]) {
    let n = from.len().min(to.len());
    let (from, to) = (&from[..n], &mut to[..n]);
    if n < 16 {
        to.copy_from_slice(from);
        return;
    }
    for (from, to) in from.as_chunks::<16>().0.iter().zip(to.as_chunks_mut::<16>().0) {
        *to = *from;
    }
    // The last move may overlap the one before.
    if let (Some(from), Some(to)) = (from.last_chunk::<16>(), to.last_chunk_mut::<16>()) {
        *to = *from;
    }
}

/// From stored records to output records: positions relative to the cube, columns that were not asked for left out.
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
        let shift = std::array::from_fn(|a| (frame.base[a] - frame.cube.min[a]) as u32);
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
            let q = position(record);
            if let Some(bytes) = record.first_chunk_mut::<POSITION_BYTES>() {
                for (channel, v) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(0..3) {
                    *channel = (q[v] as u32).wrapping_add(self.shift[v]).to_le_bytes();
                }
            }
        }
    }
}
