//! The header: LAS 1.4.

use crate::{Aabb, Lattice};

use super::records::fixed;

/// Bytes of the header.
pub(super) const HEADER: usize = 375;

/// What is known when all points are written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// All points.
    pub points: u64,
    /// Points by the number of their return, 1 to 15; those of return 0 are in none.
    pub points_by_return: [u64; 15],
    /// The box of the points, world units.
    pub bounds: Aabb,
    /// Least and greatest GPS time.
    pub gps_time: [f64; 2],
}

/// What the header is made of.
pub(super) struct Fields<'a> {
    pub(super) point_format: u8,
    pub(super) record_len: u16,
    pub(super) lattice: Lattice,
    pub(super) software: &'a str,
    pub(super) is_adjusted_time: bool,
    pub(super) records: u32,
    pub(super) points_start: u32,
    pub(super) hierarchy_start: u64,
    pub(super) summary: &'a Summary,
}

impl Fields<'_> {
    pub(super) fn bytes(&self) -> [u8; HEADER] {
        let mut out = [0; HEADER];
        let Summary { points, points_by_return, bounds, .. } = *self.summary;
        put(&mut out, 0, b"LASF");
        // bit 0: GPS time is adjusted standard time; bit 4: the coordinate reference system is WKT
        put(&mut out, 6, &(u16::from(self.is_adjusted_time) | 1 << 4).to_le_bytes());
        put(&mut out, 24, &[1, 4]);
        put(&mut out, 58, &fixed::<32>(self.software));
        put(&mut out, 94, &(HEADER as u16).to_le_bytes());
        put(&mut out, 96, &self.points_start.to_le_bytes());
        put(&mut out, 100, &self.records.to_le_bytes());
        put(&mut out, 104, &[self.point_format | 1 << 7]);
        put(&mut out, 105, &self.record_len.to_le_bytes());
        let Lattice { scale, offset } = self.lattice;
        let sides = (0..3).flat_map(|a| [bounds.max[a], bounds.min[a]]);
        for (i, value) in scale.into_iter().chain(offset).chain(sides).enumerate() {
            put(&mut out, 131 + 8 * i, &value.to_le_bytes());
        }
        put(&mut out, 235, &self.hierarchy_start.to_le_bytes());
        put(&mut out, 243, &1u32.to_le_bytes());
        for (i, count) in [points].into_iter().chain(points_by_return).enumerate() {
            put(&mut out, 247 + 8 * i, &count.to_le_bytes());
        }
        out
    }
}

fn put(out: &mut [u8], at: usize, bytes: &[u8]) {
    out[at..at + bytes.len()].copy_from_slice(bytes);
}
