//! One chunk: load, sort, divide, sample, write into a buffer.

use std::ops::Range;

use pointmill_format::NodeKey;
use pointmill_format::potree2::NodeEntry;

use super::sort::{Point, SortScratch, sort};
use super::tree::{Nodes, Pending};
use crate::checksum::Checksum;
use crate::chunks::Chunk;
use crate::error::ConvertError;
use crate::gather::Store;
use crate::gather::load::load;
use crate::morton;
use crate::os_hints;
use crate::plan::Duplicates;
use crate::records::RecordFrame;
use crate::sample::Sampler;
use crate::write::payload::PayloadWriter;

/// Settings of all chunks.
pub(crate) struct ChunkPlan<'a> {
    pub(crate) frame: &'a RecordFrame,
    pub(crate) store: &'a Store,
    pub(crate) leaf_capacity: u32,
    /// Buffers are made for chunks of this size at once; what is not touched costs nothing.
    pub(crate) usual_points: u64,
    pub(crate) duplicates: Duplicates,
    /// For each source: byte offset of an 8-bit colour that is to be stored as 16 bit.
    pub(crate) widen_rgb: &'a [Option<usize>],
    /// Byte offset of the classification in a stored record.
    pub(crate) class: Option<usize>,
}

/// A chunk, built: final nodes as bytes, and what the nodes above may still change.
pub(crate) struct BuiltChunk {
    pub(crate) payloads: Vec<u8>,
    /// Byte offsets are relative to `payloads`.
    pub(crate) nodes: Vec<NodeEntry>,
    /// Points are indices into `pending_points`.
    pub(crate) root: Pending<u32>,
    /// Tree coordinates and records (as stored) of the pending points.
    pub(crate) pending_trees: Vec<[u32; 3]>,
    pub(crate) pending_records: Vec<u8>,
    pub(crate) accounts: Accounts,
}

/// Order-independent sums over chunks.
#[derive(Debug, Clone, Default)]
pub(crate) struct Accounts {
    /// What the records in the store must have added up to, corrected for changes made on purpose.
    pub(crate) written: Checksum,
    /// Records before and after their colours were widened.
    pub(crate) narrow: Checksum,
    pub(crate) wide: Checksum,
    pub(crate) dropped: Checksum,
    pub(crate) duplicates_dropped: u64,
    /// Dropped points by class; no entries if there were none.
    pub(crate) classes_dropped: Vec<u64>,
    pub(crate) overfull_leaves: u64,
}

impl Accounts {
    /// What the written records would add up to without the changes made on purpose: equals the sum of what was read.
    pub(crate) fn unaltered(&self) -> Checksum {
        let mut sum = self.written;
        sum.merge(&self.dropped);
        sum.replace(&self.wide, &self.narrow);
        sum
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.written.merge(&other.written);
        self.narrow.merge(&other.narrow);
        self.wide.merge(&other.wide);
        self.dropped.merge(&other.dropped);
        self.duplicates_dropped += other.duplicates_dropped;
        if self.classes_dropped.len() < other.classes_dropped.len() {
            self.classes_dropped.resize(other.classes_dropped.len(), 0);
        }
        self.classes_dropped.iter_mut().zip(&other.classes_dropped).for_each(|(a, b)| *a += b);
        self.overfull_leaves += other.overfull_leaves;
    }
}

/// One thread's memory for building chunks.
pub(crate) struct ChunkBuilder<'a> {
    plan: &'a ChunkPlan<'a>,
    sampler: Sampler,
    writer: PayloadWriter,
    records: Vec<u8>,
    points: Vec<Point>,
    scratch: SortScratch,
}

impl<'a> ChunkBuilder<'a> {
    pub(crate) fn new(plan: &'a ChunkPlan<'a>, sampler: Sampler, writer: PayloadWriter) -> Self {
        let (records, points, scratch) = (Vec::new(), Vec::new(), SortScratch::default());
        Self { plan, sampler, writer, records, points, scratch }
    }

