//! Puts built chunks behind one another in the output, in Morton order, and builds the nodes above them.

use std::collections::HashMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use pointmill_format::NodeKey;

use super::chunk::BuiltChunk;
use super::list::List;
use super::raise::{Nodes, Pending};
use super::sink::{FinishedNode, NodeSink};
use super::top::{Placed, TopNodes};
use crate::cloud::Ledger;
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
    state: Mutex<State<'a, S>>,
    changed: Condvar,
}

/// Buffers below this size are not passed on.
const SPARE_BYTES: usize = 4 << 20;

struct State<'a, S: NodeSink> {
    /// The next chunk to put behind the others.
    next: usize,
    waiting: HashMap<usize, BuiltChunk>,
    stack: Vec<Pending<List>>,
    top: TopNodes<'a, S>,
    ledger: Ledger,
    overfull_leaves: u64,
    spare: Vec<Vec<u8>>,
    /// Chunks above this one are not built any more.
    last: usize,
}

impl<'a, S: NodeSink> Committer<'a, S> {
    /// `keys`: those of all chunks, in Morton order.
    pub(super) fn new(keys: Vec<NodeKey>, window: usize, sink: &'a S, top: TopNodes<'a, S>) -> Self {
        let state = State {
            next: 0,
            waiting: HashMap::new(),
            stack: Vec::new(),
            top,
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
        let State { top, ledger, overfull_leaves, .. } = state;
        Ok(Octree { nodes: top.nodes, bytes: top.bytes, ledger, overfull_leaves })
    }

    fn lock(&self) -> MutexGuard<'_, State<'a, S>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<S: NodeSink> State<'_, S> {
    fn append(
        &mut self,
        chunk: BuiltChunk,
        following: Option<NodeKey>,
        ready: &mut Vec<Placed>,
    ) -> Result<(), ConvertError> {
        let BuiltChunk { payloads, nodes, mut root, ledger, overfull_leaves } = chunk;
        self.ledger.merge(&ledger);
        self.overfull_leaves += overfull_leaves;
        ready.push(self.top.place(nodes, payloads)?);
        self.top.admit(&mut root)?;
        self.stack.push(root);
        self.climb(following)?;
        ready.extend(self.top.take_finished()?);
        Ok(())
    }

    /// Builds every node all of whose chunks are in; at the root writes what is left.
    fn climb(&mut self, following: Option<NodeKey>) -> Result<(), ConvertError> {
        while let Some(last) = self.stack.last() {
            let Some(parent) = last.key.parent() else {
                let Some(mut root) = self.stack.pop() else { break };
                root.write_children(&mut self.top)?;
                return self.top.write(root.key, root.points);
            };
            if following.is_some_and(|f| f.ancestor(parent.level) == Some(parent)) {
                break;
            }
            let first = self.stack.iter().rposition(|n| n.key.parent() != Some(parent)).map_or(0, |i| i + 1);
            let children = self.stack.split_off(first);
            self.stack.push(Pending::above(parent, children, &mut self.top)?);
        }
        Ok(())
    }
}
