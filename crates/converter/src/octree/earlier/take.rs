//! One unit, taken from an earlier tree.

use std::collections::HashMap;

use pointmill_format::NodeKey;

use super::Earlier;
use super::division::{EarlierUnit, is_one_place};
use super::nodes::Scratch;
use crate::cloud::{Checksum, Ledger, TreePoint};
use crate::error::ConvertError;
use crate::octree::divide::Chunk;
use crate::octree::finished::{Piece, Run};
use crate::octree::list::List;
use crate::octree::raise::{ENOUGH_FOR_ALL_ANCESTORS, Pairs, Pending, Points};
use crate::octree::sink::{EarlierTree, FinishedNode};
use crate::octree::sinks::Encoders;
use crate::octree::unit::{BuiltUnit, Outer, UnitBuilder};

/// What became of a unit.
pub(in crate::octree) enum Taken {
    Over(BuiltUnit),
    /// It is to be built; its buffers.
    Not(Vec<Vec<u8>>),
    /// It is not needed any more.
    Stopped,
}

/// A unit of the earlier tree, decoded.
struct Decoded {
    /// Those below its root, in the order of their bytes.
    nodes: Vec<FinishedNode>,
    /// What its root had before nodes above took points from it, in order.
    root: Vec<u8>,
    outer: Outer,
    written: Checksum,
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
        let taken = self.take_over(earlier, index, known, buffers, wait)?;
        if let Taken::Over(_) = &taken {
            let store = &self.shared.plan.cloud.store;
            chunk.segments.iter().try_for_each(|segment| store.pass_over(*segment))?;
        }
        Ok(taken)
    }

    /// The same of a node above subtrees; all before it are done.
    pub(in crate::octree) fn take_above(
        &mut self,
        earlier: &Earlier<'_>,
        index: usize,
        buffers: Vec<Vec<u8>>,
    ) -> Result<Taken, ConvertError> {
        let Some(known) = earlier.like(index) else { return Ok(Taken::Not(buffers)) };
        self.take_over(earlier, index, known, buffers, || true)
    }

    fn take_over(
        &mut self,
        earlier: &Earlier<'_>,
        index: usize,
        known: usize,
        mut buffers: Vec<Vec<u8>>,
        wait: impl FnOnce() -> bool,
    ) -> Result<Taken, ConvertError> {
        let (shared, unit) = (self.shared, &earlier.units[known]);
        let (1, Some(mut bytes)) = (buffers.len(), buffers.pop()) else { return Ok(Taken::Not(buffers)) };
        let mut records = self.chunk.buffer();
        let decoded = self.decode(earlier, unit, &mut bytes, &mut records)?;
        if decoded.is_some() && !wait() {
            return Ok(Taken::Stopped);
        }
        let decoded = match decoded {
            Some(decoded) if earlier.sees_the_same(index, known)? => decoded,
            _ => {
                self.chunk.give_back(records);
                bytes.clear();
                return Ok(Taken::Not(vec![bytes]));
            }
        };
        self.encoder.notice(&mut records);
        self.chunk.give_back(records);
        let Decoded { nodes, root, outer, written } = decoded;
        let is_inner = !nodes.is_empty();
        let run = Run { nodes, bytes, in_place: None };
        let mut root = Pending { is_inner, ..Pending::leaf(unit.key, List::of_chunk(root, shared.lists.stride)) };
        shared.lists.admit(&mut root.points)?;
        Ok(Taken::Over(BuiltUnit {
            pieces: if is_inner { vec![Piece::Nodes(vec![run])] } else { Vec::new() },
            root: Some(root),
            ledger: Ledger::default(),
            written: vec![written],
            overfull_leaves: 0,
            notes: Vec::new(),
            outer,
            file: None,
            is_taken_over: true,
        }))
    }

    /// Decodes a unit. Then `bytes` has those of its nodes, without that of its root, and `records` their points. `None`: its
    /// nodes do not say what it was.
    fn decode(
        &mut self,
        earlier: &Earlier<'_>,
        unit: &EarlierUnit,
        bytes: &mut Vec<u8>,
        records: &mut Vec<u8>,
    ) -> Result<Option<Decoded>, ConvertError> {
        let (shared, all) = (self.shared, &earlier.nodes);
        let (frame, stride) = (&shared.plan.cloud.frame, shared.lists.stride);
        let mut nodes = if unit.is_above { all.children(unit.key) } else { all.below(unit.key) };
        let points = nodes.iter().map(|node| u64::from(node.points)).sum::<u64>();
        let in_root = all.own_points(unit.key) + unit.taken.count();
        if points.max(in_root) > shared.chunk_points || !follow_each_other(&nodes) {
            return Ok(None);
        }
        let tree = |record: &[u8]| frame.tree(record);
        let mut scratch = Scratch::default();
        records.clear();
        all.records(unit.key, &mut scratch, records)?;
        let own_of_root: Vec<TreePoint> = records.chunks_exact(stride).map(tree).collect();
        shared.lists.each(&unit.taken, |piece| {
            records.extend_from_slice(piece);
            Ok(true)
        })?;
        let root = self.chunk.in_order(records, frame, unit.key.level);
        if !self.is_known(unit, own_of_root.len(), !nodes.is_empty(), &root) {
            return Ok(None);
        }
        records.clear();
        read(all.tree, &mut nodes, bytes)?;
        let mut ranges = HashMap::with_capacity(nodes.len());
        for node in &nodes {
            let (start, at) = (records.len(), node.byte_offset as usize);
            let Some(earlier) = all.get(node.key) else { return Ok(None) };
            all.tree.records(earlier, &bytes[at..at + node.byte_size as usize], &mut scratch.points, records)?;
            ranges.insert(node.key, start..records.len());
            // nodes above have one of its points each, at most
            let may_be_overfull = u64::from(node.points) + u64::from(node.key.level) > shared.plan.leaf_capacity.into();
            if !unit.is_above
                && may_be_overfull
                && !all.has_children(node.key)
                && is_one_place(records[start..].chunks_exact(stride).map(tree))
            {
                return Ok(None);
            }
        }
        let mut written = Checksum::default();
        written.add_all(records, stride);
        let own = |key: NodeKey, out: &mut Vec<TreePoint>| {
            if key == unit.key {
                out.extend_from_slice(&own_of_root);
            } else if let Some(range) = ranges.get(&key) {
                out.extend(records[range.clone()].chunks_exact(stride).map(tree));
            }
            Ok(())
        };
        let samples = earlier.samples_with(unit, own)?;
        if samples.are_doubtful() {
            return Ok(None);
        }
        let outer = samples.nodes.into_iter().map(|sample| (sample.key, sample.points)).collect();
        Ok(Some(Decoded { nodes, root, outer, written }))
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
