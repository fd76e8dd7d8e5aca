//! Which part of a dataset a finding is about.

use std::fmt;

use pointmill_format::NodeKey;
use serde::{Serialize, Serializer};

/// A node or batch. Orders as the dataset stores them, so that reports list the coarse or the first ones first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Place {
    /// A node of an octree; prints as its name ("r042").
    Octree(NodeKey),
    /// A batch of 10,240 points, by its Morton order; prints as "batch 17".
    Batch(u32),
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
            Self::Batch(index) => write!(f, "batch {index}"),
        }
    }
}

impl Serialize for Place {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
