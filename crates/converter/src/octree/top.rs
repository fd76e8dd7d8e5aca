//! Nodes above the chunks: their records wait in lists, which may be on the disk, and pass by in pieces.

use std::sync::Arc;

use pointmill_format::NodeKey;

use super::list::{List, Lists, Writer};
use super::raise::{Nodes, Pairs, Pending, Points};
use super::sample::Sampler;
use super::sink::{FinishedNode, NodeEncoder, NodeSink, finish_node, points_of};
use crate::cloud::{Checksum, Cloud, RecordFrame, TreePoint};
use crate::error::ConvertError;
use crate::runtime::{Consumer, Pool, Reservation, Runtime};

/// Bytes of candidates that are looked at together.
const PART_BYTES: usize = 2 << 20;

/// Records of a node that are encoded in memory; those of larger ones pass by.
const LARGE_BYTES: u64 = 4 << 20;

/// Bytes of finished nodes that are written together.
const WRITE_BYTES: usize = 8 << 20;

/// The nodes above the chunks while they are made, and the place of all nodes among the bytes of the tree.
pub(super) struct TopNodes<'a, S: NodeSink> {
    frame: &'a RecordFrame,
    memory: &'a Arc<Pool>,
    sink: &'a S,
    lists: Lists,
    sampler: Sampler,
    sampled: Reservation,
    encoder: S::Encoder,
    /// Memory that is used again: records of a node, and candidates.
    records: Vec<u8>,
    part: Part,
    /// Finished nodes that have no place yet, and their bytes.
    open: Vec<FinishedNode>,
    payloads: Vec<u8>,
    /// Finished nodes that have a place.
    pub(super) nodes: Vec<FinishedNode>,
    known: Reservation,
    /// Bytes of all of them.
    pub(super) bytes: u64,
    pub(super) written: Checksum,
}

/// Finished nodes whose bytes have a place, and those bytes.
pub(super) struct Placed {
    pub(super) nodes: Vec<FinishedNode>,
    pub(super) bytes: Vec<u8>,
    pub(super) offset: u64,
}

impl<'a, S: NodeSink> TopNodes<'a, S> {
    pub(super) fn new(cloud: &'a Cloud<'_>, rt: &'a Runtime<'_>, sampler: Sampler, sink: &'a S) -> Self {
        Self {
            frame: &cloud.frame,
            memory: &rt.memory,
            sink,
            lists: Lists::new(cloud.frame.stride, &rt.memory, &rt.temp),
            sampler,
            sampled: Reservation::new(&rt.memory, Consumer::Work),
            encoder: sink.encoder(),
            records: Vec::new(),
            part: Part::default(),
            open: Vec::new(),
            payloads: Vec::new(),
            nodes: Vec::new(),
            known: Reservation::new(&rt.memory, Consumer::Nodes),
            bytes: 0,
            written: Checksum::default(),
        }
    }

    /// Gives finished nodes the next place among the bytes.
    pub(super) fn place(&mut self, mut nodes: Vec<FinishedNode>, bytes: Vec<u8>) -> Result<Placed, ConvertError> {
        let offset = self.bytes;
        nodes.iter_mut().for_each(|n| n.byte_offset += offset);
        self.nodes.extend_from_slice(&nodes);
        self.known.resize((self.nodes.capacity() * size_of::<FinishedNode>()) as u64)?;
        self.bytes += bytes.len() as u64;
        Ok(Placed { nodes, bytes, offset })
    }

    /// The nodes above the chunks that were finished since the last call; `None` if there are none.
    pub(super) fn take_finished(&mut self) -> Result<Option<Placed>, ConvertError> {
        if self.open.is_empty() {
            return Ok(None);
        }
        let (nodes, bytes) = (std::mem::take(&mut self.open), std::mem::take(&mut self.payloads));
        self.place(nodes, bytes).map(Some)
    }

    /// Writes what was finished.
    fn flush(&mut self) -> Result<(), ConvertError> {
        match self.take_finished()? {
            Some(Placed { nodes, bytes, offset }) => self.sink.write(&nodes, &bytes, offset),
            None => Ok(()),
        }
    }

    /// Accounts for the lists of a chunk.
    pub(super) fn admit(&mut self, node: &mut Pending<List>) -> Result<(), ConvertError> {
        self.lists.admit(&mut node.points)?;
        node.children.iter_mut().try_for_each(|child| self.admit(child))
    }

    /// Encodes a node whose records are too many to have them in memory together.
    fn write_large(&mut self, key: NodeKey, points: &List) -> Result<(), ConvertError> {
        self.flush()?;
        let count = points.count();
        let (offset, mut size) = (self.bytes, 0);
        if self.encoder.is_row_by_row() {
            let (encoder, written, sink, stride) = (&mut self.encoder, &mut self.written, self.sink, self.lists.stride);
            let mut bytes = Vec::new();
            self.lists.each(points, |records| {
                bytes.clear();
                encoder.encode(key, records.chunks_exact(stride), written, &mut bytes)?;
                sink.write(&[], &bytes, offset + size)?;
                size += bytes.len() as u64;
                Ok(true)
            })?;
        } else {
            let per_point = self.lists.stride as u64 + self.encoder.bytes_per_point();
            let mut room = Reservation::new(self.memory, Consumer::Work);
            room.resize(count * per_point)?;
            let bytes = self.encode(key, points)?.1;
            self.sink.write(&[], &bytes, offset)?;
            size = bytes.len() as u64;
        }
        let node = FinishedNode { key, points: points_of(count)?, byte_offset: offset, byte_size: size };
        self.sink.write(&[node], &[], offset)?;
        self.nodes.push(node);
        self.bytes += size;
        Ok(())
    }

