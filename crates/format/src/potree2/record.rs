//! One record of `hierarchy.bin`: 22 bytes.

use crate::NodeKey;
use crate::octree::Keyed;

/// What the first byte of a record says; the format has these three. Do not distinguish inner nodes from leaves by it:
/// PotreeConverter 2 marks most inner nodes as leaves; [`NodeRecord::child_mask`] is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NodeType {
    /// An inner node.
    Normal = 0,
    /// A node without children.
    Leaf = 1,
    /// A stand-in: the node and its descendants are in a separate chunk.
    Proxy = 2,
}

/// A record as it stands on disk, little-endian, no padding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeRecord {
    /// Byte 0: a [`NodeType`], raw.
    pub node_type: u8,
    /// Byte 1: bit i is set if child i exists. Without meaning in a proxy.
    pub child_mask: u8,
    /// Bytes 2–5: points of the node alone, without descendants.
    pub points: u32,
    /// Bytes 6–13: where the payload starts in `octree.bin`; of a proxy: where its chunk starts in `hierarchy.bin`.
    pub byte_offset: u64,
    /// Bytes 14–21: length of the payload, or of the proxy's chunk, in bytes.
    pub byte_size: u64,
}

impl NodeRecord {
    /// Bytes on disk.
    pub const LEN: usize = 22;

    /// Reads a record.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; Self::LEN]) -> Self {
        let [node_type, child_mask, p0, p1, p2, p3, o0, o1, o2, o3, o4, o5, o6, o7, s0, s1, s2, s3, s4, s5, s6, s7] =
            *bytes;
        Self {
            node_type,
            child_mask,
            points: u32::from_le_bytes([p0, p1, p2, p3]),
            byte_offset: u64::from_le_bytes([o0, o1, o2, o3, o4, o5, o6, o7]),
            byte_size: u64::from_le_bytes([s0, s1, s2, s3, s4, s5, s6, s7]),
        }
    }

    /// The bytes of a record.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[0] = self.node_type;
        bytes[1] = self.child_mask;
        bytes[2..6].copy_from_slice(&self.points.to_le_bytes());
        bytes[6..14].copy_from_slice(&self.byte_offset.to_le_bytes());
        bytes[14..22].copy_from_slice(&self.byte_size.to_le_bytes());
        bytes
    }

    /// True if the node is in a separate chunk.
    pub const fn is_proxy(&self) -> bool {
        self.node_type == NodeType::Proxy as u8
    }

    /// True if child `child` (0–7) exists. Not known of a proxy: false.
    pub const fn has_child(&self, child: u8) -> bool {
        !self.is_proxy() && child < 8 && self.child_mask >> child & 1 == 1
    }
}

/// A node of the octree and its record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Node {
    /// Its address.
    pub key: NodeKey,
    /// Its record, as stored where it was found.
    pub record: NodeRecord,
}

impl Node {
    /// The node of that address and record.
    #[must_use]
    pub const fn new(key: NodeKey, record: NodeRecord) -> Self {
        Self { key, record }
    }
}

/// A node to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct NodeEntry {
    /// Its address.
    pub key: NodeKey,
    /// Points of the node alone.
    pub points: u32,
    /// Where its payload starts in `octree.bin`.
    pub byte_offset: u64,
    /// Bytes of its payload.
    pub byte_size: u64,
}

impl NodeEntry {
    /// The node `key` with `points` points, whose payload is `byte_size` bytes of `octree.bin`, from `byte_offset` on.
    #[must_use]
    pub const fn new(key: NodeKey, points: u32, byte_offset: u64, byte_size: u64) -> Self {
        Self { key, points, byte_offset, byte_size }
    }
}

impl Keyed for NodeEntry {
    fn key(&self) -> NodeKey {
        self.key
    }
}

impl From<&Node> for NodeEntry {
    fn from(node: &Node) -> Self {
        let NodeRecord { points, byte_offset, byte_size, .. } = node.record;
        Self { key: node.key, points, byte_offset, byte_size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first record that PotreeConverter 2.1.1 wrote for the lion of the Potree repository, and a proxy.
    #[test]
    fn records_of_the_reference_converter_are_read_and_written_back() {
        let root = [0, 0xff, 0xb0, 0x34, 0, 0, 0x7d, 0x83, 0xcd, 0, 0, 0, 0, 0, 0x30, 0x70, 0x08, 0, 0, 0, 0, 0];
        let record = NodeRecord::from_bytes(&root);
        let expected = NodeRecord {
            node_type: 0,
            child_mask: 0xff,
            points: 13_488,
            byte_offset: 13_468_541,
            byte_size: 553_008, // 13,488 points of 41 bytes
        };
        assert_eq!(record, expected);
        assert_eq!(record.to_bytes(), root);

        let proxy = [2, 0, 0xc0, 0x3f, 0, 0, 0xda, 8, 0, 0, 0, 0, 0, 0, 0x2a, 8, 0, 0, 0, 0, 0, 0];
        let record = NodeRecord::from_bytes(&proxy);
        assert!(record.is_proxy() && !record.has_child(0));
        assert_eq!((record.points, record.byte_offset, record.byte_size), (16_320, 2_266, 95 * 22));
    }
}
