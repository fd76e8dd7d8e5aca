//! Nodes whose children are lists: their records may be on the disk, and pass by in pieces.

use std::sync::{Arc, PoisonError};

use pointmill_format::NodeKey;

use super::borders::UnitBorders;
use super::finished::Finished;
use super::list::{List, Lists, Writer};
use super::raise::{Nodes, Pairs, Pending, Points, stays};
use super::sample::Sampler;
use super::sinks::Encoders;
use crate::cloud::{RecordFrame, TreePoint, copy_record, morton};
use crate::error::ConvertError;
use crate::runtime::{Consumer, Pool, Reservation};

/// Bytes of candidates that are looked at together.
const PART_BYTES: usize = 2 << 20;

/// Records of a node that are encoded in memory; those of larger ones pass by.
const LARGE_BYTES: u64 = 4 << 20;

/// Memory that a thread uses again and again.
pub(super) struct ListMemory {
    records: Vec<u8>,
    part: Part,
    /// What the sampler has.
    sampled: Reservation,
}

impl ListMemory {
    pub(super) fn new(sampled: Reservation) -> Self {
        Self { records: Vec::new(), part: Part::default(), sampled }
    }
}

/// What a sampler has of a node is kept for the next up to this size, bytes.
const USUAL_SAMPLE_BYTES: u64 = 1 << 20;

/// Nodes while they are made from lists.
pub(super) struct ListNodes<'n, 'a, E> {
    pub(super) frame: &'n RecordFrame,
    pub(super) most_points: u64,
    pub(super) pool: &'n Arc<Pool>,
    pub(super) lists: &'n Lists,
    pub(super) sampler: &'n mut Sampler,
    pub(super) encoder: &'n mut E,
    pub(super) memory: &'n mut ListMemory,
    pub(super) borders: &'n mut UnitBorders<'a>,
    pub(super) finished: &'n mut Finished,
}

/// Candidates in Morton order, and their records.
#[derive(Default)]
struct Part {
    records: Vec<u8>,
    trees: Vec<TreePoint>,
}

impl<E: Encoders> ListNodes<'_, '_, E> {
    /// Samples one child; returns what it keeps.
    fn sample_child(
        &mut self,
        level: u8,
        mut list: List,
        taken: &mut Writer,
        reserved: u64,
    ) -> Result<List, ConvertError> {
        if list.is_one_place {
            // of points that share a place a sample takes the first, if any
            let first = self.lists.first(&list)?;
            self.sampler.offer(std::iter::once(self.frame.tree(&first)));
            if self.sampler.choose().first() == Some(&true) {
                taken.push(&first, self.lists)?;
                self.lists.drop_first(&mut list);
            }
            return Ok(list);
        }
        if list.in_memory().is_some() {
            list.thin(self.lists.stride, |records| self.sample_in_place(level, records, taken, reserved))?;
            return Ok(list);
        }
        let mut rest = Writer::new(list.count());
        let mut part = std::mem::take(&mut self.memory.part);
        let (mut at, mut buffer) = (0, Vec::new());
        while let Some(piece) = self.lists.piece(&list, at, &mut buffer)? {
            at += (piece.len() / self.lists.stride) as u64;
            part.records.extend_from_slice(piece);
            part.trees.extend(piece.chunks_exact(self.lists.stride).map(|record| self.frame.tree(record)));
            if part.records.len() >= PART_BYTES {
                let cut = part.trees.windows(2).rposition(|w| self.sampler.may_be_cut(level, w[0], w[1]));
                self.choose(&mut part, cut.map_or(0, |i| i + 1), taken, &mut rest)?;
                self.account(reserved)?;
            }
        }
        let all = part.trees.len();
        self.choose(&mut part, all, taken, &mut rest)?;
        self.account(reserved)?;
        self.memory.part = part;
        rest.finish(self.lists)
    }

    /// Samples records in memory: those that stay move to the front. Returns their bytes.
    fn sample_in_place(
        &mut self,
        level: u8,
        records: &mut [u8],
        taken: &mut Writer,
        reserved: u64,
    ) -> Result<usize, ConvertError> {
        let stride = self.lists.stride;
        let mut trees = std::mem::take(&mut self.memory.part.trees);
        let (mut at, mut kept) = (0, 0);
        while at < records.len() {
            trees.clear();
            for part in records[at..].chunks((PART_BYTES / stride).max(1) * stride) {
                trees.extend(part.chunks_exact(stride).map(|record| self.frame.tree(record)));
                if at + trees.len() * stride < records.len() {
                    let cut = trees.windows(2).rposition(|w| self.sampler.may_be_cut(level, w[0], w[1]));
                    let Some(last) = cut else { continue };
                    trees.truncate(last + 1);
                }
                break;
            }
            self.sampler.offer(trees.iter().copied());
            for is_taken in self.sampler.choose() {
                if *is_taken {
                    taken.push(&records[at..at + stride], self.lists)?;
                } else {
                    if kept < at {
                        let (before, from) = records.split_at_mut(at);
                        copy_record(&from[..stride], &mut before[kept..kept + stride]);
                    }
                    kept += stride;
                }
                at += stride;
            }
            self.account(reserved)?;
        }
        self.memory.part.trees = trees;
        self.memory.part.trees.clear();
        Ok(kept)
    }

