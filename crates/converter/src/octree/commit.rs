//! Puts built units behind one another in the output, in their order, and lets those begin that waited for them.

use std::collections::HashMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use pointmill_format::NodeKey;

use super::finished::{Piece, Run};
use super::keep;
use super::list::{List, Lists};
use super::raise::{Pending, Points};
use super::sink::{FinishedNode, points_of};
use super::sinks::{Encoders, Sinks, Stream};
use super::unit::BuiltUnit;
use crate::cloud::{Checksum, Ledger};
use crate::error::{ConvertError, Unsupported};
use crate::job::{Place, UnitWriter};
use crate::report::TakenOver;
use crate::runtime::{Consumer, Reservation, Runtime};

/// A finished tree, as one format has it.
pub(crate) struct Octree {
    pub(crate) nodes: Vec<FinishedNode>,
    /// Bytes of all nodes.
    pub(crate) bytes: u64,
    pub(crate) ledger: Ledger,
    /// Leaves above the capacity, because their points share one place.
    pub(crate) overfull_leaves: u64,
    /// [`super::OctreeSettings::unit_points`].
    pub(crate) unit_points: u64,
    /// What was taken from an earlier tree.
    pub(crate) taken_over: TakenOver,
}

/// Where workers hand in their units. A worker may be a few units ahead of the oldest unfinished one, no more: that bounds
/// the memory.
pub(super) struct Committer<'a, S> {
    sinks: &'a S,
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
    placed: Vec<PlacedStream>,
    known: Reservation,
    /// But for what was written, which each stream has of its own.
    ledger: Ledger,
    overfull_leaves: u64,
    taken_over: TakenOver,
    /// Units above this one are not built any more.
    last: usize,
}

/// What has its place in a stream.
#[derive(Default)]
struct PlacedStream {
    nodes: Vec<FinishedNode>,
    /// Bytes of all of them.
    bytes: u64,
    written: Checksum,
    /// Buffers of units that were written, for those to come: their memory was touched already.
    spare: Vec<Vec<u8>>,
}

/// Nodes whose bytes have a place.
enum Placed {
    Nodes {
        stream: usize,
        run: Run,
        offset: u64,
        /// A job keeps where they are.
        is_kept: bool,
    },
    /// The nodes since the last one of these are a unit, which is kept here.
    Unit(UnitWriter),
    /// In each stream.
    Large { nodes: Vec<FinishedNode>, points: List },
}

