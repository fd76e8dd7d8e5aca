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

/// From stored records to output records: positions relative to the cube, columns that were not asked for left out.
#[derive(Debug, Clone)]
pub(crate) struct OutputLayout {
    /// Attributes of the output beside the position, in order.
    pub(crate) attributes: Vec<Attribute>,
    /// Bytes of an output record.
    pub(crate) stride: usize,
    /// Runs of bytes to copy: (from, to) of the stored record, in output order.
    runs: Vec<(usize, usize)>,
    /// Added to a stored coordinate it gives the output integer.
    shift: [i64; 3],
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
        let shift = std::array::from_fn(|a| frame.base[a] - frame.cube.min[a]);
        Self { attributes, stride, runs, shift }
    }

    /// Appends the output form of a stored record.
    #[inline]
    pub(crate) fn write(&self, record: &[u8], out: &mut Vec<u8>) {
        let q = position(record);
        let mut bytes = [0; POSITION_BYTES];
        for a in 0..3 {
            let v = (i64::from(q[a]) + self.shift[a]) as u32;
            bytes[4 * a..4 * a + 4].copy_from_slice(&v.to_le_bytes());
        }
        out.extend_from_slice(&bytes);
        for &(from, to) in &self.runs {
            out.extend_from_slice(&record[from..to]);
        }
    }
}
