//! A node of the index.

use crate::NodeKey;

/// A node, as the index has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Node {
    /// Its address.
    pub key: NodeKey,
    /// Bit i is set if child i exists. True of proxies, too.
    pub child_mask: u8,
    /// What the index says of its points. [`super::Dataset::count`] says what is there: the reference writes 0 for
    /// leaves.
    pub declared: u64,
    /// Its children are in an index file of its own ([`super::Dataset::read_index`]).
    pub is_proxy: bool,
}

impl Node {
    /// True if child `child` (0–7) exists.
    pub const fn has_child(&self, child: u8) -> bool {
        child < 8 && self.child_mask >> child & 1 == 1
    }
}
