//! Cells that are too large divided, and nodes of the octree made of cells: how a cloud is cut into parts of a size.

use std::collections::BTreeMap;

use pointmill_format::NodeKey;

use super::cell::Cell;
use super::cube::TREE_BITS;
use super::frames::TreePoint;
use super::moments::Moments;
use super::morton;
use super::record::RecordFrame;
use super::regroup::Regrouper;
use super::segments::Segments;
use crate::error::ConvertError;
use crate::runtime::{Reservation, Workers};

/// Levels by which a cell that is too large is divided at once.
const SPLIT_LEVELS: u32 = 3;

/// The cells, those with more than `max_points` divided unless all of their points share one place; in Morton order. `room`: for the lists of what was divided.
pub(crate) fn divided(
    cells: &[Cell],
    frame: &RecordFrame,
    regrouper: &mut Regrouper<'_>,
    max_points: u64,
    workers: &Workers<'_>,
    room: &mut Reservation,
) -> Result<Vec<Cell>, ConvertError> {
    let mut lists = 0;
    let mut found = Vec::with_capacity(cells.len());
    // The stack returns the last first.
    let mut stack: Vec<Cell> = cells.iter().rev().cloned().collect();
    while let Some(cell) = stack.pop() {
        if cell.points <= max_points || cell.is_one_place {
            found.push(cell);
        } else {
            workers.check_stop()?;
            let parts = parts_of(&cell, frame, regrouper)?;
            lists += parts.iter().map(|part| part.segments.bytes() + size_of::<Cell>() as u64).sum::<u64>();
            room.grow_to(lists)?;
            stack.extend(parts.into_iter().rev());
        }
    }
    Ok(found)
}

/// The parts of a cell some levels below it, in Morton order.
fn parts_of(cell: &Cell, frame: &RecordFrame, regrouper: &mut Regrouper<'_>) -> Result<Vec<Cell>, ConvertError> {
    let levels = SPLIT_LEVELS.min(TREE_BITS - u32::from(cell.key.level));
    let shift = TREE_BITS - u32::from(cell.key.level) - levels;
    let mut extremes: Option<(TreePoint, TreePoint)> = None;
    let code = |record: &[u8]| {
        let t = frame.tree(record);
        let (lo, hi) = extremes.get_or_insert((t, t));
        for a in 0..3 {
            lo[a] = lo[a].min(t[a]);
            hi[a] = hi[a].max(t[a]);
        }
        morton::path(t, shift, levels)
    };
    let mut parts = BTreeMap::<u64, Segments>::new();
    regrouper.regroup(&cell.segments, code, |path, segment| parts.entry(path).or_default().push(segment))?;
    let is_one_place = extremes.is_some_and(|(lo, hi)| lo == hi);
    let part = |(path, segments): (u64, Segments)| {
        let key = (0..levels).rev().fold(cell.key, |key, l| key.child((path >> (3 * l) & 7) as u8).unwrap_or(key));
        Cell { is_one_place, ..Cell::new(key, segments, Moments::default()) }
    };
    Ok(parts.into_iter().map(part).collect())
}

/// Finds the highest nodes that are small enough (or hold one place only), and the cells in each.
pub(crate) fn highest_nodes(
    node: NodeKey,
    cells: &mut [Cell],
    max_points: u64,
    found: &mut impl FnMut(NodeKey, &mut [Cell]),
) {
    let points: u64 = cells.iter().map(|c| c.points).sum();
    if points == 0 {
        return;
    }
    let is_last = cells.len() == 1 && (cells[0].is_one_place || cells[0].key == node);
    if points <= max_points || is_last {
        found(node, cells);
        return;
    }
    let mut rest = cells;
    for child in (0..8).filter_map(|c| node.child(c)) {
        let inside = rest.iter().take_while(|c| c.key.ancestor(child.level) == Some(child)).count();
        let (mine, others) = rest.split_at_mut(inside);
        highest_nodes(child, mine, max_points, found);
        rest = others;
    }
    debug_assert!(rest.is_empty());
}
