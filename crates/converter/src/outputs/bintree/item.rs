//! A point of a subtree while it is partitioned: four words.

use crate::cloud::StoredPoint;

/// The integers of a record, and which record that is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(C)]
pub(super) struct Item {
    pub(super) q: StoredPoint,
    pub(super) record: u32,
}
