//! One record of an `.hrc`: 5 bytes.

/// A record as it stands on disk, little-endian, no padding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IndexRecord {
    /// Byte 0: bit i is set if child i exists.
    pub child_mask: u8,
    /// Bytes 1–4: points of the node alone. The reference writes 0 for leaves.
    pub points: u32,
}

impl IndexRecord {
    /// Bytes on disk.
    pub const LEN: usize = 5;

    /// Reads a record.
    #[must_use]
    pub const fn from_bytes(bytes: &[u8; Self::LEN]) -> Self {
        let [child_mask, a, b, c, d] = *bytes;
        Self { child_mask, points: u32::from_le_bytes([a, b, c, d]) }
    }

    /// The bytes of a record.
    #[must_use]
    pub const fn to_bytes(&self) -> [u8; Self::LEN] {
        let [a, b, c, d] = self.points.to_le_bytes();
        [self.child_mask, a, b, c, d]
    }

    /// True if child `child` (0–7) exists.
    pub const fn has_child(&self, child: u8) -> bool {
        child < 8 && self.child_mask >> child & 1 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first records that PotreeConverter 1.7 wrote for a lion.
    #[test]
    fn records_of_the_reference_converter_are_read_and_written_back() {
        let bytes = [0x5f, 0x1c, 0x30, 0, 0];
        let record = IndexRecord::from_bytes(&bytes);
        assert_eq!(record, IndexRecord { child_mask: 0x5f, points: 12_316 });
        let children: Vec<u8> = (0..9).filter(|child| record.has_child(*child)).collect();
        assert_eq!(children, [0, 1, 2, 3, 4, 6]);
        assert_eq!(record.to_bytes(), bytes);
    }
}
