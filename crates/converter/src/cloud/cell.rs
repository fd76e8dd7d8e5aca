//! The points of one cell of the partition.

use pointmill_format::NodeKey;

use super::moments::Moments;
use super::segments::Segments;

/// The points of one octree cell, wherever they are stored.
#[derive(Debug, Clone)]
pub(crate) struct Cell {
    pub(crate) key: NodeKey,
    pub(crate) points: u64,
    pub(crate) segments: Segments,
    /// All points share one place (known only for cells that had to be looked into).
    pub(crate) is_one_place: bool,
    /// Sums and extremes of the positions, if some output needs them.
    pub(crate) moments: Moments,
}

impl Cell {
    /// Where the cell is among those of its level.
    pub(crate) fn xyz(&self) -> [u32; 3] {
        [self.key.x, self.key.y, self.key.z]
    }
}
