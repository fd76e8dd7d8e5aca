//! One chunk: load, sort, divide, sample, write into a buffer.

use std::ops::Range;

use pointmill_format::NodeKey;

use super::divide::Chunk;
use super::list::List;
use super::order::{OrderScratch, Point, order};
use super::raise::{Nodes, Pairs, Pending, Points};
use super::sample::Sampler;
use super::sink::{FinishedNode, NodeEncoder, finish_node};
use crate::cloud::{Checksum, Cloud, Ledger, morton};
use crate::error::ConvertError;
use crate::plan::Duplicates;
use crate::runtime::os_hints;

/// What all chunks share.
pub(super) struct ChunkPlan<'a> {
    pub(super) cloud: &'a Cloud<'a>,
    pub(super) leaf_capacity: u32,
    /// Buffers are made for chunks of this size at once; what is not touched costs nothing.
    pub(super) usual_points: u64,
}

/// A chunk, built: final nodes as bytes, and what the nodes above may still change.
pub(super) struct BuiltChunk {
    pub(super) payloads: Vec<u8>,
    /// Byte offsets are relative to `payloads`.
    pub(super) nodes: Vec<FinishedNode>,
    /// Records as stored.
    pub(super) root: Pending<List>,
    pub(super) ledger: Ledger,
    pub(super) overfull_leaves: u64,
}

/// One thread's memory for building chunks.
pub(super) struct ChunkBuilder<'a, E> {
    plan: &'a ChunkPlan<'a>,
    sampler: Sampler,
    encoder: E,
    records: Vec<u8>,
    points: Vec<Point>,
    scratch: OrderScratch,
}

impl<'a, E: NodeEncoder> ChunkBuilder<'a, E> {
    pub(super) fn new(plan: &'a ChunkPlan<'a>, sampler: Sampler, encoder: E) -> Self {
        let (records, points, scratch) = (Vec::new(), Vec::new(), OrderScratch::default());
        Self { plan, sampler, encoder, records, points, scratch }
    }

    /// Gives back the memory of the chunks so far.
    pub(super) fn release(&mut self) {
        (self.records, self.points, self.scratch) = (Vec::new(), Vec::new(), OrderScratch::default());
    }

    /// Builds a chunk; `payloads` is a buffer to use again.
    pub(super) fn build(&mut self, chunk: &Chunk, payloads: Vec<u8>) -> Result<BuiltChunk, ConvertError> {
        let frame = &self.plan.cloud.frame;
        let mut ledger = Ledger::default();
        self.load(chunk, &mut ledger)?;
        order(&self.records, frame, chunk.key.level, &mut self.scratch, &mut self.points);
        if self.plan.cloud.plan.duplicates == Duplicates::Drop {
            self.drop_duplicates(&mut ledger);
        }
        let mut nodes = ChunkNodes {
            points: &self.points,
            records: &self.records,
            stride: frame.stride,
            sampler: &mut self.sampler,
            encoder: &mut self.encoder,
            payloads,
            nodes: Vec::new(),
            written: Checksum::default(),
        };
        nodes.payloads.clear();
        let room = self.points.len().max(self.plan.usual_points as usize) * frame.stride;
        os_hints::reserve(&mut nodes.payloads, room);
        let mut subtree = Subtree { capacity: self.plan.leaf_capacity as usize, overfull_leaves: 0 };
        let root = subtree.node(chunk.key, 0..self.points.len(), &mut nodes)?;
        let overfull_leaves = subtree.overfull_leaves;
        ledger.written = nodes.written;
        let (payloads, nodes) = (nodes.payloads, nodes.nodes);
        let root = self.detach(root);
        Ok(BuiltChunk { payloads, nodes, root, ledger, overfull_leaves })
    }

    fn load(&mut self, chunk: &Chunk, ledger: &mut Ledger) -> Result<(), ConvertError> {
        let Cloud { store, facts, frame, .. } = self.plan.cloud;
        self.records.clear();
        os_hints::reserve(&mut self.records, chunk.points.max(self.plan.usual_points) as usize * frame.stride);
        for segment in &chunk.segments {
            ledger.load(store, *segment, frame.stride, &facts.widening, &mut self.records)?;
        }
        Ok(())
    }

    /// Of records that are equal in every byte one stays. Their mark ([`crate::cloud::Intake::mark`]) differs where the
    /// sources have different positions.
    fn drop_duplicates(&mut self, ledger: &mut Ledger) {
        let (records, stride) = (&self.records, self.plan.cloud.frame.stride);
        let class = self.plan.cloud.facts.class;
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
    fn detach(&self, node: Pending<Vec<u32>>) -> Pending<List> {
        let stride = self.plan.cloud.frame.stride;
        let mut records = Vec::with_capacity(node.points.len() * stride);
        for point in node.points {
            let record = self.points[point as usize].record as usize;
            records.extend_from_slice(&self.records[record * stride..][..stride]);
        }
        let children = node.children.into_iter().map(|child| self.detach(child)).collect();
        Pending { key: node.key, points: List::of_chunk(records, stride), is_inner: node.is_inner, children }
    }
}

/// The nodes of a chunk while they are made.
struct ChunkNodes<'a, E> {
    points: &'a [Point],
    records: &'a [u8],
    stride: usize,
    sampler: &'a mut Sampler,
    encoder: &'a mut E,
    payloads: Vec<u8>,
    nodes: Vec<FinishedNode>,
    written: Checksum,
}

impl Points for Vec<u32> {
    fn count(&self) -> u64 {
        self.len() as u64
    }
}

impl<E: NodeEncoder> Nodes<Vec<u32>> for ChunkNodes<'_, E> {
    fn sample(&mut self, key: NodeKey, children: &mut [Pending<Vec<u32>>]) -> Result<Vec<u32>, ConvertError> {
        self.sampler.begin(key);
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
        Ok(points)
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
        let node = finish_node(self.encoder, key, records, &mut self.written, &mut self.payloads)?;
        self.nodes.push(node);
        Ok(())
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
        nodes: &mut ChunkNodes<'_, impl NodeEncoder>,
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
