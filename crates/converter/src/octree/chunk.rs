//! One chunk: load, sort, divide, sample, write into the buffer of the unit.

use std::ops::Range;

use pointmill_format::NodeKey;

use super::borders::UnitBorders;
use super::divide::Chunk;
use super::finished::Finished;
use super::list::List;
use super::raise::{Nodes, Pairs, Pending, Points, stays};
use super::sample::Sampler;
use super::sinks::Encoders;
use crate::cloud::{Cloud, Ledger, OrderScratch, Point, RecordFrame, TREE_BITS, morton, order, xyz};
use crate::error::ConvertError;
use crate::plan::Duplicates;
use crate::runtime::os_hints;

/// What all chunks share.
pub(super) struct ChunkPlan<'a> {
    pub(super) cloud: &'a Cloud<'a>,
    pub(super) leaf_capacity: u32,
    /// The most points of an inner node.
    pub(super) most_points: u32,
    /// Points of a unit, at most; buffers are made for as many at once: what is not touched costs nothing.
    pub(super) unit_points: u64,
    /// The same of a chunk.
    pub(super) usual_points: u64,
    /// Others have read the records and said which nodes they lie in.
    pub(super) is_of_others: bool,
}

/// One thread's memory for building chunks.
#[derive(Default)]
pub(super) struct ChunkMemory {
    records: Vec<u8>,
    points: Vec<Point>,
    scratch: OrderScratch,
}

impl ChunkMemory {
    /// Takes the points of a chunk, in order.
    pub(super) fn load(
        &mut self,
        plan: &ChunkPlan<'_>,
        chunk: &Chunk,
        ledger: &mut Ledger,
    ) -> Result<(), ConvertError> {
        let Cloud { store, facts, frame, .. } = plan.cloud;
        self.records.clear();
        os_hints::reserve(&mut self.records, chunk.points.max(plan.usual_points) as usize * frame.stride);
        for segment in &chunk.segments {
            ledger.load(store, *segment, frame.stride, &facts.widening, &mut self.records)?;
        }
        order(&self.records, frame, chunk.key.level, &mut self.scratch, &mut self.points);
        if plan.is_of_others && !self.is_within(chunk.key) {
            return Err(ConvertError::Internal(format!("points outside of their node {}", chunk.key)));
        }
        if plan.cloud.plan.duplicates == Duplicates::Drop {
            self.drop_duplicates(plan, ledger);
        }
        Ok(())
    }

    /// A buffer for the records of a chunk.
    pub(super) fn buffer(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.records)
    }

    /// Takes it back.
    pub(super) fn give_back(&mut self, buffer: Vec<u8>) {
        self.records = buffer;
    }

    /// Records below a node of `level` in the order of [`order`].
    pub(super) fn in_order(&mut self, records: &[u8], frame: &RecordFrame, level: u8) -> Vec<u8> {
        order(records, frame, level, &mut self.scratch, &mut self.points);
        let mut sorted = Vec::with_capacity(records.len());
        for point in &self.points {
            sorted.extend_from_slice(&records[point.record as usize * frame.stride..][..frame.stride]);
        }
        sorted
    }

    /// True if all points lie in a node.
    fn is_within(&self, node: NodeKey) -> bool {
        let (shift, cell) = (TREE_BITS - u32::from(node.level), xyz(node));
        self.points.iter().all(|p| p.t.cell(shift) == cell)
    }

    /// Builds the nodes of the chunk that was loaded; returns its root, and the number of leaves above the capacity.
    pub(super) fn build(
        &mut self,
        plan: &ChunkPlan<'_>,
        key: NodeKey,
        sampler: &mut Sampler,
        encoder: &mut impl Encoders,
        borders: &mut UnitBorders<'_>,
        finished: &mut Finished,
    ) -> Result<(Pending<List>, u64), ConvertError> {
        let stride = plan.cloud.frame.stride;
        let (points, records) = (&self.points[..], &self.records[..]);
        let most_points = u64::from(plan.most_points);
        let mut nodes = ChunkNodes { points, records, stride, most_points, sampler, encoder, borders, finished };
        let mut subtree = Subtree { capacity: plan.leaf_capacity as usize, overfull_leaves: 0 };
        let root = subtree.node(key, 0..self.points.len(), &mut nodes)?;
        Ok((self.detach(root, stride), subtree.overfull_leaves))
    }

    /// Of records that are equal in every byte one stays. Their mark ([`crate::cloud::Intake::mark`]) differs where the
    /// sources have different positions.
    fn drop_duplicates(&mut self, plan: &ChunkPlan<'_>, ledger: &mut Ledger) {
        let (records, stride) = (&self.records, plan.cloud.frame.stride);
        let class = plan.cloud.facts.class;
        let bytes = |p: &Point| &records[p.record as usize * stride..][..stride];
        self.points.dedup_by(|next, previous| {
            let same = next.t == previous.t && bytes(next) == bytes(previous);
            if same {
                let record = bytes(next);
                ledger.drop_duplicate(record, class.map(|at| record[at]));
            }
            same
        });
    }

    /// Copies what the pending nodes refer to, so that the chunk's memory can be used again.
    fn detach(&self, node: Pending<Vec<u32>>, stride: usize) -> Pending<List> {
        let mut records = Vec::with_capacity(node.points.len() * stride);
        for point in node.points {
            let record = self.points[point as usize].record as usize;
            records.extend_from_slice(&self.records[record * stride..][..stride]);
        }
        let children = node.children.into_iter().map(|child| self.detach(child, stride)).collect();
        Pending { key: node.key, points: List::of_chunk(records, stride), is_inner: node.is_inner, children }
    }
}

