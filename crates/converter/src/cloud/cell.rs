//! The points of one cell of the partition.

use pointmill_format::NodeKey;

use super::frames::JobBounds;
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
    /// Points known to repeat the place of another of the cell: those of places that very many share.
    pub(crate) repeats: u64,
    /// Extremes of the positions, known for the fullest cells.
    pub(crate) bounds: Option<JobBounds>,
    /// Sums and extremes of the positions, if some output needs them.
    pub(crate) moments: Moments,
}

/// A place that very many points share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SharedPlace {
    /// World coordinates.
    pub(crate) position: [f64; 3],
    pub(crate) points: u64,
}

impl Cell {
    /// Points, those of a place that very many share counted once.
    pub(crate) fn distinct(&self) -> u64 {
        self.points - self.repeats
    }

    /// Where the cell is among those of its level.
    pub(crate) fn xyz(&self) -> [u32; 3] {
        [self.key.x, self.key.y, self.key.z]
    }
}
