//! The bytes of a leaf to typed columns.

use crate::points::column_bytes;
use crate::{AttributeType, NodePoints, Positions};

use super::encode::decode;
use super::{CORE_BYTES, RecordLayout};

/// Records that are taken apart at a time: all their bytes stay in the first-level cache from column to column.
const BLOCK_POINTS: usize = 512;

/// Byte of a record at which the class is.
const CLASS_AT: usize = 12;

/// Empties `points` and gives the columns the names and types of `layout`.
pub(super) fn reset(points: &mut NodePoints, layout: &RecordLayout) {
    let class = std::iter::once(("classification", AttributeType::Float32));
    points.reset(class.chain(layout.extras().iter().map(|e| (e.attribute.name.as_str(), e.attribute.ty))));
    points.positions = Positions::World(points.take_world());
    points.stored.clear();
}

/// Takes the stored records apart.
pub(super) fn fill(points: &mut NodePoints, layout: &RecordLayout, center: [f64; 3]) {
    let stride = layout.stride();
    let mut positions = points.take_world();
    for block in points.stored.chunks(stride.saturating_mul(BLOCK_POINTS)) {
        for record in block.chunks_exact(stride) {
            let Some((offset, _)) = core(record) else { continue };
            for (values, value) in positions.iter_mut().zip(decode(center, offset)) {
                values.push(value);
            }
        }
        let extras = layout.extras().iter().map(|extra| (extra.offset, extra.attribute.elements));
        for (column, (at, elements)) in points.columns.iter_mut().zip(std::iter::once((CLASS_AT, 1)).chain(extras)) {
            column_bytes::append(column, block, stride, at, elements);
        }
    }
    points.positions = Positions::World(positions);
}

/// Offset from the center and class of a record.
#[inline]
pub(super) fn core(record: &[u8]) -> Option<([f32; 3], f32)> {
    let words = record.first_chunk::<CORE_BYTES>()?.as_chunks::<4>().0;
    let &[x, y, z, class] = words else { return None };
    Some(([x, y, z].map(f32::from_le_bytes), f32::from_le_bytes(class)))
}