/// The nodes of a chunk while they are made.
struct ChunkNodes<'a, 'b, E> {
    points: &'a [Point],
    records: &'a [u8],
    stride: usize,
    most_points: u64,
    sampler: &'a mut Sampler,
    encoder: &'a mut E,
    borders: &'a mut UnitBorders<'b>,
    finished: &'a mut Finished,
}

impl Points for Vec<u32> {
    fn count(&self) -> u64 {
        self.len() as u64
    }
}

impl<E: Encoders> Nodes<Vec<u32>> for ChunkNodes<'_, '_, E> {
    fn sample(&mut self, key: NodeKey, children: &mut [Pending<Vec<u32>>]) -> Result<Vec<u32>, ConvertError> {
        self.sampler.begin(key, self.borders.around(key)?);
        for child in &*children {
            self.sampler.offer(child.points.iter().map(|p| self.points[*p as usize].t));
        }
        let accepted = self.sampler.choose();
        let mut points = Vec::with_capacity(accepted.iter().map(|b| usize::from(*b)).sum());
        let mut rest = accepted;
        for child in children {
            let (mine, others) = rest.split_at(child.points.len());
            rest = others;
            let mut flags = mine.iter();
            child.points.retain(|p| {
                let taken = flags.next().is_some_and(|f| *f);
                if taken {
                    points.push(*p);
                }
                !taken
            });
        }
        self.borders.note(key, self.sampler.border());
        Ok(points)
    }

    fn most_points(&self) -> u64 {
        self.most_points
    }

    fn give_back(
        &mut self,
        key: NodeKey,
        points: Vec<u32>,
        children: &mut [Pending<Vec<u32>>],
    ) -> Result<Vec<u32>, ConvertError> {
        let (all, mut kept) = (points.count(), Vec::with_capacity(self.most_points as usize));
        for (i, point) in points.into_iter().enumerate() {
            let child = morton::child_index(self.points[point as usize].t, key.level);
            match children.iter_mut().find(|c| c.key.child_index() == child) {
                Some(child) if !stays(i as u64, all, self.most_points) => child.points.push(point),
                _ => kept.push(point),
            }
        }
        // points are numbered in Morton order
        children.iter_mut().for_each(|child| child.points.sort_unstable());
        Ok(kept)
    }

    fn join(&mut self, lists: Vec<Vec<u32>>) -> Result<Vec<u32>, ConvertError> {
        Ok(lists.concat())
    }

    fn take_middle(&mut self, from: &mut Vec<u32>) -> Result<Vec<u32>, ConvertError> {
        Ok(vec![from.remove(from.len() / 2)])
    }

    fn excludes(&mut self, level: u8, points: &Vec<u32>, enough: usize) -> Result<bool, ConvertError> {
        let mut pairs = Pairs::new(level);
        Ok(points.iter().any(|p| {
            pairs.add(self.sampler, self.points[*p as usize].t);
            pairs.count >= enough
        }))
    }

    fn write(&mut self, key: NodeKey, points: Vec<u32>) -> Result<(), ConvertError> {
        let records = points.iter().map(|p| {
            let at = self.points[*p as usize].record as usize * self.stride;
            &self.records[at..at + self.stride]
        });
        self.finished.encode(self.encoder, key, records)
    }
}

/// The division of a chunk into nodes.
struct Subtree {
    capacity: usize,
    overfull_leaves: u64,
}

impl Subtree {
    fn node(
        &mut self,
        key: NodeKey,
        range: Range<usize>,
        nodes: &mut ChunkNodes<'_, '_, impl Encoders>,
    ) -> Result<Pending<Vec<u32>>, ConvertError> {
        let points = &nodes.points[range.clone()];
        let is_one_place = points.first().map(|p| p.t) == points.last().map(|p| p.t);
        if points.len() <= self.capacity || is_one_place {
            self.overfull_leaves += u64::from(points.len() > self.capacity);
            return Ok(Pending::leaf(key, (range.start as u32..range.end as u32).collect()));
        }
        let mut children = Vec::with_capacity(8);
        let mut start = range.start;
        for (index, child) in (0..8).filter_map(|c| Some((c, key.child(c)?))) {
            let rest = &nodes.points[start..range.end];
            let count = rest.partition_point(|p| morton::child_index(p.t, key.level) <= index);
            if count > 0 {
                children.push(self.node(child, start..start + count, nodes)?);
                start += count;
            }
        }
        Pending::above(key, children, nodes)
    }
}
