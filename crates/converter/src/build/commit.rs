//! Puts built chunks behind one another in the output, in Morton order, and builds the nodes above them.

use std::collections::{HashMap, VecDeque};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard};

use pointmill_format::NodeKey;
use pointmill_format::bytes::write_all_at;
use pointmill_format::potree2::NodeEntry;

use super::chunk::{Accounts, BuiltChunk};
use super::tree::{Nodes, Pending};
use crate::checksum::Checksum;
use crate::error::ConvertError;
use crate::os_hints;
use crate::sample::Sampler;
use crate::write::payload::PayloadWriter;

/// Where workers hand in their chunks. A worker may be a few chunks ahead of the oldest unfinished one, no more: that
/// bounds the memory.
pub(crate) struct Committer<'a> {
    file: &'a File,
    path: PathBuf,
    window: usize,
    /// Keys of all chunks, in Morton order.
    keys: Vec<NodeKey>,
    state: Mutex<State>,
    changed: Condvar,
}

/// Buffers below this size are not passed on.
const SPARE_BYTES: usize = 4 << 20;

struct State {
    /// The next chunk to put behind the others.
    next: usize,
    waiting: HashMap<usize, BuiltChunk>,
    stack: Vec<Pending<TopPoint>>,
    sampler: Sampler,
    top: TopNodes,
    cursor: u64,
    nodes: Vec<NodeEntry>,
    accounts: Accounts,
    spare: Vec<Vec<u8>>,
    stopped: bool,
}

/// What the whole tree came to.
pub(crate) struct Built {
    pub(crate) nodes: Vec<NodeEntry>,
    pub(crate) bytes: u64,
    pub(crate) accounts: Accounts,
}

/// A point above the chunks.
#[derive(Debug, Clone, Copy)]
struct TopPoint {
    t: [u32; 3],
    slab: u32,
    record: u32,
}

/// Pending records in slabs. A slab holds what a chunk handed in or what one node above took, and is dropped once all
/// of it was written or has moved up: what rises to the root must not keep whole chunks in memory.
struct TopNodes {
    stride: usize,
    /// By number; `None` once nothing refers to it any more.
    slabs: Vec<Option<Slab>>,
    writer: PayloadWriter,
    payloads: Vec<u8>,
    nodes: Vec<NodeEntry>,
    written: Checksum,
}

struct Slab {
    records: Vec<u8>,
    remaining: usize,
}

impl Nodes<TopPoint> for TopNodes {
    fn tree(&self, point: TopPoint) -> [u32; 3] {
        point.t
    }

    fn write(&mut self, key: NodeKey, points: &[TopPoint]) -> Result<(), ConvertError> {
        let record = |p: &TopPoint| {
            let at = p.record as usize * self.stride;
            self.slabs[p.slab as usize].as_ref().map_or(&[][..], |slab| &slab.records[at..at + self.stride])
        };
        let records = points.iter().map(record);
        let entry = self.writer.write(key, records, &mut self.payloads, &mut self.written)?;
        self.nodes.push(entry);
        points.iter().for_each(|p| self.release(*p));
        Ok(())
    }
}

impl TopNodes {
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

impl<'a> Committer<'a> {
    pub(crate) fn new(
        file: &'a File,
        path: &Path,
        keys: Vec<NodeKey>,
        window: usize,
        stride: usize,
        sampler: Sampler,
        writer: PayloadWriter,
    ) -> Self {
        let top = TopNodes {
            stride,
            slabs: Vec::new(),
            writer,
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
            accounts: Accounts::default(),
            spare: Vec::new(),
            stopped: false,
        };
        Self { file, path: path.to_path_buf(), window, keys, state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Waits until chunk `index` may be begun and returns a buffer for its payloads; `None` if the run was stopped.
    pub(crate) fn admit(&self, index: usize) -> Option<Vec<u8>> {
        let mut state = self.lock();
        while !state.stopped && index >= state.next + self.window {
            state = self.changed.wait(state).unwrap_or_else(std::sync::PoisonError::into_inner);
        }
        (!state.stopped).then(|| state.spare.pop().unwrap_or_default())
    }

    /// Ends the run early; workers that wait are let go.
    pub(crate) fn stop(&self) {
        self.lock().stopped = true;
        self.changed.notify_all();
    }

    /// Takes a chunk; whatever has become next in order gets its place in the file, and is written.
    pub(crate) fn submit(&self, index: usize, chunk: BuiltChunk) -> Result<(), ConvertError> {
        let mut ready: VecDeque<(u64, Vec<u8>)> = VecDeque::new();
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
        for (offset, bytes) in ready {
            write_all_at(self.file, &bytes, offset)
                .map_err(|e| ConvertError::io(&self.path, "writing node payloads", e))?;
            os_hints::start_write_back(self.file, offset, bytes.len());
            let mut state = self.lock();
            // The small buffers of the nodes above are not worth keeping.
            if state.spare.len() < self.window && bytes.capacity() > SPARE_BYTES {
                state.spare.push(bytes);
            }
        }
        Ok(())
    }

    /// The tree, once all chunks were handed in.
    pub(crate) fn finish(self) -> Result<Built, ConvertError> {
        let mut state = self.state.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        if state.next != self.keys.len() || !state.stack.is_empty() {
            return Err(ConvertError::Internal("the tree was not finished".into()));
        }
        state.accounts.written.merge(&state.top.written);
        Ok(Built { nodes: state.nodes, bytes: state.cursor, accounts: state.accounts })
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl State {
    fn append(
        &mut self,
        chunk: BuiltChunk,
        following: Option<NodeKey>,
        ready: &mut VecDeque<(u64, Vec<u8>)>,
    ) -> Result<(), ConvertError> {
        let BuiltChunk { payloads, nodes, root, pending_trees, pending_records, accounts } = chunk;
        self.accounts.merge(&accounts);
        self.place(nodes, payloads, ready);
        let slab = self.top.add_slab(pending_records, pending_trees.len());
        self.stack.push(lift(root, slab, &pending_trees));
        self.climb(following)?;
        if !self.top.payloads.is_empty() {
            let payloads = std::mem::take(&mut self.top.payloads);
            let nodes = std::mem::take(&mut self.top.nodes);
            self.place(nodes, payloads, ready);
        }
        Ok(())
    }

    /// Gives payloads the next place in the file.
    fn place(&mut self, nodes: Vec<NodeEntry>, payloads: Vec<u8>, ready: &mut VecDeque<(u64, Vec<u8>)>) {
        let cursor = self.cursor;
        self.nodes.extend(nodes.into_iter().map(|n| NodeEntry { byte_offset: n.byte_offset + cursor, ..n }));
        self.cursor += payloads.len() as u64;
        ready.push_back((cursor, payloads));
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
fn lift(node: Pending<u32>, slab: u32, trees: &[[u32; 3]]) -> Pending<TopPoint> {
    let points = node.points.iter().map(|&record| TopPoint { t: trees[record as usize], slab, record }).collect();
    let children = node.children.into_iter().map(|c| lift(c, slab, trees)).collect();
    Pending { key: node.key, points, is_inner: node.is_inner, children }
}
