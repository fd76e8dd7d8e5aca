//! Cuts the cloud into subtrees of a size that does not depend on memory, and these into chunks that are small enough to be
//! built in memory. Which nodes are the roots of subtrees is part of the result ([`super::units`]); which are chunks is
//! not.

use pointmill_format::NodeKey;
use serde::{Deserialize, Serialize};

use crate::cloud::{Cell, Cloud, Regrouper, Segments, add_up, are_in_order, divided, highest_nodes};
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
    let mut regrouper = Regrouper::new(&cloud.store, cloud.frame.stride);
    let mut cells = divided(&cloud.cells, &cloud.frame, &mut regrouper, max_points, rt, room)?;
    cloud.store.drop_spare(u64::MAX)?;
    let mut subtrees = Vec::new();
    highest_nodes(NodeKey::ROOT, &mut cells, unit_points, &mut |key, cells| {
        let mut chunks = Vec::new();
        highest_nodes(key, cells, chunk_points, &mut |key, cells| chunks.push(Chunk::of(key, cells)));
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