    /// Accounts for what the sampler has beyond `reserved`.
    fn account(&mut self, reserved: u64) -> Result<(), ConvertError> {
        self.memory.sampled.grow_to(self.sampler.bytes().saturating_sub(reserved.max(USUAL_SAMPLE_BYTES)))
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
            writer.push(record, self.lists)?;
        }
        part.records.drain(..count * stride);
        part.trees.drain(..count);
        Ok(())
    }
}

impl<E: Encoders> Nodes<List> for ListNodes<'_, '_, E> {
    fn sample(&mut self, key: NodeKey, children: &mut [Pending<List>]) -> Result<List, ConvertError> {
        let candidates = children.iter().map(|c| c.points.count()).sum();
        let mut side_by_side = Some(self.lists.large.read().unwrap_or_else(PoisonError::into_inner));
        let expected = self.sampler.expected_bytes(candidates);
        let room = self.pool.try_take(Consumer::Work, expected).then(|| {
            Reservation::of(self.pool, Consumer::Work, expected) // given back when the node has its sample
        });
        // where memory is short, one node of many points at a time
        let is_short = expected > USUAL_SAMPLE_BYTES && room.is_none();
        let alone = is_short.then(|| {
            side_by_side.take();
            self.lists.large.write().unwrap_or_else(PoisonError::into_inner)
        });
        self.sampler.begin(key, self.borders.around(key)?);
        self.sampler.expect(candidates);
        let mut taken = Writer::new(candidates);
        for child in children {
            let list = std::mem::replace(&mut child.points, List::empty());
            let reserved = if alone.is_some() { 0 } else { expected };
            child.points = self.sample_child(key.level, list, &mut taken, reserved)?;
        }
        self.borders.note(key, self.sampler.border());
        if self.sampler.bytes() > USUAL_SAMPLE_BYTES {
            self.sampler.release();
        }
        self.memory.sampled.resize(0)?;
        taken.finish(self.lists)
    }

    fn most_points(&self) -> u64 {
        self.most_points
    }

    fn give_back(&mut self, key: NodeKey, points: List, children: &mut [Pending<List>]) -> Result<List, ConvertError> {
        let (all, most, stride) = (points.count(), self.most_points, self.lists.stride);
        let mut kept = Writer::new(most);
        let mut back: Vec<Writer> = children.iter().map(|_| Writer::new(all)).collect();
        let mut i = 0;
        self.lists.each(&points, |records| {
            for record in records.chunks_exact(stride) {
                let child = morton::child_index(self.frame.tree(record), key.level);
                match children.iter().position(|c| c.key.child_index() == child) {
                    Some(child) if !stays(i, all, most) => back[child].push(record, self.lists)?,
                    _ => kept.push(record, self.lists)?,
                }
                i += 1;
            }
            Ok(true)
        })?;
        for (child, back) in children.iter_mut().zip(back) {
            let (back, rest) = (back.finish(self.lists)?, std::mem::replace(&mut child.points, List::empty()));
            child.points = if back.count() == 0 { rest } else { self.lists.merge(&rest, &back, self.frame)? };
        }
        kept.finish(self.lists)
    }

    fn join(&mut self, lists: Vec<List>) -> Result<List, ConvertError> {
        let mut all = Writer::new(lists.iter().map(Points::count).sum());
        for list in &lists {
            self.lists.each(list, |records| {
                records.chunks_exact(self.lists.stride).try_for_each(|record| all.push(record, self.lists))?;
                Ok(true)
            })?;
        }
        all.finish(self.lists)
    }

    fn take_middle(&mut self, from: &mut List) -> Result<List, ConvertError> {
        self.lists.take_one(from, from.count() / 2)
    }

    fn excludes(&mut self, level: u8, points: &List, enough: usize) -> Result<bool, ConvertError> {
        let mut pairs = Pairs::new(level);
        self.lists.each(points, |records| {
            for record in records.chunks_exact(self.lists.stride) {
                pairs.add(self.sampler, self.frame.tree(record));
                if pairs.count >= enough {
                    return Ok(false);
                }
            }
            Ok(true)
        })?;
        Ok(pairs.count >= enough)
    }

    fn write(&mut self, key: NodeKey, mut points: List) -> Result<(), ConvertError> {
        let (count, stride) = (points.count(), self.lists.stride);
        let is_large = count * stride as u64 > LARGE_BYTES;
        if is_large && self.encoder.takes_parts() {
            points.trim(); // it waits for its place in the tree
            self.finished.add_large(key, points);
            return Ok(());
        }
        let mut room = Reservation::new(self.pool, Consumer::Work);
        if let Some(records) = points.in_memory().filter(|_| !is_large) {
            return self.finished.encode(self.encoder, key, records.chunks_exact(stride));
        }
        if is_large {
            room.resize(count * (stride as u64 + self.encoder.bytes_per_point()))?;
        }
        let mut records = std::mem::take(&mut self.memory.records);
        records.clear();
        records.reserve_exact(count as usize * stride);
        self.lists.each(&points, |piece| {
            records.extend_from_slice(piece);
            Ok(true)
        })?;
        self.finished.encode(self.encoder, key, records.chunks_exact(stride))?;
        if !is_large {
            self.memory.records = records;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