    pub(crate) fn build(&mut self, chunk: &Chunk, payloads: Vec<u8>) -> Result<BuiltChunk, ConvertError> {
        let mut accounts = Accounts::default();
        self.load(chunk, &mut accounts)?;
        sort(&self.records, self.plan.frame, chunk.key.level, &mut self.scratch, &mut self.points);
        if self.plan.duplicates == Duplicates::Drop {
            self.drop_duplicates(&mut accounts);
        }
        let mut nodes = ChunkNodes {
            points: &self.points,
            records: &self.records,
            stride: self.plan.frame.stride,
            writer: &mut self.writer,
            payloads,
            nodes: Vec::new(),
            written: Checksum::default(),
        };
        nodes.payloads.clear();
        let room = self.points.len().max(self.plan.usual_points as usize) * self.plan.frame.stride;
        os_hints::reserve(&mut nodes.payloads, room);
        let mut subtree =
            Subtree { capacity: self.plan.leaf_capacity as usize, sampler: &mut self.sampler, overfull_leaves: 0 };
        let mut root = subtree.node(chunk.key, 0..self.points.len(), &mut nodes)?;
        accounts.overfull_leaves = subtree.overfull_leaves;
        accounts.written = nodes.written;
        let (payloads, nodes) = (nodes.payloads, nodes.nodes);
        let pending = count(&root);
        let mut pending_trees = Vec::with_capacity(pending);
        let mut pending_records = Vec::with_capacity(pending * self.plan.frame.stride);
        self.detach(&mut root, &mut pending_trees, &mut pending_records);
        Ok(BuiltChunk { payloads, nodes, root, pending_trees, pending_records, accounts })
    }

    fn load(&mut self, chunk: &Chunk, accounts: &mut Accounts) -> Result<(), ConvertError> {
        let stride = self.plan.frame.stride;
        self.records.clear();
        os_hints::reserve(&mut self.records, chunk.points.max(self.plan.usual_points) as usize * stride);
        for segment in &chunk.segments {
            load(self.plan.store, stride, self.plan.widen_rgb, *segment, &mut self.records, accounts)?;
        }
        Ok(())
    }

    /// Of records that are equal in every byte one stays.
    fn drop_duplicates(&mut self, accounts: &mut Accounts) {
        let (records, stride) = (&self.records, self.plan.frame.stride);
        let bytes = |p: &Point| &records[p.record as usize * stride..][..stride];
        self.points.dedup_by(|next, previous| {
            let same = next.t == previous.t && bytes(next) == bytes(previous);
            if same {
                accounts.dropped.add(bytes(next));
                accounts.duplicates_dropped += 1;
                if let Some(class) = self.plan.class {
                    accounts.classes_dropped.resize(256, 0);
                    accounts.classes_dropped[usize::from(bytes(next)[class])] += 1;
                }
            }
            same
        });
    }

    /// Copies what the pending nodes refer to, so that the chunk's memory can be used again.
    fn detach(&self, node: &mut Pending<u32>, trees: &mut Vec<[u32; 3]>, records: &mut Vec<u8>) {
        let stride = self.plan.frame.stride;
        for point in &mut node.points {
            let p = self.points[*point as usize];
            *point = trees.len() as u32;
            trees.push(p.t);
            records.extend_from_slice(&self.records[p.record as usize * stride..][..stride]);
        }
        for child in &mut node.children {
            self.detach(child, trees, records);
        }
    }
}

/// Points of a node and of everything below it that was not written.
fn count(node: &Pending<u32>) -> usize {
    node.points.len() + node.children.iter().map(count).sum::<usize>()
}

/// Final nodes of a chunk.
struct ChunkNodes<'a> {
    points: &'a [Point],
    records: &'a [u8],
    stride: usize,
    writer: &'a mut PayloadWriter,
    payloads: Vec<u8>,
    nodes: Vec<NodeEntry>,
    written: Checksum,
}

impl Nodes<u32> for ChunkNodes<'_> {
    #[inline]
    fn tree(&self, point: u32) -> [u32; 3] {
        self.points[point as usize].t
    }

    fn write(&mut self, key: NodeKey, points: &[u32]) -> Result<(), ConvertError> {
        let records = points.iter().map(|p| {
            let at = self.points[*p as usize].record as usize * self.stride;
            &self.records[at..at + self.stride]
        });
        let entry = self.writer.write(key, records, &mut self.payloads, &mut self.written)?;
        self.nodes.push(entry);
        Ok(())
    }
}

/// The division of a chunk into nodes.
struct Subtree<'a> {
    capacity: usize,
    sampler: &'a mut Sampler,
    overfull_leaves: u64,
}

impl Subtree<'_> {
    fn node(
        &mut self,
        key: NodeKey,
        range: Range<usize>,
        nodes: &mut ChunkNodes<'_>,
    ) -> Result<Pending<u32>, ConvertError> {
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
        Pending::above(key, children, self.sampler, nodes)
    }
}
