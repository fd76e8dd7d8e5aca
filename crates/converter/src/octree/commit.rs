//! Puts built units behind one another in the output, in their order, and lets those begin that waited for them.

use std::collections::HashMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use pointmill_format::NodeKey;

use super::finished::Piece;
use super::list::{List, Lists};
use super::raise::{Pending, Points};
use super::sink::{FinishedNode, NodeEncoder, NodeSink, points_of};
use super::unit::BuiltUnit;
use crate::cloud::{Checksum, Ledger};
use crate::error::{ConvertError, Unsupported};
use crate::runtime::{Consumer, Reservation, Runtime};

/// A finished tree.
pub(crate) struct Octree {
    pub(crate) nodes: Vec<FinishedNode>,
    /// Bytes of all nodes.
    pub(crate) bytes: u64,
    pub(crate) ledger: Ledger,
    /// Leaves above the capacity, because their points share one place.
    pub(crate) overfull_leaves: u64,
}

/// Where workers hand in their units. A worker may be a few units ahead of the oldest unfinished one, no more: that bounds
/// the memory.
pub(super) struct Committer<'a, S: NodeSink> {
    sink: &'a S,
    lists: &'a Lists,
    window: usize,
    units: usize,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The next unit to put behind the others.
    next: usize,
    waiting: HashMap<usize, BuiltUnit>,
    /// Roots of units that wait for the node above them.
    roots: HashMap<NodeKey, Pending<List>>,
    /// Nodes that have their place.
    nodes: Vec<FinishedNode>,
    known: Reservation,
    /// Bytes of all of them.
    bytes: u64,
    ledger: Ledger,
    overfull_leaves: u64,
    /// Buffers of units that were written, for those to come: their memory was touched already.
    spare: Vec<Vec<u8>>,
    /// Units above this one are not built any more.
    last: usize,
}

/// Nodes whose bytes have a place.
enum Placed {
    Nodes { nodes: Vec<FinishedNode>, bytes: Vec<u8>, offset: u64 },
    Large { node: FinishedNode, points: List },
}

