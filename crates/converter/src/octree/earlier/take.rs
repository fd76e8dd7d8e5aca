//! One unit, taken from an earlier tree.

use pointmill_format::NodeKey;

use super::division::{EarlierUnit, is_one_place};
use super::known::Earlier;
use super::nodes::Scratch;
use super::samples::Samples;
use crate::cloud::{Checksum, Cloud, Ledger, TreePoint};
use crate::error::ConvertError;
use crate::octree::divide::Chunk;
use crate::octree::finished::{Piece, Run};
use crate::octree::list::{List, Lists};
use crate::octree::raise::{ENOUGH_FOR_ALL_ANCESTORS, Pairs, Pending, Points};
use crate::octree::sink::{EarlierTree, FinishedNode};
use crate::octree::sinks::Encoders;
use crate::octree::unit::{BuiltUnit, Outer, UnitBuilder};

/// What became of a unit.
pub(in crate::octree) enum Taken {
    Over(Box<BuiltUnit>),
    /// It is to be built; its buffers.
    Not(Vec<Vec<u8>>),
    /// It is not needed any more.
    Stopped,
}

/// A unit of the earlier tree.
struct Found {
    /// Those below its root that were written with it, in the order of their bytes.
    nodes: Vec<FinishedNode>,
    /// What its root had before nodes above took points from it, in order.
    root: Vec<u8>,
    outer: Outer,
}

impl<E: Encoders> UnitBuilder<'_, E> {
    /// Takes a subtree over, if it is one of the earlier tree, into `buffers`. `wait`: as of [`Self::subtree`].
    pub(in crate::octree) fn take_subtree(
        &mut self,
        earlier: &Earlier<'_>,
        index: usize,
        chunks: &[Chunk],
        buffers: Vec<Vec<u8>>,
        wait: impl FnOnce() -> bool,
    ) -> Result<Taken, ConvertError> {
        let ([chunk], Some(known)) = (chunks, earlier.like(index)) else { return Ok(Taken::Not(buffers)) };
        let Cloud { store, facts, .. } = self.shared.plan.cloud;
        let fill = |records: &mut Vec<u8>| {
            let mut read = chunk.segments.iter().map(|segment| store.read(*segment, records));
            // as the dataset has them
            read.try_fold(true, |are_wide, group| Ok(are_wide && facts.widening.of(group?).is_none()))
        };
        let taken = self.take_over(earlier, index, known, buffers, fill, wait)?;
        if let Taken::Over(_) = &taken {
            chunk.segments.iter().try_for_each(|segment| store.pass_over(*segment))?;
        }
        Ok(taken)
    }

    /// The same of a node above subtrees, whose children have `roots`; all before it are done.
    pub(in crate::octree) fn take_above(
        &mut self,
        earlier: &Earlier<'_>,
        index: usize,
        roots: &[Pending<List>],
        buffers: Vec<Vec<u8>>,
    ) -> Result<Taken, ConvertError> {
        let Some(known) = earlier.like(index) else { return Ok(Taken::Not(buffers)) };
        let lists = &self.shared.lists;
        let fill = |records: &mut Vec<u8>| {
            roots.iter().try_for_each(|root| append(lists, &root.points, records))?;
            Ok(roots.iter().all(|root| root.children.is_empty()))
        };
        self.take_over(earlier, index, known, buffers, fill, || true)
    }

    /// `fill`: appends all records that the unit is made of; false: they are not those of the earlier one.
    fn take_over(
        &mut self,
        earlier: &Earlier<'_>,
        index: usize,
        known: usize,
        mut buffers: Vec<Vec<u8>>,
        fill: impl FnOnce(&mut Vec<u8>) -> Result<bool, ConvertError>,
        wait: impl FnOnce() -> bool,
    ) -> Result<Taken, ConvertError> {
        let (shared, unit) = (self.shared, &earlier.units[known]);
        let Some(Found { mut nodes, mut root, outer }) = self.find(earlier, unit)? else {
            return Ok(Taken::Not(buffers));
        };
        if !wait() {
            return Ok(Taken::Stopped);
        }
        if buffers.len() != 1 || !earlier.sees_the_same(index, known)? {
            return Ok(Taken::Not(buffers));
        }
        let (mut records, stride) = (self.chunk.buffer(), shared.lists.stride);
        records.clear();
        let points: usize = nodes.iter().map(|node| node.points as usize).sum();
        let is_whole = fill(&mut records)? && records.len() == points * stride + root.len();
        if is_whole {
            self.encoder.notice(&mut records, &mut root);
        }
        let written = sum_of_others(&records, &root, stride);
        self.chunk.give_back(records);
        if !is_whole {
            return Ok(Taken::Not(buffers));
        }
        let (is_inner, mut bytes) = (!nodes.is_empty(), buffers.pop().unwrap_or_default());
        read(earlier.nodes.tree, &mut nodes, &mut bytes)?;
        let run = Run { nodes, bytes, in_place: None };
        let mut root = Pending { is_inner, ..Pending::leaf(unit.key, List::of_chunk(root, stride)) };
        shared.lists.admit(&mut root.points)?;
        Ok(Taken::Over(Box::new(BuiltUnit {
            pieces: if is_inner { vec![Piece::Nodes(vec![run])] } else { Vec::new() },
            root: Some(root),
            ledger: Ledger::default(),
            written: vec![written],
            overfull_leaves: 0,
            notes: Vec::new(),
            outer,
            file: None,
            is_taken_over: true,
        })))
    }

    /// Finds a unit again. `None`: its nodes do not say what it was, or it has more points than fit into memory.
    fn find(&mut self, earlier: &Earlier<'_>, unit: &EarlierUnit) -> Result<Option<Found>, ConvertError> {
        let (shared, all, mut scratch) = (self.shared, &earlier.nodes, Scratch::default());
        let (frame, stride) = (&shared.plan.cloud.frame, shared.lists.stride);
        let tree = |record: &[u8]| frame.tree(record);
        let nodes = if unit.is_above { all.children(unit.key) } else { all.below(unit.key) };
        let in_root = all.own_points(unit.key) + unit.taken.count();
        let points = in_root + nodes.iter().map(|node| u64::from(node.points)).sum::<u64>();
        if points > shared.chunk_points || !follow_each_other(&nodes) {
            return Ok(None);
        }
        let mut records = self.chunk.buffer();
        records.clear();
        all.records(unit.key, &mut scratch, &mut records)?;
        let own_of_root: Vec<TreePoint> = records.chunks_exact(stride).map(tree).collect();
        append(&shared.lists, &unit.taken, &mut records)?;
        let root = self.chunk.in_order(&records, frame, unit.key.level);
        let is_known = self.is_known(unit, own_of_root.len(), !nodes.is_empty(), &root);
        let mut own = |key: NodeKey, out: &mut Vec<TreePoint>| {
            if key == unit.key {
                out.extend_from_slice(&own_of_root);
                return Ok(());
            }
            records.clear();
            all.records(key, &mut scratch, &mut records)?;
            out.extend(records.chunks_exact(stride).map(tree));
            Ok(())
        };
        let found = if is_known && (unit.is_above || !has_crowded_leaf(earlier, &nodes, &mut own)?) {
            let samples = earlier.samples_with(unit, own)?;
            let outer =
                |samples: Samples| samples.nodes.into_iter().map(|sample| (sample.key, sample.points)).collect();
            (!samples.are_doubtful()).then(|| Found { nodes, root, outer: outer(samples) })
        } else {
            None
        };
        self.chunk.give_back(records);
        Ok(found)
    }

    /// True if the root was what its points say: a leaf, or an inner node that has served all above it without taking a point
    /// back, so that everything below it was written with the unit.
    fn is_known(&self, unit: &EarlierUnit, own: usize, has_children: bool, root: &[u8]) -> bool {
        let Some(parent) = unit.key.parent() else { return false };
        if !unit.is_above && unit.points <= u64::from(self.shared.plan.leaf_capacity) {
            return !has_children;
        }
        if !has_children || own < 2 {
            return false;
        }
        let mut pairs = Pairs::new(parent.level);
        root.chunks_exact(self.shared.lists.stride).any(|record| {
            pairs.add(&self.sampler, self.shared.plan.cloud.frame.tree(record));
            pairs.count >= ENOUGH_FOR_ALL_ANCESTORS
        })
    }
}

