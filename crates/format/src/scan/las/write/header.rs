//! The header: LAS 1.2 and 1.4.

use super::records::fixed;
use super::tally::Summary;
use crate::Lattice;

/// Bytes of the header.
pub(super) const LEN_1_2: usize = 227;
pub(crate) const LEN_1_4: usize = 375;

/// What the header is made of.
pub(crate) struct Fields<'a> {
    /// Else 1.2.
    pub(crate) is_1_4: bool,
    pub(crate) point_format: u8,
    pub(crate) is_compressed: bool,
    pub(crate) record_len: u16,
    pub(crate) lattice: Lattice,
    pub(crate) software: &'a str,
    pub(crate) is_adjusted_time: bool,
    /// The coordinate reference system is WKT, not GeoTIFF keys.
    pub(crate) is_wkt: bool,
    pub(crate) records: u32,
    pub(crate) points_start: u32,
    /// Where the extended records start, and how many they are.
    pub(crate) extended: (u64, u32),
    pub(crate) summary: &'a Summary,
}

impl Fields<'_> {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut out = vec![0; if self.is_1_4 { LEN_1_4 } else { LEN_1_2 }];
        let Summary { points, points_by_return, bounds, .. } = *self.summary;
        put(&mut out, 0, b"LASF");
        // bit 0: GPS time is adjusted standard time; bit 4: the coordinate reference system is WKT
        put(&mut out, 6, &(u16::from(self.is_adjusted_time) | u16::from(self.is_wkt) << 4).to_le_bytes());
        put(&mut out, 24, if self.is_1_4 { &[1, 4] } else { &[1, 2] });
        put(&mut out, 58, &fixed::<32>(self.software));
        let len = out.len() as u16;
        put(&mut out, 94, &len.to_le_bytes());
        put(&mut out, 96, &self.points_start.to_le_bytes());
        put(&mut out, 100, &self.records.to_le_bytes());
        put(&mut out, 104, &[self.point_format | u8::from(self.is_compressed) << 7]);
        put(&mut out, 105, &self.record_len.to_le_bytes());
        if let Some(legacy) = self.legacy_counts() {
            legacy.iter().enumerate().for_each(|(i, count)| put(&mut out, 107 + 4 * i, &count.to_le_bytes()));
        }
        let Lattice { scale, offset } = self.lattice;
        let sides = (0..3).flat_map(|a| [bounds.max[a], bounds.min[a]]);
        for (i, value) in scale.into_iter().chain(offset).chain(sides).enumerate() {
            put(&mut out, 131 + 8 * i, &value.to_le_bytes());
        }
        if self.is_1_4 {
            let (start, count) = self.extended;
            put(&mut out, 235, &start.to_le_bytes());
            put(&mut out, 243, &count.to_le_bytes());
            for (i, count) in [points].into_iter().chain(points_by_return).enumerate() {
                put(&mut out, 247 + 8 * i, &count.to_le_bytes());
            }
        }
        out
    }

    /// The number of points, and those of returns 1 to 5, as headers before 1.4 have them; none if they are more than these
    /// can say, or of a format that is younger.
    fn legacy_counts(&self) -> Option<[u32; 6]> {
        let Summary { points, points_by_return: by, .. } = *self.summary;
        let points = u32::try_from(points).ok().filter(|_| self.point_format < 6)?;
        // no more than all points
        let [a, b, c, d, e] = [by[0], by[1], by[2], by[3], by[4]].map(|count| count as u32);
        Some([points, a, b, c, d, e])
    }
}

fn put(out: &mut [u8], at: usize, bytes: &[u8]) {
    out[at..at + bytes.len()].copy_from_slice(bytes);
}
