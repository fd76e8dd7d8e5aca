//! Puts built chunks behind one another in the output, in Morton order, and builds the nodes above them.

use std::collections::HashMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use pointmill_format::NodeKey;

use super::chunk::BuiltChunk;
use super::raise::{Nodes, Pending};
use super::sample::Sampler;
use super::sink::{FinishedNode, NodeEncoder, NodeSink, finish_node};
use crate::cloud::{Checksum, Ledger, TreePoint};
use crate::error::ConvertError;

/// A finished tree.
pub(crate) struct Octree {
    pub(crate) nodes: Vec<FinishedNode>,
    /// Bytes of all nodes.
    pub(crate) bytes: u64,
    pub(crate) ledger: Ledger,
    /// Leaves above the capacity, because their points share one place.
    pub(crate) overfull_leaves: u64,
}

/// Where workers hand in their chunks. A worker may be a few chunks ahead of the oldest unfinished one, no more: that
/// bounds the memory.
pub(super) struct Committer<'a, S: NodeSink> {
    sink: &'a S,
    window: usize,
    /// Keys of all chunks, in Morton order.
    keys: Vec<NodeKey>,
    state: Mutex<State<S::Encoder>>,
    changed: Condvar,
}

/// Finished nodes whose bytes have a place, and those bytes.
struct Placed {
    nodes: Vec<FinishedNode>,
    bytes: Vec<u8>,
    offset: u64,
}

/// Buffers below this size are not passed on.
const SPARE_BYTES: usize = 4 << 20;

struct State<E> {
    /// The next chunk to put behind the others.
    next: usize,
    waiting: HashMap<usize, BuiltChunk>,
    stack: Vec<Pending<TopPoint>>,
    sampler: Sampler,
    top: TopNodes<E>,
    cursor: u64,
    nodes: Vec<FinishedNode>,
    ledger: Ledger,
    overfull_leaves: u64,
    spare: Vec<Vec<u8>>,
    /// Chunks above this one are not built any more.
    last: usize,
}

/// A point above the chunks.
#[derive(Debug, Clone, Copy)]
struct TopPoint {
    t: TreePoint,
    slab: u32,
    record: u32,
}

/// Pending records in slabs. A slab holds what a chunk handed in or what one node above took, and is dropped once all
/// of it was written or has moved up: what rises to the root must not keep whole chunks in memory.
struct TopNodes<E> {
    stride: usize,
    /// By number; `None` once nothing refers to it any more.
    slabs: Vec<Option<Slab>>,
    encoder: E,
    payloads: Vec<u8>,
    nodes: Vec<FinishedNode>,
    written: Checksum,
}

struct Slab {
    records: Vec<u8>,
    remaining: usize,
}

impl<E: NodeEncoder> Nodes<TopPoint> for TopNodes<E> {
    fn tree(&self, point: TopPoint) -> TreePoint {
        point.t
    }

    fn write(&mut self, key: NodeKey, points: &[TopPoint]) -> Result<(), ConvertError> {
        let record = |p: &TopPoint| {
            let at = p.record as usize * self.stride;
            self.slabs[p.slab as usize].as_ref().map_or(&[][..], |slab| &slab.records[at..at + self.stride])
        };
        let records = points.iter().map(record);
        let node = finish_node(&mut self.encoder, key, records, &mut self.written, &mut self.payloads)?;
        self.nodes.push(node);
        points.iter().for_each(|p| self.release(*p));
        Ok(())
    }
}

impl<E> TopNodes<E> {
    fn add_slab(&mut self, records: Vec<u8>, points: usize) -> u32 {
        self.slabs.push((points > 0).then_some(Slab { records, remaining: points }));
        (self.slabs.len() - 1) as u32
    }

    /// Moves the records of a node that was just sampled into a slab of their own.
    fn gather_slab(&mut self, points: &mut [TopPoint]) {
        let mut records = Vec::with_capacity(points.len() * self.stride);
        for p in points.iter() {
            if let Some(slab) = &self.slabs[p.slab as usize] {
                records.extend_from_slice(&slab.records[p.record as usize * self.stride..][..self.stride]);
            }
        }
        points.iter().for_each(|p| self.release(*p));
        let slab = self.add_slab(records, points.len());
        for (record, p) in points.iter_mut().enumerate() {
            *p = TopPoint { slab, record: record as u32, ..*p };
        }
    }

    fn release(&mut self, point: TopPoint) {
        let slot = &mut self.slabs[point.slab as usize];
        if let Some(slab) = slot {
            slab.remaining -= 1;
            if slab.remaining == 0 {
                *slot = None;
            }
        }
    }
}