    /// The bytes of a node, its records in memory.
    fn encode(&mut self, key: NodeKey, points: &List) -> Result<(FinishedNode, Vec<u8>), ConvertError> {
        let stride = self.lists.stride;
        let mut records = std::mem::take(&mut self.records);
        records.clear();
        records.reserve_exact(points.count() as usize * stride);
        self.lists.each(points, |piece| {
            records.extend_from_slice(piece);
            Ok(true)
        })?;
        let mut bytes = std::mem::take(&mut self.payloads);
        let node = finish_node(&mut self.encoder, key, records.chunks_exact(stride), &mut self.written, &mut bytes)?;
        if records.len() as u64 <= LARGE_BYTES {
            self.records = records;
        }
        Ok((node, bytes))
    }
}

/// Candidates in Morton order, and their records.
#[derive(Default)]
struct Part {
    records: Vec<u8>,
    trees: Vec<TreePoint>,
}

impl<S: NodeSink> TopNodes<'_, S> {
    /// Samples one child; returns what it keeps.
    fn sample_child(&mut self, level: u8, mut list: List, taken: &mut Writer) -> Result<List, ConvertError> {
        if list.is_one_place {
            // of points that share a place a sample takes the first, if any
            let first = self.lists.first(&list)?;
            self.sampler.offer(std::iter::once(self.frame.tree(&first)));
            if self.sampler.choose().first() == Some(&true) {
                taken.push(&first, &mut self.lists)?;
                self.lists.drop_first(&mut list);
            }
            return Ok(list);
        }
        let mut rest = Writer::new(list.count());
        let mut part = std::mem::take(&mut self.part);
        let (mut at, mut buffer) = (0, Vec::new());
        while let Some(piece) = self.lists.piece(&list, at, &mut buffer)? {
            at += (piece.len() / self.lists.stride) as u64;
            part.records.extend_from_slice(piece);
            part.trees.extend(piece.chunks_exact(self.lists.stride).map(|record| self.frame.tree(record)));
            if part.records.len() >= PART_BYTES {
                let cut = part.trees.windows(2).rposition(|w| Sampler::may_be_cut(level, w[0], w[1]));
                self.choose(&mut part, cut.map_or(0, |i| i + 1), taken, &mut rest)?;
            }
        }
        let all = part.trees.len();
        self.choose(&mut part, all, taken, &mut rest)?;
        self.part = part;
        rest.finish(&mut self.lists)
    }

    /// Decides about the first `count` candidates of a part.
    fn choose(
        &mut self,
        part: &mut Part,
        count: usize,
        taken: &mut Writer,
        rest: &mut Writer,
    ) -> Result<(), ConvertError> {
        self.sampler.offer(part.trees[..count].iter().copied());
        let stride = self.lists.stride;
        for (record, is_taken) in part.records.chunks_exact(stride).zip(self.sampler.choose()) {
            let writer = if *is_taken { &mut *taken } else { &mut *rest };
            writer.push(record, &mut self.lists)?;
        }
        self.sampled.grow_to(self.sampler.bytes())?; // memory that was touched stays
        part.records.drain(..count * stride);
        part.trees.drain(..count);
        Ok(())
    }
}

impl<S: NodeSink> Nodes<List> for TopNodes<'_, S> {
    fn sample(&mut self, key: NodeKey, children: &mut [Pending<List>]) -> Result<List, ConvertError> {
        self.sampler.begin(key);
        let candidates = children.iter().map(|c| c.points.count()).sum();
        self.sampler.expect(candidates);
        let mut taken = Writer::new(candidates);
        for child in children {
            let list = std::mem::replace(&mut child.points, List::empty());
            child.points = self.sample_child(key.level, list, &mut taken)?;
        }
        taken.finish(&mut self.lists)
    }

    fn take_middle(&mut self, from: &mut List) -> Result<List, ConvertError> {
        self.lists.take_one(from, from.count() / 2)
    }

    fn excludes(&mut self, level: u8, points: &List, enough: usize) -> Result<bool, ConvertError> {
        let mut pairs = Pairs::new(level);
        self.lists.each(points, |records| {
            for record in records.chunks_exact(self.lists.stride) {
                pairs.add(&self.sampler, self.frame.tree(record));
                if pairs.count >= enough {
                    return Ok(false);
                }
            }
            Ok(true)
        })?;
        Ok(pairs.count >= enough)
    }

    fn write(&mut self, key: NodeKey, points: List) -> Result<(), ConvertError> {
        if points.count() * self.lists.stride as u64 > LARGE_BYTES {
            return self.write_large(key, &points);
        }
        let (node, bytes) = self.encode(key, &points)?;
        self.open.push(node);
        self.payloads = bytes;
        if self.payloads.len() > WRITE_BYTES { self.flush() } else { Ok(()) }
    }
}
