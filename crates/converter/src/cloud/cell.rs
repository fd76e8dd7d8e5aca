//! Where points are: cells of the octree as they are stored, and how many points there are in each.

use std::collections::HashMap;

use pointmill_format::NodeKey;
use serde::{Deserialize, Serialize};

use super::cube::TREE_BITS;
use super::frames::JobBounds;
use super::moments::Moments;
use super::morton;
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

    /// True if cells can be all of a cloud with so many points: where others have found them, nobody has looked.
    pub(crate) fn can_be_of(cells: &[Self], points: u64) -> bool {
        are_in_order(cells.iter().map(|cell| cell.key), NodeKey::ROOT)
            && cells.iter().all(|cell| cell.points == cell.segments.points())
            && add_up(cells.iter().map(|cell| cell.points), points)
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
    /// True if cells can be all of a cloud with so many points: where others have counted them, nobody has looked.
    pub(crate) fn can_be_of(cells: &[Self], points: u64) -> bool {
        are_in_order(cells.iter().map(|cell| cell.key), NodeKey::ROOT)
            && cells.iter().all(|cell| cell.repeats <= cell.points)
            && add_up(cells.iter().map(|cell| cell.points), points)
    }

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

/// True if numbers that may be any add up to `sum`.
pub(crate) fn add_up(numbers: impl IntoIterator<Item = u64>, sum: u64) -> bool {
    numbers.into_iter().try_fold(0u64, |all, number| all.checked_add(number)) == Some(sum)
}

/// True if what may be any key is that of a node, which is another one or lies in it.
pub(crate) fn lies_in(node: NodeKey, other: NodeKey) -> bool {
    let is_node = node.level <= NodeKey::MAX_LEVEL && xyz(node).into_iter().all(|c| u64::from(c) >> node.level == 0);
    is_node && node.ancestor(other.level) == Some(other)
}

/// True if what may be any keys are those of nodes in `root`, in Morton order, none of which lies in another.
pub(crate) fn are_in_order(keys: impl IntoIterator<Item = NodeKey>, root: NodeKey) -> bool {
    let mut before: Option<[u32; 3]> = None;
    keys.into_iter().all(|key| {
        if !lies_in(key, root) {
            return false;
        }
        let shift = TREE_BITS - u32::from(key.level);
        let first = xyz(key).map(|c| c << shift);
        let is_behind = before.is_none_or(|last| morton::compare(last, first).is_lt());
        before = Some(first.map(|c| c | ((1 << shift) - 1)));
        is_behind
    })
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

#[cfg(test)]
mod tests {
    use super::super::segments::Segment;
    use super::*;

    #[test]
    fn cells_that_cannot_be_are_told_from_others() {
        let key = NodeKey { level: 2, x: 3, y: 0, z: 1 };
        let cell = |key: NodeKey, points: u64| {
            let mut segments = Segments::default();
            segments.push(Segment { block: 0, start: 0, count: 5 });
            Cell { points, ..Cell::new(key, segments, Moments::default()) }
        };
        let next = NodeKey { z: 2, ..key };
        assert!(Cell::can_be_of(&[cell(key, 5), cell(next, 5)], 10));
        for others in [[next, key], [key, key], [key, key.parent().unwrap()], [key.parent().unwrap(), key]] {
            assert!(!Cell::can_be_of(&others.map(|key| cell(key, 5)), 10), "{others:?}");
        }
        let outside = NodeKey { x: 4, ..key };
        let deep = NodeKey { level: 40, ..key };
        for (cell, sum) in [(cell(key, 5), 6), (cell(key, 6), 6), (cell(outside, 5), 5), (cell(deep, 5), 5)] {
            assert!(!Cell::can_be_of(&[cell], sum));
        }
        let counted = |points, repeats| CensusCell { key, points, repeats };
        assert!(CensusCell::can_be_of(&[counted(5, 5)], 5) && !CensusCell::can_be_of(&[counted(5, 6)], 5));
        let more = CensusCell { key: next, ..counted(6, 0) };
        assert!(!CensusCell::can_be_of(&[counted(u64::MAX, 0), more], 5), "sums that overflow");
    }
}
