//! Which part of a dataset a finding is about.

use std::fmt;

use pointmill_format::NodeKey;
use serde::{Serialize, Serializer};

/// A node or batch. Orders as the dataset stores them, so that reports list the coarse or the first ones first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Place {
    /// A node of an octree; prints as its name ("r042").
    Octree(NodeKey),
    /// A node of a binary tree.
    Binary(BinaryNode),
    /// A batch of 10,240 points, by its Morton order; prints as "batch 17".
    Batch(u32),
}

/// A node of a binary tree; prints as the path to it, "n0110", and below depth 64 as its index, "node 1234".
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BinaryNode {
    /// Place in preorder.
    pub index: u32,
    /// 0 for the root.
    pub depth: u16,
    /// The steps to it, 1 for the high side, the last one in the lowest bit; whole down to depth 64.
    pub path: u64,
}

impl BinaryNode {
    /// Steps that `path` holds.
    pub const MAX_STEPS: u32 = u64::BITS;
}

impl fmt::Display for BinaryNode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if u32::from(self.depth) > Self::MAX_STEPS {
            return write!(f, "node {}", self.index);
        }
        f.write_str("n")?;
        (0..self.depth).rev().try_for_each(|step| write!(f, "{}", self.path >> step & 1))
    }
}

impl From<NodeKey> for Place {
    fn from(key: NodeKey) -> Self {
        Self::Octree(key)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Octree(key) => key.fmt(f),
            Self::Binary(node) => node.fmt(f),
            Self::Batch(index) => write!(f, "batch {index}"),
        }
    }
}

impl Serialize for Place {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_of_binary_trees_print_as_paths_down_to_depth_64() {
        let node = |depth, path| BinaryNode { index: 9, depth, path }.to_string();
        assert_eq!(node(0, 0), "n");
        assert_eq!(node(4, 0b0110), "n0110");
        assert_eq!(node(64, 1), format!("n{}1", "0".repeat(63)));
        assert_eq!(node(65, 1), "node 9");
    }
}