impl<'a, S: NodeSink> Committer<'a, S> {
    pub(super) fn new(sink: &'a S, keys: Vec<NodeKey>, window: usize, stride: usize, sampler: Sampler) -> Self {
        let top = TopNodes {
            stride,
            slabs: Vec::new(),
            encoder: sink.encoder(),
            payloads: Vec::new(),
            nodes: Vec::new(),
            written: Checksum::default(),
        };
        let state = State {
            next: 0,
            waiting: HashMap::new(),
            stack: Vec::new(),
            sampler,
            top,
            cursor: 0,
            nodes: Vec::new(),
            ledger: Ledger::default(),
            overfull_leaves: 0,
            spare: Vec::new(),
            last: usize::MAX,
        };
        Self { sink, window, keys, state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Waits until chunk `index` may be begun and returns a buffer for its bytes; `None` if it is not needed any more,
    /// because one below it failed.
    pub(super) fn admit(&self, index: usize) -> Option<Vec<u8>> {
        let mut state = self.lock();
        while index <= state.last && index >= state.next + self.window {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        (index <= state.last).then(|| state.spare.pop().unwrap_or_default())
    }

    /// Chunk `index` has failed: those above it that wait are let go. Those below it go on; they wait for none above.
    pub(super) fn stop_above(&self, index: usize) {
        let mut state = self.lock();
        state.last = state.last.min(index);
        drop(state);
        self.changed.notify_all();
    }

    /// Takes a chunk; whatever has become next in order gets its place among the bytes, and is written.
    pub(super) fn submit(&self, index: usize, chunk: BuiltChunk) -> Result<(), ConvertError> {
        let mut ready: Vec<Placed> = Vec::new();
        {
            let mut state = self.lock();
            state.waiting.insert(index, chunk);
            loop {
                let next = state.next;
                let Some(chunk) = state.waiting.remove(&next) else { break };
                let following = self.keys.get(next + 1).copied();
                state.append(chunk, following, &mut ready)?;
                state.next += 1;
            }
        }
        self.changed.notify_all();
        for Placed { nodes, bytes, offset } in ready {
            self.sink.write(&nodes, &bytes, offset)?;
            let mut state = self.lock();
            // The small buffers of the nodes above are not worth keeping.
            if state.spare.len() < self.window && bytes.capacity() > SPARE_BYTES {
                state.spare.push(bytes);
            }
        }
        Ok(())
    }

    /// The tree, once all chunks were handed in.
    pub(super) fn finish(self) -> Result<Octree, ConvertError> {
        let mut state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if state.next != self.keys.len() || !state.stack.is_empty() {
            return Err(ConvertError::Internal("the tree was not finished".into()));
        }
        state.ledger.written.merge(&state.top.written);
        let State { nodes, cursor, ledger, overfull_leaves, .. } = state;
        Ok(Octree { nodes, bytes: cursor, ledger, overfull_leaves })
    }

    fn lock(&self) -> MutexGuard<'_, State<S::Encoder>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<E: NodeEncoder> State<E> {
    fn append(
        &mut self,
        chunk: BuiltChunk,
        following: Option<NodeKey>,
        ready: &mut Vec<Placed>,
    ) -> Result<(), ConvertError> {
        let BuiltChunk { payloads, nodes, root, pending_trees, pending_records, ledger, overfull_leaves } = chunk;
        self.ledger.merge(&ledger);
        self.overfull_leaves += overfull_leaves;
        ready.push(self.place(nodes, payloads));
        let slab = self.top.add_slab(pending_records, pending_trees.len());
        self.stack.push(lift(root, slab, &pending_trees));
        self.climb(following)?;
        if !self.top.payloads.is_empty() {
            let payloads = std::mem::take(&mut self.top.payloads);
            let nodes = std::mem::take(&mut self.top.nodes);
            ready.push(self.place(nodes, payloads));
        }
        Ok(())
    }

    /// Gives finished nodes the next place among the bytes.
    fn place(&mut self, mut nodes: Vec<FinishedNode>, bytes: Vec<u8>) -> Placed {
        let offset = self.cursor;
        nodes.iter_mut().for_each(|n| n.byte_offset += offset);
        self.nodes.extend_from_slice(&nodes);
        self.cursor += bytes.len() as u64;
        Placed { nodes, bytes, offset }
    }

    /// Builds every node all of whose chunks are in; at the root writes what is left.
    fn climb(&mut self, following: Option<NodeKey>) -> Result<(), ConvertError> {
        while let Some(last) = self.stack.last() {
            let Some(parent) = last.key.parent() else {
                let Some(mut root) = self.stack.pop() else { break };
                root.write_children(&mut self.top)?;
                return self.top.write(root.key, &root.points);
            };
            if following.is_some_and(|f| f.ancestor(parent.level) == Some(parent)) {
                break;
            }
            let first = self.stack.iter().rposition(|n| n.key.parent() != Some(parent)).map_or(0, |i| i + 1);
            let children = self.stack.split_off(first);
            let mut node = Pending::above(parent, children, &mut self.sampler, &mut self.top)?;
            self.top.gather_slab(&mut node.points);
            // What is left in the children: a few points must not keep the slabs in which they came.
            for child in &mut node.children {
                self.top.gather_slab(&mut child.points);
                child.points.shrink_to_fit();
            }
            self.stack.push(node);
        }
        Ok(())
    }
}

/// From points of a chunk to points above the chunks.
fn lift(node: Pending<u32>, slab: u32, trees: &[TreePoint]) -> Pending<TopPoint> {
    let points = node.points.iter().map(|&record| TopPoint { t: trees[record as usize], slab, record }).collect();
    let children = node.children.into_iter().map(|c| lift(c, slab, trees)).collect();
    Pending { key: node.key, points, is_inner: node.is_inner, children }
}
