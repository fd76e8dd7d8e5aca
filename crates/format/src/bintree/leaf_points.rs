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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Attribute;
    use crate::bintree::LeafEncoder;

    #[test]
    fn what_was_encoded_comes_back_by_column() {
        let layout = RecordLayout::new([Attribute::new("intensity", AttributeType::UInt16, 1)]).unwrap();
        let (center, count) = ([100.0, -8.0, 0.5], 2 * BLOCK_POINTS + 3);
        let world = |i: usize| std::array::from_fn(|a| center[a] + (i + a) as f64 / 8.0);
        let mut points = NodePoints::default();
        for _ in 0..2 {
            reset(&mut points, &layout);
            assert_eq!((points.len(), points.stored.len()), (0, 0), "what was there before is gone");
            let mut leaf = LeafEncoder::new(&layout, center, &mut points.stored);
            for i in 0..count {
                let rest = leaf.push(world(i), (i % 7) as f64);
                rest[..2].copy_from_slice(&(3 * i as u16).to_le_bytes());
            }
            fill(&mut points, &layout, center);
        }
        assert_eq!(core(&points.stored), Some(([0.0, 0.125, 0.25], 0.0)));
        assert_eq!(core(&points.stored[layout.stride() * 5..]), Some(([0.625, 0.75, 0.875], 5.0)));
        assert_eq!(core(&points.stored[..CORE_BYTES - 1]), None);
        assert_eq!(points.len(), count);
        let (classes, intensities) = (points.column::<f32>("classification"), points.column::<u16>("intensity"));
        let (classes, intensities) = (classes.unwrap(), intensities.unwrap());
        let expected = |i: usize| (Some(world(i)), (i % 7) as f32, 3 * i as u16);
        assert!((0..count).all(|i| (points.world(i), classes[i], intensities[i]) == expected(i)));
    }
}
