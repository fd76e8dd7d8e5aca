//! A task that is larger than others because it cannot be divided: one leaf, or points that share one place. Its records
//! are put in order on the disk and pass by.

use std::cmp::Ordering;
use std::mem::take;

use pointmill_format::Aabb;
use pointmill_format::bintree::{LeafEncoder, Node, NodeKind, leaf_center};

use super::subtree::{Builder, Built, Room, record_offset, unite};
use super::upper::Task;
use crate::cloud::{BigSort, Cloud, Ledger, StoredPoint, morton, position};
use crate::error::ConvertError;
use crate::outputs::recovery::LostSort;
use crate::runtime::Runtime;

/// Bytes of records that are encoded together.
const PIECE_BYTES: usize = 1 << 20;

/// A leaf to make.
struct Leaf {
    points: u64,
    path: Vec<bool>,
    /// Index among the nodes.
    node: usize,
    bounds: Aabb,
    /// Points so far.
    written: u64,
}

impl Builder<'_> {
    /// Builds and writes the subtree of a large task, in `memory_bytes` of memory.
    pub(super) fn build_large(
        &mut self,
        task: &Task,
        rt: &Runtime<'_>,
        memory_bytes: u64,
    ) -> Result<Built, ConvertError> {
        self.room = Room::default();
        let Cloud { store, facts, frame, .. } = self.cloud;
        let (stride, columns, bounds) = (frame.stride, self.columns, task.moments().bounds);
        let [min, max] = [bounds.min, bounds.max].map(|q| frame.origin.stored(q));
        // Morton order relative to the least integers, then as points of one place are in order
        let compare = |a: &[u8], b: &[u8]| -> Ordering {
            let relative = |p: StoredPoint| -> [u32; 3] { std::array::from_fn(|k| p[k].abs_diff(min[k])) };
            morton::compare(relative(position(a)), relative(position(b))).then_with(|| columns.compare(a, b))
        };
        let mut ledger = Ledger::default();
        let mut sort = BigSort::new(rt, stride, memory_bytes / 2, compare);
        sort.fill(task.segments(), |segment, records| ledger.load(store, segment, stride, &facts.widening, records))?;
        let capacity = u64::from(self.settings.capacity);
        let (mut nodes, mut leaves) = (Vec::new(), Vec::new());
        cut(task.points(), task.points().div_ceil(capacity), task.path.clone(), &mut nodes, &mut leaves);
        let center = leaf_center(self.world(min), self.world(max));
        let mut lost =
            (!self.is_certain_within(center, max)).then(|| LostSort::new(rt, memory_bytes / 2, self.recovery));
        let (mut leaves, mut start) = (leaves.into_iter(), task.start);
        let (mut open, mut piece) = (leaves.next(), Vec::new());
        sort.finish(|record| {
            piece.extend_from_slice(record);
            let Some(leaf) = &mut open else { return Ok(()) };
            let is_complete = leaf.written + (piece.len() / stride) as u64 == leaf.points;
            if is_complete || piece.len() >= PIECE_BYTES {
                self.encode_piece(leaf, start, center, &piece, &mut ledger, lost.as_mut())?;
                piece.clear();
            }
            if is_complete {
                let byte = self.leaves.start_of(start);
                nodes[leaf.node] = Node::new(leaf.bounds, leaf.points, NodeKind::Leaf { center, start: byte });
                start += leaf.points;
                open = leaves.next();
            }
            Ok(())
        })?;
        if let Some(lost) = lost {
            self.lost.merge(lost.finish()?);
        }
        unite(&mut nodes);
        let (deviations, lost) = (take(&mut self.deviations), take(&mut self.lost));
        Ok(Built { nodes, ledger, deviations, lost })
    }

    fn world(&self, q: StoredPoint) -> [f64; 3] {
        self.cloud.lattice.lattice.world(self.cloud.frame.origin.job(q).0)
    }

    /// True if single precision keeps every point of a leaf on its point of the lattice.
    fn is_certain_within(&self, center: [f64; 3], max: StoredPoint) -> bool {
        let max = self.world(max);
        let error = |a: usize| (max[a] - center[a]) * f64::from(f32::EPSILON) + center[a].abs() * f64::EPSILON;
        self.recovery.is_certain([0, 1, 2].map(error))
    }

    /// Encodes and writes the next records of a leaf, of which `start` points lie before it.
    fn encode_piece<'a>(
        &mut self,
        leaf: &mut Leaf,
        start: u64,
        center: [f64; 3],
        records: &[u8],
        ledger: &mut Ledger,
        lost: Option<&mut LostSort<'a>>,
    ) -> Result<(), ConvertError> {
        let (columns, stride) = (self.columns, self.cloud.frame.stride);
        let mut bytes = take(&mut self.room.bytes);
        bytes.clear();
        let mut encoder = LeafEncoder::new(&columns.record, center, &mut bytes);
        for record in records.chunks_exact(stride) {
            ledger.written.add(record);
            let rest = encoder.push(self.world(position(record)), columns.class(record));
            columns.fill(record, rest);
        }
        self.deviations.merge(encoder.deviations());
        leaf.bounds = leaf.bounds.union(&encoder.finish());
        if let Some(lost) = lost {
            for (record, bytes) in records.chunks_exact(stride).zip(bytes.chunks_exact(columns.record.stride())) {
                let offset = record_offset(bytes);
                let decoded = std::array::from_fn(|a| center[a] + f64::from(offset[a]));
                lost.add(decoded, self.cloud.frame.origin.job(position(record)).0)?;
            }
        }
        self.leaves.put_part(&leaf.path, start, leaf.written, &bytes)?;
        leaf.written += (records.len() / stride) as u64;
        self.room.bytes = bytes;
        Ok(())
    }
}

/// The nodes, in preorder, that cut `points` into so many leaves: runs differ by one point at most, larger ones first.
fn cut(points: u64, leaves: u64, path: Vec<bool>, nodes: &mut Vec<Node>, out: &mut Vec<Leaf>) {
    let node = nodes.len();
    nodes.push(Node::new(Aabb::EMPTY, points, NodeKind::Degenerate { high: 0 }));
    if leaves <= 1 {
        out.push(Leaf { points, path, node, bounds: Aabb::EMPTY, written: 0 });
        return;
    }
    let low_leaves = leaves.div_ceil(2);
    let longer = points % leaves;
    let low = low_leaves * (points / leaves) + longer.min(low_leaves);
    cut(low, low_leaves, [&path[..], &[false]].concat(), nodes, out);
    let next = nodes.len() as u32;
    if let NodeKind::Degenerate { high } = &mut nodes[node].kind {
        *high = next;
    }
    cut(points - low, leaves - low_leaves, [&path[..], &[true]].concat(), nodes, out);
}
