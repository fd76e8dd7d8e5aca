//! One unit: a subtree from its chunks, or a node from its children.

use pointmill_format::NodeKey;

use super::borders::{Borders, UnitBorders};
use super::chunk::{ChunkMemory, ChunkPlan};
use super::divide::Chunk;
use super::finished::{Finished, Piece};
use super::list::{List, Lists};
use super::lists::{ListMemory, ListNodes};
use super::place;
use super::raise::{Nodes, Pending};
use super::sample::Sampler;
use super::sinks::{Encoders, Stream};
use crate::cloud::{Checksum, Ledger, TreePoint};
use crate::error::ConvertError;
use crate::job::UnitWriter;
use crate::runtime::{Consumer, Reservation, Runtime, os_hints};

/// A unit, built.
pub(super) struct BuiltUnit {
    /// Nodes that nothing changes any more.
    pub(super) pieces: Vec<Piece>,
    /// What the nodes above may still change; none of the root.
    pub(super) root: Option<Pending<List>>,
    pub(super) ledger: Ledger,
    /// For each stream.
    pub(super) written: Vec<Checksum>,
    /// Leaves above the capacity, because their points share one place.
    pub(super) overfull_leaves: u64,
    /// What was noticed of its points, for each stream; of a unit that is kept.
    pub(super) notes: Vec<Vec<u8>>,
    /// What was taken near its borders.
    pub(super) outer: Outer,
    /// Where a job keeps it once its bytes are in the output.
    pub(super) file: Option<UnitWriter>,
    /// Its nodes are those of an earlier tree.
    pub(super) is_taken_over: bool,
}

/// Points near the border of a unit, by node.
pub(super) type Outer = Vec<(NodeKey, Vec<TreePoint>)>;

/// What threads share that build units.
pub(super) struct Shared<'a> {
    pub(super) plan: ChunkPlan<'a>,
    pub(super) rt: &'a Runtime<'a>,
    pub(super) lists: Lists,
    pub(super) borders: Borders,
    /// Chunks above this size are of one place.
    pub(super) chunk_points: u64,
    /// Memory of a chunk, bytes.
    pub(super) chunk_bytes: u64,
}

/// One thread's means to build units.
pub(super) struct UnitBuilder<'a, E> {
    pub(super) shared: &'a Shared<'a>,
    pub(super) encoder: E,
    pub(super) sampler: Sampler,
    pub(super) chunk: ChunkMemory,
    lists: ListMemory,
}

impl<'a, E: Encoders> UnitBuilder<'a, E> {
    pub(super) fn new(shared: &'a Shared<'a>, sampler: Sampler, encoder: E) -> Self {
        let lists = ListMemory::new(Reservation::new(&shared.rt.memory, Consumer::Work));
        Self { shared, encoder, sampler, chunk: ChunkMemory::default(), lists }
    }

    /// Streams that it writes to.
    pub(super) fn streams(&self) -> usize {
        self.encoder.count()
    }

    /// Builds a subtree in `buffers`, one for each stream, to use again. `wait` is called before the first sample is taken: it returns
    /// when the units before are done, false if this one is not needed any more.
    pub(super) fn subtree(
        &mut self,
        key: NodeKey,
        chunks: &[Chunk],
        buffers: Vec<Vec<u8>>,
        wait: impl FnOnce() -> bool,
    ) -> Result<Option<BuiltUnit>, ConvertError> {
        let mut borders = UnitBorders::new(&self.shared.borders, key);
        let (mut finished, mut ledger, mut overfull_leaves) = (self.finished(buffers), Ledger::default(), 0);
        let mut stack = Vec::new();
        let mut wait = Some(wait);
        for (i, chunk) in chunks.iter().enumerate() {
            let is_large = chunk.points > self.shared.chunk_points;
            if is_large {
                self.chunk = ChunkMemory::default();
            } else {
                self.chunk.load(&self.shared.plan, chunk, &mut ledger)?;
            }
            if wait.take().is_some_and(|wait| !wait()) {
                return Ok(None);
            }
            let (root, overfull) = if is_large {
                place::build(&self.shared.plan, chunk, self.shared.rt, self.shared.chunk_bytes, &mut ledger)?
            } else {
                self.chunk.build(
                    &self.shared.plan,
                    chunk.key,
                    &mut self.sampler,
                    &mut self.encoder,
                    &mut borders,
                    &mut finished,
                )?
            };
            overfull_leaves += overfull;
            stack.push(root);
            let following = chunks.get(i + 1).map(|c| c.key);
            let capacity = self.shared.plan.leaf_capacity;
            climb(&mut stack, key, following, capacity, &mut self.nodes(&mut borders, &mut finished))?;
        }
        match (stack.pop(), stack.is_empty()) {
            (Some(root), true) => self.finish(root, borders, finished, ledger, overfull_leaves).map(Some),
            _ => Err(ConvertError::Internal("a subtree was not finished".into())),
        }
    }