/// True if a leaf may have had more points than the capacity, in one place: nodes above have one of them each, at most. `own`:
/// appends the points of a node.
fn has_crowded_leaf(
    earlier: &Earlier<'_>,
    nodes: &[FinishedNode],
    own: &mut impl FnMut(NodeKey, &mut Vec<TreePoint>) -> Result<(), ConvertError>,
) -> Result<bool, ConvertError> {
    let capacity = u64::from(earlier.shared.plan.leaf_capacity);
    for node in nodes {
        if u64::from(node.points) + u64::from(node.key.level) <= capacity || earlier.nodes.has_children(node.key) {
            continue;
        }
        let mut points = Vec::new();
        own(node.key, &mut points)?;
        if is_one_place(points.into_iter()) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The sum of records of which some, `of_root`, are not written yet.
fn sum_of_others(records: &[u8], of_root: &[u8], stride: usize) -> Checksum {
    let [mut all, mut root] = [Checksum::default(); 2];
    all.add_all(records, stride);
    root.add_all(of_root, stride);
    all.remove(&root);
    all
}

fn append(lists: &Lists, list: &List, records: &mut Vec<u8>) -> Result<(), ConvertError> {
    lists.each(list, |piece| {
        records.extend_from_slice(piece);
        Ok(true)
    })
}

/// True if no other bytes are between those of nodes in order.
fn follow_each_other(nodes: &[FinishedNode]) -> bool {
    nodes.windows(2).all(|pair| pair[0].byte_offset + pair[0].byte_size == pair[1].byte_offset)
}

/// Reads the bytes of nodes that follow each other; their offsets then count from the first of these.
fn read(tree: &dyn EarlierTree, nodes: &mut [FinishedNode], bytes: &mut Vec<u8>) -> Result<(), ConvertError> {
    let start = nodes.first().map_or(0, |node| node.byte_offset);
    let end = nodes.last().map_or(0, |node| node.byte_offset + node.byte_size);
    bytes.clear();
    bytes.resize((end - start) as usize, 0);
    tree.read(start, bytes)?;
    nodes.iter_mut().for_each(|node| node.byte_offset -= start);
    Ok(())
}
