//! Cuts the cloud into subtrees of a size that does not depend on memory, and these into chunks that are small enough to be
//! built in memory. Which nodes are the roots of subtrees is part of the result ([`super::units`]); which are chunks is
//! not.

use std::collections::BTreeMap;

use pointmill_format::NodeKey;
use serde::{Deserialize, Serialize};

use crate::cloud::{
    Cell, Cloud, Moments, RecordFrame, Regrouper, Segments, TREE_BITS, TreePoint, add_up, are_in_order, morton,
};
use crate::error::ConvertError;
use crate::job::Build;
use crate::runtime::{Consumer, Reservation, Runtime};

/// A subtree that is built in memory.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Chunk {
    pub(super) key: NodeKey,
    pub(super) points: u64,
    /// Where its records are, in order of block.
    pub(super) segments: Segments,
}

/// A subtree that one thread builds, from the chunks that it consists of, in Morton order.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Subtree {
    pub(super) key: NodeKey,
    pub(super) chunks: Vec<Chunk>,
}

impl Subtree {
    /// True if these can be all of a cloud with so many points: where others have divided it, nobody has looked.
    fn can_be_of(subtrees: &[Self], points: u64) -> bool {
        let keys = |chunks: &[Chunk]| chunks.iter().map(|chunk| chunk.key).collect::<Vec<_>>();
        let is_subtree =
            |subtree: &Self| !subtree.chunks.is_empty() && are_in_order(keys(&subtree.chunks), subtree.key);
        let chunks = || subtrees.iter().flat_map(|subtree| &subtree.chunks);
        are_in_order(subtrees.iter().map(|subtree| subtree.key), NodeKey::ROOT)
            && subtrees.iter().all(is_subtree)
            && chunks().all(|chunk| chunk.points == chunk.segments.points())
            && add_up(chunks().map(|chunk| chunk.points), points)
    }
}

/// How a cloud is divided.
pub(super) struct Division {
    pub(super) subtrees: Vec<Subtree>,
    /// A chunk with more points has them all in one place. It is that of the process that has divided the cloud.
    pub(super) chunk_points: u64,
    /// What the lists take.
    _room: Reservation,
}

/// Levels by which a cell that is too large is divided at once.
const SPLIT_LEVELS: u32 = 3;

/// The largest subtrees of at most `unit_points` in Morton order, in chunks of at most `chunk_points`, unless the points of
/// one share one place; and what these lists take.
pub(super) fn divide(build: Build<'_>, unit_points: u64, chunk_points: u64) -> Result<Division, ConvertError> {
    let Build { cloud, rt, .. } = build;
    let mut room = Reservation::new(&rt.memory, Consumer::Cells);
    let can_be = |(subtrees, _): &(Vec<Subtree>, u64)| Subtree::can_be_of(subtrees, cloud.points());
    let (subtrees, chunk_points) =
        build.divided(can_be, || Ok((divide_now(cloud, rt, unit_points, chunk_points, &mut room)?, chunk_points)))?;
    let bytes = |chunk: &Chunk| chunk.segments.bytes() + size_of::<Chunk>() as u64;
    let of_subtree = |s: &Subtree| s.chunks.iter().map(bytes).sum::<u64>() + 2 * size_of::<Subtree>() as u64;
    room.resize(subtrees.iter().map(of_subtree).sum())?;
    Ok(Division { subtrees, chunk_points, _room: room })
}

fn divide_now(
    cloud: &Cloud<'_>,
    rt: &Runtime<'_>,
    unit_points: u64,
    chunk_points: u64,
    room: &mut Reservation,
) -> Result<Vec<Subtree>, ConvertError> {
    let max_points = unit_points.min(chunk_points);
    let mut lists = 0;
    let mut regrouper = Regrouper::new(&cloud.store, cloud.frame.stride);
    let mut cells = Vec::with_capacity(cloud.cells.len());
    // The stack returns the last first.
    let mut stack: Vec<Cell> = cloud.cells.iter().rev().cloned().collect();
    while let Some(cell) = stack.pop() {
        if cell.points <= max_points || cell.is_one_place {
            cells.push(cell);
        } else {
            rt.check_stop()?;
            let parts = divide_cell(&cell, &cloud.frame, &mut regrouper)?;
            lists += parts.iter().map(|part| part.segments.bytes() + size_of::<Cell>() as u64).sum::<u64>();
            room.grow_to(lists)?;
            stack.extend(parts.into_iter().rev());
        }
    }
    cloud.store.drop_spare(u64::MAX)?;
    let mut subtrees = Vec::new();
    choose(NodeKey::ROOT, &mut cells, unit_points, &mut |key, cells| {
        let mut chunks = Vec::new();
        choose(key, cells, chunk_points, &mut |key, cells| chunks.push(Chunk::of(key, cells)));
        subtrees.push(Subtree { key, chunks });
    });
    Ok(subtrees)
}

impl Chunk {
    /// Takes all records of some cells.
    fn of(key: NodeKey, cells: &mut [Cell]) -> Self {
        let points = cells.iter().map(|c| c.points).sum();
        let mut segments = Segments::default();
        cells.iter_mut().for_each(|c| segments.append(std::mem::take(&mut c.segments)));
        segments.sort();
        Self { key, points, segments }
    }
}

/// The parts of a cell some levels below it, in Morton order.
fn divide_cell(cell: &Cell, frame: &RecordFrame, regrouper: &mut Regrouper<'_>) -> Result<Vec<Cell>, ConvertError> {
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
fn choose(node: NodeKey, cells: &mut [Cell], max_points: u64, found: &mut impl FnMut(NodeKey, &mut [Cell])) {
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
        choose(child, mine, max_points, found);
        rest = others;
    }
    debug_assert!(rest.is_empty());
}
