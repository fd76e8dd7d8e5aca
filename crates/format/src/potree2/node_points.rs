//! Payloads to typed columns.

use crate::Column;

use super::metadata::planar_size;
use super::{Metadata, column_bytes, morton};
use crate::geometry::morton::deinterleave16;

/// The points of one node; reuse one from node to node and its memory is reused.
#[derive(Debug, Clone, Default)]
pub struct NodePoints {
    /// x, y, z on [`Metadata::lattice`].
    pub positions: [Vec<i32>; 3],
    /// All attributes but `position`, in the order of [`Metadata::attributes`].
    pub columns: Vec<Column>,
    /// Bytes as stored.
    pub(super) stored: Vec<u8>,
    /// Bytes after decompression.
    pub(super) planar: Vec<u8>,
}

/// Records that are taken apart at a time: all their bytes stay in the first-level cache from column to column.
const BLOCK_POINTS: usize = 512;

impl NodePoints {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions[0].len()
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// World coordinates of point `index`, or `None` past the last.
    pub fn world(&self, metadata: &Metadata, index: usize) -> Option<[f64; 3]> {
        let [x, y, z] = &self.positions;
        let quantized = [*x.get(index)?, *y.get(index)?, *z.get(index)?];
        Some(metadata.lattice.world(quantized.map(i64::from)))
    }

    /// Empties the columns and gives them the types of `metadata`.
    pub(super) fn reset(&mut self, metadata: &Metadata) {
        self.positions.iter_mut().for_each(Vec::clear);
        let types = metadata.attributes.iter().filter(|a| a.attribute.name != "position").map(|a| a.attribute.ty);
        if types.clone().eq(self.columns.iter().map(Column::ty)) {
            self.columns.iter_mut().for_each(Column::clear);
        } else {
            self.columns = types.map(Column::new).collect();
        }
    }

    /// Takes `self.stored` apart: whole records in DEFAULT layout.
    pub(super) fn fill_from_records(&mut self, metadata: &Metadata) {
        let record_len = metadata.record_len();
        for block in self.stored.chunks(record_len.saturating_mul(BLOCK_POINTS)) {
            let mut columns = self.columns.iter_mut();
            let mut at = 0;
            for attribute in metadata.attributes.iter().map(|a| &a.attribute) {
                if attribute.name == "position" {
                    for (axis, values) in self.positions.iter_mut().enumerate() {
                        column_bytes::append_i32(values, block, record_len, at + 4 * axis);
                    }
                } else if let Some(column) = columns.next() {
                    column_bytes::append(column, block, record_len, at, attribute.elements);
                }
                at += attribute.size();
            }
        }
    }

    /// Takes `self.planar` apart: `points` points in the decompressed BROTLI layout.
    pub(super) fn fill_from_planes(&mut self, metadata: &Metadata, points: usize) {
        let mut rest = self.planar.as_slice();
        let mut columns = self.columns.iter_mut();
        for attribute in metadata.attributes.iter().map(|a| &a.attribute) {
            let (plane, after) = rest.split_at(points * planar_size(attribute));
            rest = after;
            if attribute.name == "position" {
                fill_positions(&mut self.positions, plane);
                continue;
            }
            match (attribute.name.as_str(), columns.next()) {
                ("rgb", Some(Column::UInt16(values))) => fill_rgb(values, plane),
                (_, Some(column)) => column_bytes::append(column, plane, attribute.size(), 0, attribute.elements),
                (_, None) => {}
            }
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
