//! What can be chosen of a binary tree.

use pointmill_format::bintree::{Layout, SplitRule};

use crate::sources::Schema;

/// The name under which a binary tree takes the colour as four bytes.
pub(super) const RGBA: &str = "rgba";

/// Settings of a mean-split binary tree (`docs/formats/bintree.md`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BintreeSettings {
    /// Maximum points of a leaf, ≥ 1.
    pub capacity: u32,
    /// Where a node is split.
    pub split: SplitRule,
    /// One file per leaf, or one for all.
    pub layout: Layout,
}

impl Default for BintreeSettings {
    fn default() -> Self {
        Self { capacity: 65_000, split: SplitRule::Mean, layout: Layout::Files }
    }
}

/// The classification, of any integer type.
pub(super) fn class_of(schema: &Schema) -> Option<usize> {
    schema.find("classification").filter(|&i| schema.attributes[i].elements == 1)
}
