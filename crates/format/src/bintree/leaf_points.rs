//! The bytes of a leaf to typed columns.

use crate::Column;
use crate::potree2::column_bytes;

use super::encode::decode;
use super::{CORE_BYTES, RecordLayout};

/// The points of one leaf; reuse one from leaf to leaf and its memory is reused.
#[derive(Debug, Clone, Default)]
pub struct LeafPoints {
    /// World coordinates: x, y, z. In double, as the index's boxes are, which contain them exactly.
    pub positions: [Vec<f64>; 3],
    /// Classes as stored: whole numbers, if pointmill wrote them.
    pub classes: Vec<f32>,
    /// The columns behind the core, in the order of [`RecordLayout::extras`].
    pub columns: Vec<Column>,
    /// The records as stored.
    pub(super) bytes: Vec<u8>,
}

/// Records that are taken apart at a time: all their bytes stay in the first-level cache from column to column.
const BLOCK_POINTS: usize = 512;

impl LeafPoints {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.classes.len()
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// World coordinates of point `index`, or `None` past the last.
    pub fn world(&self, index: usize) -> Option<[f64; 3]> {
        let [x, y, z] = &self.positions;
        Some([*x.get(index)?, *y.get(index)?, *z.get(index)?])
    }

    /// The records as stored: what a vertex buffer wants.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Empties everything but the bytes, and gives the columns the types of `layout`.
    pub(super) fn reset(&mut self, layout: &RecordLayout) {
        self.positions.iter_mut().for_each(Vec::clear);
        self.classes.clear();
        let types = layout.extras().iter().map(|e| e.attribute.ty);
        if types.clone().eq(self.columns.iter().map(Column::ty)) {
            self.columns.iter_mut().for_each(Column::clear);
        } else {
            self.columns = types.map(Column::new).collect();
        }
    }

    /// Takes the records apart.
    pub(super) fn fill(&mut self, layout: &RecordLayout, center: [f64; 3]) {
        let stride = layout.stride();
        for block in self.bytes.chunks(stride.saturating_mul(BLOCK_POINTS)) {
            for record in block.chunks_exact(stride) {
                let Some((offset, class)) = core(record) else { continue };
                for (values, value) in self.positions.iter_mut().zip(decode(center, offset)) {
                    values.push(value);
                }
                self.classes.push(class);
            }
            for (column, extra) in self.columns.iter_mut().zip(layout.extras()) {
                column_bytes::append(column, block, stride, extra.offset, extra.attribute.elements);
            }
        }
    }
}

/// Offset from the center and class of a record.
#[inline]
pub(super) fn core(record: &[u8]) -> Option<([f32; 3], f32)> {
    let words = record.first_chunk::<CORE_BYTES>()?.as_chunks::<4>().0;
    let &[x, y, z, class] = words else { return None };
    Some(([x, y, z].map(f32::from_le_bytes), f32::from_le_bytes(class)))
}