impl<'a, S: Sinks> Committer<'a, S> {
    pub(super) fn new(units: usize, window: usize, sinks: &'a S, lists: &'a Lists, rt: &Runtime<'_>) -> Self {
        let state = State {
            next: 0,
            waiting: HashMap::new(),
            roots: HashMap::new(),
            placed: (0..sinks.count()).map(|_| PlacedStream::default()).collect(),
            known: Reservation::new(&rt.memory, Consumer::Nodes),
            ledger: Ledger::default(),
            overfull_leaves: 0,
            taken_over: TakenOver::default(),
            last: usize::MAX,
        };
        Self { sinks, lists, window, units, state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Waits until unit `index` may be begun and returns a buffer for its bytes in each stream, empty; `None` if it is not
    /// needed any more, because one below it failed.
    pub(super) fn admit(&self, index: usize) -> Option<Vec<Vec<u8>>> {
        let mut state = self.wait(index, (index + 1).saturating_sub(self.window))?;
        Some(state.placed.iter_mut().map(|stream| stream.spare.pop().unwrap_or_default()).collect())
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
        encoders: &mut impl Encoders,
    ) -> Result<(), ConvertError> {
        let mut ready: Vec<Placed> = Vec::new();
        {
            let mut state = self.lock();
            state.waiting.insert(index, unit);
            loop {
                let next = state.next;
                let Some(unit) = state.waiting.remove(&next) else { break };
                state.append(unit, encoders, &mut ready)?;
                state.next += 1;
            }
        }
        self.changed.notify_all();
        let mut places = Vec::new();
        for placed in ready {
            match placed {
                Placed::Unit(file) => keep::write_places(file, &std::mem::take(&mut places))?,
                Placed::Nodes { stream, run, offset, is_kept } => {
                    let Run { nodes, mut bytes, .. } = run;
                    self.sinks.write(stream, &nodes, &bytes, offset)?;
                    places.extend(is_kept.then(|| Place::of(offset, &bytes)));
                    bytes.clear();
                    let mut state = self.lock();
                    let spare = &mut state.placed[stream].spare;
                    if spare.len() < self.window {
                        spare.push(bytes);
                    }
                }
                Placed::Large { nodes, points } => {
                    let written = self.write_large(&nodes, &points, encoders)?;
                    let placed = &mut self.lock().placed;
                    placed.iter_mut().zip(&written).for_each(|(stream, sum)| stream.written.merge(sum));
                }
            }
        }
        Ok(())
    }

    /// Writes a node whose records are too many to have them in memory together; `nodes`: it in each stream.
    fn write_large(
        &self,
        nodes: &[FinishedNode],
        points: &List,
        encoders: &mut impl Encoders,
    ) -> Result<Vec<Checksum>, ConvertError> {
        let mut streams: Vec<Stream> = nodes.iter().map(|_| Stream::default()).collect();
        let mut sizes = vec![0; nodes.len()];
        self.lists.each(points, |records| {
            streams.iter_mut().for_each(|stream| stream.bytes.clear());
            let Some(key) = nodes.first().map(|node| node.key) else { return Ok(false) };
            encoders.encode(key, records.chunks_exact(self.lists.stride), &mut streams)?;
            for (i, (stream, size)) in streams.iter().zip(&mut sizes).enumerate() {
                self.sinks.write_part(i, &nodes[i], &stream.bytes, *size)?;
                *size += stream.bytes.len() as u64;
            }
            Ok(true)
        })?;
        Ok(streams.iter().map(|stream| stream.written).collect())
    }

    /// The tree as each format has it, once all units were handed in.
    pub(super) fn finish(self, unit_points: u64) -> Result<Vec<Octree>, ConvertError> {
        let state = self.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        if state.next != self.units || !state.roots.is_empty() {
            return Err(ConvertError::Internal("the tree was not finished".into()));
        }
        let State { placed, ledger, overfull_leaves, taken_over, .. } = state;
        let tree = |PlacedStream { nodes, bytes, written, .. }| {
            let mut ledger = ledger.clone();
            ledger.written = written;
            Octree { nodes, bytes, ledger, overfull_leaves, unit_points, taken_over }
        };
        Ok(placed.into_iter().map(tree).collect())
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn append(
        &mut self,
        unit: BuiltUnit,
        encoders: &impl Encoders,
        ready: &mut Vec<Placed>,
    ) -> Result<(), ConvertError> {
        let BuiltUnit { pieces, root, ledger, written, overfull_leaves, file, is_taken_over, .. } = unit;
        self.ledger.merge(&ledger);
        self.placed.iter_mut().zip(&written).for_each(|(stream, sum)| stream.written.merge(sum));
        self.overfull_leaves += overfull_leaves;
        for piece in pieces {
            match piece {
                Piece::Nodes(runs) => {
                    for run in runs.iter().filter(|_| is_taken_over) {
                        self.taken_over.nodes += run.nodes.len() as u64;
                        self.taken_over.points += run.nodes.iter().map(|node| u64::from(node.points)).sum::<u64>();
                    }
                    for (i, (stream, mut run)) in self.placed.iter_mut().zip(runs).enumerate() {
                        let offset = stream.bytes;
                        run.nodes.iter_mut().for_each(|n| n.byte_offset += offset);
                        stream.nodes.extend_from_slice(&run.nodes);
                        if let Some(place) = run.in_place {
                            stream.bytes += place.bytes;
                            check_place(offset, &place)?;
                            continue;
                        }
                        stream.bytes += run.bytes.len() as u64;
                        ready.push(Placed::Nodes { stream: i, run, offset, is_kept: file.is_some() });
                    }
                }
                Piece::Large(key, points) => {
                    let place = |(i, stream): (usize, &mut PlacedStream)| {
                        stream.place_large(key, points.count(), encoders.large_bytes(i, key, points.count()))
                    };
                    let nodes = self.placed.iter_mut().enumerate().map(place).collect::<Result<_, _>>()?;
                    ready.push(Placed::Large { nodes, points });
                }
            }
        }
        ready.extend(file.map(Placed::Unit));
        let nodes: usize = self.placed.iter().map(|stream| stream.nodes.capacity()).sum();
        self.known.resize((nodes * size_of::<FinishedNode>()) as u64)?;
        if let Some(root) = root {
            self.roots.insert(root.key, root);
        }
        Ok(())
    }
}

/// A unit of a run before was put where it belongs: its bytes, and those of all units before it, depend on the tree alone.
fn check_place(offset: u64, place: &Place) -> Result<(), ConvertError> {
    let other = || ConvertError::Internal(format!("a unit at byte {offset} was kept at {}", place.offset));
    if offset == place.offset { Ok(()) } else { Err(other()) }
}

impl PlacedStream {
    /// The place of a node that is encoded later, to so many bytes.
    fn place_large(&mut self, key: NodeKey, points: u64, bytes: Option<u64>) -> Result<FinishedNode, ConvertError> {
        let byte_size = bytes.ok_or(Unsupported::CrowdedNode { points, max: u64::MAX })?;
        let node = FinishedNode { key, points: points_of(points)?, byte_offset: self.bytes, byte_size };
        self.nodes.push(node);
        self.bytes += byte_size;
        Ok(node)
    }
}
