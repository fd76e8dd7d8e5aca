//! The info record: where the octree is, in the world and in the file.

use crate::Aabb;

/// The record of the user `copc` with the number 1, which is the first of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Info {
    /// The middle of the root's cube, world units: x, y, z.
    pub center: [f64; 3],
    /// From the middle of the cube to its sides, world units, > 0.
    pub half_size: f64,
    /// Distance between points in the root, world units, > 0; halves with every level.
    pub spacing: f64,
    /// First byte of the root's page of the hierarchy, in the file.
    pub root_page_offset: u64,
    /// Bytes of the root's page.
    pub root_page_size: u64,
    /// Least and greatest GPS time of all points; a claim.
    pub gps_time: [f64; 2],
}

impl Info {
    /// Bytes of the record: what follows the fields is reserved, and 0.
    pub const LEN: usize = 160;

    /// The byte of the file at which the record's data begins: it is the first record behind a header of 375 bytes.
    pub const OFFSET: u64 = 375 + 54;

    /// Takes the fields apart, whatever they say.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; Self::LEN]) -> Self {
        let field = |i: usize| {
            let mut out = [0; 8];
            out.copy_from_slice(&bytes[8 * i..8 * i + 8]);
            out
        };
        let double = |i| f64::from_le_bytes(field(i));
        Self {
            center: [double(0), double(1), double(2)],
            half_size: double(3),
            spacing: double(4),
            root_page_offset: u64::from_le_bytes(field(5)),
            root_page_size: u64::from_le_bytes(field(6)),
            gps_time: [double(7), double(8)],
        }
    }

    /// The bytes of the record.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::LEN] {
        let Self { center: [x, y, z], half_size, spacing, gps_time: [first, last], .. } = *self;
        let [x, y, z, half_size, spacing] = [x, y, z, half_size, spacing].map(f64::to_le_bytes);
        let [offset, size] = [self.root_page_offset, self.root_page_size].map(u64::to_le_bytes);
        let fields = [x, y, z, half_size, spacing, offset, size, first.to_le_bytes(), last.to_le_bytes()];
        let mut out = [0; Self::LEN];
        out.as_chunks_mut::<8>().0.iter_mut().zip(fields).for_each(|(out, field)| *out = field);
        out
    }

    /// The root's cube: middle ± half size.
    #[must_use]
    pub fn cube(&self) -> Aabb {
        Aabb { min: self.center.map(|c| c - self.half_size), max: self.center.map(|c| c + self.half_size) }
    }

    /// # Errors
    /// What no octree can have, and the byte of the record at which it stands.
    pub(super) fn check(&self) -> Result<(), (u64, String)> {
        let Self { center, half_size, spacing, .. } = *self;
        if let Some(axis) = center.iter().position(|c| !c.is_finite()) {
            return Err((8 * axis as u64, format!("the middle of the octree is {center:?}")));
        }
        let cube = self.cube();
        let is_cube = half_size > 0.0 && half_size.is_finite() && (0..3).all(|a| cube.min[a] < cube.max[a]);
        if !is_cube || !cube.extent().iter().all(|side| side.is_finite()) {
            return Err((24, format!("the half size of the octree is {half_size}, which makes no cube")));
        }
        if !(spacing > 0.0 && spacing.is_finite()) {
            return Err((32, format!("the spacing of the root is {spacing}, not a number greater than 0")));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_the_rest_is_zero() {
        let info = Info {
            center: [637_937.715, 851_217.565, -2.5],
            half_size: 2317.875,
            spacing: 36.25,
            root_page_offset: 31_604,
            root_page_size: 2080,
            gps_time: [-1.5, 1e9],
        };
        let bytes = info.to_bytes();
        assert_eq!(Info::from_bytes(&bytes), info);
        assert_eq!(bytes[40..44], 31_604u32.to_le_bytes());
        assert!(bytes[72..].iter().all(|b| *b == 0));
        assert_eq!(info.cube().min[2], -2320.375);
    }

    #[test]
    fn what_makes_no_cube_is_told_with_its_byte() {
        let sound = Info {
            center: [0.0; 3],
            half_size: 1.0,
            spacing: 0.1,
            root_page_offset: 0,
            root_page_size: 32,
            gps_time: [0.0; 2],
        };
        assert_eq!(sound.check(), Ok(()));
        let at = |info: Info| info.check().unwrap_err().0;
        assert_eq!(at(Info { center: [0.0, f64::NAN, 0.0], ..sound }), 8);
        for half_size in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e308] {
            assert_eq!(at(Info { half_size, ..sound }), 24, "{half_size}");
        }
        // rounded away
        assert_eq!(at(Info { center: [1e20; 3], ..sound }), 24);
        for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(at(Info { spacing, ..sound }), 32, "{spacing}");
        }
    }
}
