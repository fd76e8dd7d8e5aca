//! A node as the index describes it.

use std::fmt::{self, Write as _};

use crate::Aabb;

/// The file of the tree.
pub const INDEX_FILE: &str = "index.json";

/// The file of all leaves in layout `packed`.
pub const PACKED_FILE: &str = "leaves.bin";

/// The deepest level that is read or written; the root is at 0. The rules of `docs/formats/bintree.md` (section 6.3)
/// end long before.
pub const MAX_DEPTH: usize = 512;

/// The longest path whose file name, with `n` and `.bin`, file systems accept (255 bytes).
pub(super) const MAX_NAMED_DEPTH: usize = 250;

/// A node. Its index in preorder is not part of it: the low child of node `i` is `i + 1`.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Node {
    /// The tight box, world coordinates: of a leaf that of its decoded points, else the union of its children's.
    pub bounds: Aabb,
    /// Points at and below the node, ≥ 1.
    pub count: u64,
    /// Inner node or leaf.
    pub kind: NodeKind,
}

/// What a node is. Version 1 of the format has these three.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NodeKind {
    /// Split by a plane.
    Inner {
        /// The axis that the plane is perpendicular to: 0, 1 or 2.
        axis: u8,
        /// World coordinate of the plane, which belongs to the low side.
        split: f64,
        /// Index of the high child.
        high: u32,
    },
    /// All points at one place, cut by number.
    Degenerate {
        /// Index of the high child.
        high: u32,
    },
    /// Points.
    Leaf {
        /// What the offsets of the records are relative to, world coordinates.
        center: [f64; 3],
        /// Layout `packed`: the byte of `leaves.bin` where the records start. Layout `files`: `None`.
        start: Option<u64>,
    },
}

impl Node {
    /// A node. `bounds`: world coordinates; `count`: points at and below it.
    #[must_use]
    pub const fn new(bounds: Aabb, count: u64, kind: NodeKind) -> Self {
        Self { bounds, count, kind }
    }

    /// True if the node has points itself.
    pub const fn is_leaf(&self) -> bool {
        matches!(self.kind, NodeKind::Leaf { .. })
    }

    /// Index of the high child, unless this is a leaf.
    pub const fn high(&self) -> Option<u32> {
        match self.kind {
            NodeKind::Inner { high, .. } | NodeKind::Degenerate { high } => Some(high),
            NodeKind::Leaf { .. } => None,
        }
    }

    /// What is wrong with the node by itself, if anything is.
    pub(super) fn fault(&self) -> Option<String> {
        let Aabb { min, max } = self.bounds;
        let finite = |values: [f64; 3]| values.iter().all(|v| v.is_finite());
        match self.kind {
            _ if self.count == 0 => Some("has no points".into()),
            _ if self.bounds.is_empty() || !finite(min) || !finite(max) => {
                Some(format!("has a box with min {min:?} and max {max:?}"))
            }
            NodeKind::Inner { axis, split, .. } if axis > 2 || !split.is_finite() => {
                Some(format!("is split along axis {axis} at {split}"))
            }
            NodeKind::Leaf { center, .. } if !finite(center) => Some(format!("has the center {center:?}")),
            _ => None,
        }
    }
}

/// The way from the root down to a node: for each step, true for the high side. Prints as digits, as in file names.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodePath(Vec<bool>);

impl NodePath {
    /// Steps: the node's depth; 0 for the root.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// True for the root.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The steps, the first at the root.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = bool> + '_ {
        self.0.iter().copied()
    }
}

impl FromIterator<bool> for NodePath {
    fn from_iter<I: IntoIterator<Item = bool>>(steps: I) -> Self {
        Self(steps.into_iter().collect())
    }
}

impl IntoIterator for NodePath {
    type Item = bool;
    type IntoIter = std::vec::IntoIter<bool>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl fmt::Display for NodePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.iter().try_for_each(|high| f.write_char(if high { '1' } else { '0' }))
    }
}

/// The file of the leaf at the end of `path` in layout `files`: for each step from the root down, true for the high
/// side.
pub fn leaf_file_name(path: impl IntoIterator<Item = bool>) -> String {
    let digits = path.into_iter().map(|high| if high { '1' } else { '0' });
    std::iter::once('n').chain(digits).chain(".bin".chars()).collect()
}
