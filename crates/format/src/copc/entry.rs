//! An entry of a hierarchy page.

use crate::NodeKey;

/// An entry as it stands in a page of the hierarchy, whatever it says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// Level, x, y, z: those of a [`NodeKey`], if they make one.
    pub key: [i32; 4],
    /// First byte, in the file, of the node's chunk of points, or of its page; 0 without points.
    pub offset: u64,
    /// Bytes of the chunk or page; 0 without points.
    pub byte_size: i32,
    /// Points of the node alone; [`Self::PAGE`]: what is known of it is in another page.
    pub points: i32,
}

impl Entry {
    /// Bytes of an entry.
    pub const LEN: usize = 32;

    /// In place of a number of points: the entry leads to a page.
    pub const PAGE: i32 = -1;

    /// Takes the fields apart.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; Self::LEN]) -> Self {
        let word = |i: usize| {
            let mut out = [0; 4];
            out.copy_from_slice(&bytes[4 * i..4 * i + 4]);
            out
        };
        let int = |i| i32::from_le_bytes(word(i));
        let offset = u64::from(u32::from_le_bytes(word(5))) << 32 | u64::from(u32::from_le_bytes(word(4)));
        Self { key: [int(0), int(1), int(2), int(3)], offset, byte_size: int(6), points: int(7) }
    }

    /// The bytes of the entry.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::LEN] {
        let [level, x, y, z] = self.key;
        let (low, high) = (self.offset as u32, (self.offset >> 32) as u32);
        let words = [level, x, y, z, low.cast_signed(), high.cast_signed(), self.byte_size, self.points];
        let mut out = [0; Self::LEN];
        out.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(out, word)| *out = word.to_le_bytes());
        out
    }

    /// The node's address; `None` if there is none like it.
    #[must_use]
    pub fn node_key(&self) -> Option<NodeKey> {
        let [level, x, y, z] = self.key;
        let level = u8::try_from(level).ok().filter(|level| *level <= NodeKey::MAX_LEVEL)?;
        let cell = |v: i32| u32::try_from(v).ok().filter(|v| v >> level == 0);
        Some(NodeKey { level, x: cell(x)?, y: cell(y)?, z: cell(z)? })
    }

    /// The four numbers of an address. Cells of a [`NodeKey`] have 31 bits at most.
    #[must_use]
    pub fn key_of(node: NodeKey) -> [i32; 4] {
        [i32::from(node.level), node.x.cast_signed(), node.y.cast_signed(), node.z.cast_signed()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_round_trip_and_keys_that_are_none_are_found() {
        let entry = Entry { key: [3, 7, 0, 5], offset: 0x1_2345_6789_abcd, byte_size: 454, points: Entry::PAGE };
        let bytes = entry.to_bytes();
        assert_eq!(Entry::from_bytes(&bytes), entry);
        assert_eq!(bytes[16..24], 0x1_2345_6789_abcd_u64.to_le_bytes());
        let key = entry.node_key().unwrap();
        assert_eq!(key.to_string(), "r545"); // x 7 = 111, y 0 = 000, z 5 = 101
        assert_eq!(Entry::key_of(key), entry.key);
        for key in [[-1, 0, 0, 0], [32, 0, 0, 0], [0, 1, 0, 0], [3, 8, 0, 0], [3, 0, -1, 0], [3, 0, 0, i32::MAX]] {
            assert_eq!(Entry { key, ..entry }.node_key(), None, "{key:?}");
        }
        let deepest = Entry { key: [31, i32::MAX, 0, i32::MAX], ..entry };
        assert_eq!(Entry::key_of(deepest.node_key().unwrap()), deepest.key);
    }
}
