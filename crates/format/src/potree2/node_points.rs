//! Payloads to typed columns.

use crate::Column;
use crate::points::column_bytes;

use super::metadata::planar_size;
use super::{Metadata, morton};
use crate::geometry::morton::deinterleave16;

/// Records that are taken apart at a time: all their bytes stay in the first-level cache from column to column.
const BLOCK_POINTS: usize = 512;

/// Takes `stored` apart: whole records in DEFAULT layout. `columns`: those of all attributes but `position`.
pub(super) fn fill_from_records(
    stored: &[u8],
    metadata: &Metadata,
    positions: &mut [Vec<i32>; 3],
    columns: &mut [Column],
) {
    let record_len = metadata.record_len();
    for block in stored.chunks(record_len.saturating_mul(BLOCK_POINTS)) {
        let mut columns = columns.iter_mut();
        let mut at = 0;
        for attribute in metadata.attributes.iter().map(|a| &a.attribute) {
            if attribute.name == "position" {
                for (axis, values) in positions.iter_mut().enumerate() {
                    column_bytes::append_i32(values, block, record_len, at + 4 * axis);
                }
            } else if let Some(column) = columns.next() {
                column_bytes::append(column, block, record_len, at, attribute.elements);
            }
            at += attribute.size();
        }
    }
}

/// Takes `planes` apart: `points` points in the decompressed BROTLI layout.
pub(super) fn fill_from_planes(
    planes: &[u8],
    points: usize,
    metadata: &Metadata,
    positions: &mut [Vec<i32>; 3],
    columns: &mut [Column],
) {
    let (mut rest, mut columns) = (planes, columns.iter_mut());
    for attribute in metadata.attributes.iter().map(|a| &a.attribute) {
        let (plane, after) = rest.split_at(points * planar_size(attribute));
        rest = after;
        if attribute.name == "position" {
            fill_positions(positions, plane);
            continue;
        }
        match (attribute.name.as_str(), columns.next()) {
            ("rgb", Some(Column::UInt16(values))) => fill_rgb(values, plane),
            (_, Some(column)) => column_bytes::append(column, plane, attribute.size(), 0, attribute.elements),
            (_, None) => {}
        }
    }
}

fn fill_positions(positions: &mut [Vec<i32>; 3], plane: &[u8]) {
    let words = plane.as_chunks::<8>().0.as_chunks::<2>().0;
    let [xs, ys, zs] = positions;
    for values in [&mut *xs, &mut *ys, &mut *zs] {
        values.resize(words.len(), 0);
    }
    for ((([upper, lower], x), y), z) in words.iter().zip(xs).zip(ys).zip(zs) {
        [*x, *y, *z] = morton::position_from_words(u64::from_le_bytes(*upper), u64::from_le_bytes(*lower));
    }
}

fn fill_rgb(values: &mut Vec<u16>, plane: &[u8]) {
    let codes = plane.as_chunks::<8>().0;
    values.resize(3 * codes.len(), 0);
    for (rgb, code) in values.as_chunks_mut::<3>().0.iter_mut().zip(codes) {
        *rgb = deinterleave16(u64::from_le_bytes(*code));
    }
}