    /// Builds a node from its children, in `buffers` as [`Self::subtree`].
    pub(super) fn above(
        &mut self,
        key: NodeKey,
        children: Vec<Pending<List>>,
        buffers: Vec<Vec<u8>>,
    ) -> Result<BuiltUnit, ConvertError> {
        let mut borders = UnitBorders::new(&self.shared.borders, key);
        let mut finished = self.finished(buffers);
        let capacity = self.shared.plan.leaf_capacity;
        let root = Pending::above_or_leaf(key, children, capacity, &mut self.nodes(&mut borders, &mut finished))?;
        self.finish(root, borders, finished, Ledger::default(), 0)
    }

    /// For the nodes of a unit. Every buffer is made for the largest unit, so that any of them serves the next one: what is
    /// not touched costs nothing.
    fn finished(&self, buffers: Vec<Vec<u8>>) -> Finished {
        let plan = &self.shared.plan;
        let stream = |buffer| {
            let mut stream = Stream::new(buffer);
            os_hints::reserve(&mut stream.bytes, plan.unit_points as usize * plan.cloud.frame.stride);
            stream
        };
        Finished::new(buffers.into_iter().map(stream).collect())
    }

    fn finish(
        &mut self,
        mut root: Pending<List>,
        mut borders: UnitBorders<'a>,
        mut finished: Finished,
        ledger: Ledger,
        overfull_leaves: u64,
    ) -> Result<BuiltUnit, ConvertError> {
        let root = if root.key == NodeKey::ROOT {
            let mut nodes = self.nodes(&mut borders, &mut finished);
            root.write_children(&mut nodes)?;
            nodes.write(root.key, root.points)?;
            None
        } else {
            admit(&self.shared.lists, &mut root)?;
            Some(root)
        };
        let (pieces, written) = finished.into_pieces();
        let outer = borders.into_outer();
        let (notes, file, is_taken_over) = (Vec::new(), None, false);
        Ok(BuiltUnit { pieces, root, ledger, written, overfull_leaves, notes, outer, file, is_taken_over })
    }

    fn nodes<'n>(&'n mut self, borders: &'n mut UnitBorders<'a>, finished: &'n mut Finished) -> ListNodes<'n, 'a, E> {
        ListNodes {
            frame: &self.shared.plan.cloud.frame,
            most_points: self.shared.plan.most_points.into(),
            pool: &self.shared.rt.memory,
            lists: &self.shared.lists,
            sampler: &mut self.sampler,
            encoder: &mut self.encoder,
            memory: &mut self.lists,
            borders,
            finished,
        }
    }
}

/// Accounts for the lists of a unit.
fn admit(lists: &Lists, node: &mut Pending<List>) -> Result<(), ConvertError> {
    lists.admit(&mut node.points)?;
    node.children.iter_mut().try_for_each(|child| admit(lists, child))
}

/// Builds every node up to `top` all of whose chunks are in; `following`: the chunk that comes next.
fn climb(
    stack: &mut Vec<Pending<List>>,
    top: NodeKey,
    following: Option<NodeKey>,
    capacity: u32,
    nodes: &mut impl Nodes<List>,
) -> Result<(), ConvertError> {
    while let Some(parent) = stack.last().filter(|last| last.key != top).and_then(|last| last.key.parent()) {
        if following.is_some_and(|f| f.ancestor(parent.level) == Some(parent)) {
            break;
        }
        let first = stack.iter().rposition(|n| n.key.parent() != Some(parent)).map_or(0, |i| i + 1);
        let children = stack.split_off(first);
        stack.push(Pending::above_or_leaf(parent, children, capacity, nodes)?);
    }
    Ok(())
}