impl<'a, S: NodeSink> Committer<'a, S> {
    pub(super) fn new(units: usize, window: usize, sink: &'a S, lists: &'a Lists, rt: &Runtime<'_>) -> Self {
        let state = State {
            next: 0,
            waiting: HashMap::new(),
            roots: HashMap::new(),
            nodes: Vec::new(),
            known: Reservation::new(&rt.memory, Consumer::Nodes),
            bytes: 0,
            ledger: Ledger::default(),
            overfull_leaves: 0,
            spare: Vec::new(),
            last: usize::MAX,
        };
        Self { sink, lists, window, units, state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Waits until unit `index` may be begun and returns a buffer for its bytes, empty; `None` if it is not needed any more,
    /// because one below it failed.
    pub(super) fn admit(&self, index: usize) -> Option<Vec<u8>> {
        let mut state = self.wait(index, (index + 1).saturating_sub(self.window))?;
        Some(state.spare.pop().unwrap_or_default())
    }

    /// Waits until all units before `first` are done; false if unit `index` is not needed any more.
    pub(super) fn wait_for(&self, index: usize, first: usize) -> bool {
        self.wait(index, first).is_some()
    }

    fn wait(&self, index: usize, first: usize) -> Option<MutexGuard<'_, State>> {
        let mut state = self.lock();
        while index <= state.last && state.next < first {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        (index <= state.last).then_some(state)
    }

    /// Unit `index` has failed: those above it that wait are let go. Those below it go on; they wait for none above.
    pub(super) fn stop_above(&self, index: usize) {
        let mut state = self.lock();
        state.last = state.last.min(index);
        drop(state);
        self.changed.notify_all();
    }

    /// The roots of units that are done.
    pub(super) fn take(&self, roots: &[NodeKey]) -> Result<Vec<Pending<List>>, ConvertError> {
        let mut state = self.lock();
        let taken = roots.iter().map(|key| state.roots.remove(key)).collect::<Option<_>>();
        taken.ok_or_else(|| ConvertError::Internal("a subtree is missing".into()))
    }

    /// Takes a unit; whatever has become next in order gets its place among the bytes, and is written.
    pub(super) fn submit(
        &self,
        index: usize,
        unit: BuiltUnit,
        encoder: &mut impl NodeEncoder,
    ) -> Result<(), ConvertError> {
        let mut ready: Vec<Placed> = Vec::new();
        {
            let mut state = self.lock();
            state.waiting.insert(index, unit);
            loop {
                let next = state.next;
                let Some(unit) = state.waiting.remove(&next) else { break };
                state.append(unit, &*encoder, &mut ready)?;
                state.next += 1;
            }
        }
        self.changed.notify_all();
        for placed in ready {
            match placed {
                Placed::Nodes { nodes, mut bytes, offset } => {
                    self.sink.write(&nodes, &bytes, offset)?;
                    bytes.clear();
                    let mut state = self.lock();
                    if state.spare.len() < self.window {
                        state.spare.push(bytes);
                    }
                }
                Placed::Large { node, points } => {
                    let written = self.write_large(node, &points, encoder)?;
                    self.lock().ledger.written.merge(&written);
                }
            }
        }
        Ok(())
    }

    /// Writes a node whose records are too many to have them in memory together.
    fn write_large(
        &self,
        node: FinishedNode,
        points: &List,
        encoder: &mut impl NodeEncoder,
    ) -> Result<Checksum, ConvertError> {
        let (mut written, mut bytes, mut size) = (Checksum::default(), Vec::new(), 0);
        self.lists.each(points, |records| {
            bytes.clear();
            encoder.encode(node.key, records.chunks_exact(self.lists.stride), &mut written, &mut bytes)?;
            self.sink.write_part(&node, &bytes, size)?;
            size += bytes.len() as u64;
            Ok(true)
        })?;
        Ok(written)
    }

    /// The tree, once all units were handed in.
    pub(super) fn finish(self) -> Result<Octree, ConvertError> {
        let state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if state.next != self.units || !state.roots.is_empty() {
            return Err(ConvertError::Internal("the tree was not finished".into()));
        }
        let State { nodes, bytes, ledger, overfull_leaves, .. } = state;
        Ok(Octree { nodes, bytes, ledger, overfull_leaves })
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn append(
        &mut self,
        unit: BuiltUnit,
        encoder: &impl NodeEncoder,
        ready: &mut Vec<Placed>,
    ) -> Result<(), ConvertError> {
        let BuiltUnit { pieces, root, ledger, overfull_leaves } = unit;
        self.ledger.merge(&ledger);
        self.overfull_leaves += overfull_leaves;
        for piece in pieces {
            let offset = self.bytes;
            match piece {
                Piece::Nodes(mut nodes, bytes) => {
                    nodes.iter_mut().for_each(|n| n.byte_offset += offset);
                    self.nodes.extend_from_slice(&nodes);
                    self.bytes += bytes.len() as u64;
                    ready.push(Placed::Nodes { nodes, bytes, offset });
                }
                Piece::Large(key, points) => {
                    let too_many = || Unsupported::CrowdedNode { points: points.count(), max: u64::MAX };
                    let rows = encoder.row_bytes().and_then(|b| points.count().checked_mul(b));
                    let byte_size = rows.and_then(|b| b.checked_add(encoder.head_bytes(key))).ok_or_else(too_many)?;
                    let node = FinishedNode { key, points: points_of(points.count())?, byte_offset: offset, byte_size };
                    self.nodes.push(node);
                    self.bytes += byte_size;
                    ready.push(Placed::Large { node, points });
                }
            }
        }
        self.known.resize((self.nodes.capacity() * size_of::<FinishedNode>()) as u64)?;
        if let Some(root) = root {
            self.roots.insert(root.key, root);
        }
        Ok(())
    }
}
