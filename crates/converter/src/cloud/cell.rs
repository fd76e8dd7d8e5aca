//! Where points are: cells of the octree as they are stored, and how many points there are in each.

use std::collections::HashMap;

use pointmill_format::NodeKey;
use serde::{Deserialize, Serialize};

use super::frames::JobBounds;
use super::moments::Moments;
use super::segments::Segments;

/// The points of one octree cell, wherever they are stored. Which cells these are depends on memory and on the order of
/// the points; what must not depend on them is in the [`CensusCell`]s.
#[derive(Debug, Clone, Serialize, Deserialize)]
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
    /// A cell of which no more is known than where its records are.
    pub(crate) fn new(key: NodeKey, segments: Segments, moments: Moments) -> Self {
        Self { key, points: segments.points(), segments, is_one_place: false, moments }
    }
}

/// How many points there are in an occupied cell of the octree: the same for the same points, in whatever order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct CensusCell {
    pub(crate) key: NodeKey,
    pub(crate) points: u64,
    /// Points known to repeat the place of another of the cell: those of places that very many share.
    pub(crate) repeats: u64,
}

impl CensusCell {
    /// Points, those of a place that very many share counted once.
    pub(crate) fn distinct(&self) -> u64 {
        self.points - self.repeats
    }
}

/// How many points there are where.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Census {
    /// Every occupied cell of one level of the octree, in Morton order.
    pub(crate) cells: Vec<CensusCell>,
    /// Extremes of the positions in the fullest of them.
    pub(crate) bounds: HashMap<NodeKey, JobBounds>,
}

/// A place that very many points share.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct SharedPlace {
    /// World coordinates.
    pub(crate) position: [f64; 3],
    pub(crate) points: u64,
}

/// Where a node is among those of its level.
pub(crate) fn xyz(key: NodeKey) -> [u32; 3] {
    [key.x, key.y, key.z]
}

/// The node of a level with that Morton code.
pub(crate) fn node(code: u64, level: u32) -> NodeKey {
    let child = |key: NodeKey, l: u32| key.child((code >> (3 * l) & 7) as u8).unwrap_or(key);
    (0..level).rev().fold(NodeKey::ROOT, child)
}
