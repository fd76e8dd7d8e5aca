//! A run of points in memory: positions, and one column per attribute.

use super::Column;

/// Positions of a batch, x, y, z of equal length.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// Integers on the scan's own lattice ([`crate::ScanInfo::lattice`]).
    Quantized([Vec<i32>; 3]),
    /// World coordinates, for scans that have no lattice.
    World([Vec<f64>; 3]),
}

impl Positions {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::Quantized(p) => p[0].len(),
            Self::World(p) => p[0].len(),
        }
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A run of points of one scan, in file order.
#[derive(Debug, Clone, PartialEq)]
pub struct PointBatch {
    /// Index in the scan of the first point.
    pub first_point: u64,
    /// Where the points are.
    pub positions: Positions,
    /// One column for each of [`crate::ScanInfo::attributes`], in that order; columns that were not wanted are empty.
    pub columns: Vec<Column>,
}

impl PointBatch {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}
