//! A subtree in memory: points as four words each, partitioned down to leaves.

use std::ops::Range;

use pointmill_format::bintree::{LeafEncoder, Node, NodeKind, RecordLayout, leaf_center};
use pointmill_format::{Aabb, Deviations, Lattice};
use serde::{Deserialize, Serialize};

use super::extent::Extent;
use super::files::Leaves;
use super::item::Item;
use super::leaf::Columns;
use super::order::order;
use super::rule;
use super::settings::BintreeSettings;
use super::upper::Task;
use crate::cloud::{Cloud, JobBounds, Ledger, Moments, MortonSorter, StoredOrigin, StoredPoint, position};
use crate::error::ConvertError;
use crate::outputs::recovery::{Lost, Recovery};
use crate::runtime::os_hints;

/// Leaves above this are counted in the memory of a task.
const LARGE_LEAF: u32 = 100_000;

/// A subtree, built and written.
#[derive(Serialize, Deserialize)]
pub(super) struct Built {
    /// In preorder; indices count from the subtree's own root.
    pub(super) nodes: Vec<Node>,
    pub(super) ledger: Ledger,
    pub(super) deviations: Deviations,
    pub(super) lost: Lost,
}

/// One thread's means to build subtrees.
pub(super) struct Builder<'a> {
    pub(super) cloud: &'a Cloud<'a>,
    pub(super) settings: &'a BintreeSettings,
    pub(super) columns: &'a Columns,
    pub(super) leaves: &'a Leaves<'a>,
    pub(super) room: Room,
    pub(super) recovery: Recovery,
    /// Of the subtree so far.
    pub(super) deviations: Deviations,
    pub(super) lost: Lost,
}

/// Memory for one subtree after the other.
#[derive(Default)]
pub(super) struct Room {
    records: Vec<u8>,
    items: Vec<Item>,
    swap: Vec<Item>,
    sorter: MortonSorter,
    order: Vec<u32>,
    pub(super) bytes: Vec<u8>,
}

/// A node that is still to be divided.
struct Todo {
    range: Range<usize>,
    path: Vec<bool>,
    what: What,
}

enum What {
    Split,
    /// All points share one place; they are in order, and these many leaves are to be made of them.
    Cut {
        leaves: usize,
    },
}

impl<'a> Builder<'a> {
    /// Memory for a point while its subtree is built: record and two items. A leaf's keys, order and bytes count if
    /// leaves may be as large as tasks.
    pub(super) fn bytes_per_point(stride: usize, record: &RecordLayout, capacity: u32) -> u64 {
        let leaf = if capacity > LARGE_LEAF { 20 + record.stride() as u64 } else { 2 };
        stride as u64 + 2 * size_of::<Item>() as u64 + leaf
    }

    pub(super) fn new(
        cloud: &'a Cloud<'a>,
        settings: &'a BintreeSettings,
        columns: &'a Columns,
        leaves: &'a Leaves<'a>,
        room: Room,
    ) -> Self {
        Self {
            cloud,
            settings,
            columns,
            leaves,
            room,
            recovery: Recovery::new(cloud),
            deviations: Deviations::default(),
            lost: Lost::default(),
        }
    }

    /// Builds the subtree of a task and writes its leaves.
    pub(super) fn build(&mut self, task: &Task) -> Result<Built, ConvertError> {
        let stride = self.cloud.frame.stride;
        let mut ledger = Ledger::default();
        self.room.records.clear();
        os_hints::reserve(&mut self.room.records, task.points() as usize * stride);
        let Cloud { store, facts, .. } = self.cloud;
        for segment in task.segments() {
            ledger.load(store, *segment, stride, &facts.widening, &mut self.room.records)?;
        }
        self.room.items.clear();
        let records = self.room.records.chunks_exact(stride).zip(0u32..);
        self.room.items.extend(records.map(|(r, record)| Item { q: position(r), record }));
        let mut nodes = Vec::new();
        let mut stack = vec![Todo { range: 0..self.room.items.len(), path: task.path.clone(), what: What::Split }];
        // Nodes whose high side has not come yet, deepest last.
        let mut open: Vec<usize> = Vec::new();
        while let Some(todo) = stack.pop() {
            if todo.path.last() == Some(&true)
                && todo.path.len() > task.path.len()
                && let Some(parent) = open.pop()
            {
                let next = nodes.len() as u32;
                let parent: &mut Node = &mut nodes[parent];
                if let NodeKind::Inner { high, .. } | NodeKind::Degenerate { high } = &mut parent.kind {
                    *high = next;
                }
            }
            if let Some(node) = self.node(todo, task.start, &mut stack, &mut ledger)? {
                if !node.is_leaf() {
                    open.push(nodes.len());
                }
                nodes.push(node);
            }
        }
        unite(&mut nodes);
        let (deviations, lost) = (std::mem::take(&mut self.deviations), std::mem::take(&mut self.lost));
        Ok(Built { nodes, ledger, deviations, lost })
    }

    /// One node: a leaf is written; of any other the children go on the stack, the low one on top.
    fn node(
        &mut self,
        todo: Todo,
        start: u64,
        stack: &mut Vec<Todo>,
        ledger: &mut Ledger,
    ) -> Result<Option<Node>, ConvertError> {
        let Todo { range, path, what } = todo;
        let count = range.len();
        if count == 0 {
            return Ok(None);
        }
        let child = |range: Range<usize>, high: bool, what| Todo { range, path: [&path[..], &[high]].concat(), what };
        let capacity = self.settings.capacity as usize;
        let inner = |kind| Some(Node::new(Aabb::EMPTY, count as u64, kind));
        let leaves = match what {
            What::Split => {
                let extent = Extent::of(&self.room.items[range.clone()]);
                if count <= capacity {
                    return self.leaf(&range, &extent, &path, start, true, ledger).map(Some);
                }
                let bounds = JobBounds::new(extent.min.map(i64::from), extent.max.map(i64::from));
                if let Some(axis) = rule::longest_axis(&bounds, self.cloud.lattice.lattice.scale) {
                    let moments = Moments { sum: extent.sum.map(i128::from), bounds };
                    let rule = rule::rule_at(self.settings.split, path.len());
                    let m = match rule::plane(rule, &moments, count as u64, axis) {
                        Some(m) => m as i32,
                        None => self.median(range.clone(), axis, extent.max[axis]),
                    };
                    let low = range.start + self.partition(range.clone(), axis, m);
                    stack.push(child(low..range.end, true, What::Split));
                    stack.push(child(range.start..low, false, What::Split));
                    let lattice = &self.cloud.lattice.lattice;
                    let q = i64::from(m) + self.cloud.frame.origin.0[axis];
                    let split = q as f64 * lattice.scale[axis] + lattice.offset[axis];
                    return Ok(inner(NodeKind::Inner { axis: axis as u8, split, high: 0 }));
                }
                self.put_in_order(&range);
                count.div_ceil(capacity)
            }
            What::Cut { leaves } => leaves,
        };
        if leaves == 1 {
            let extent = Extent::of(&self.room.items[range.clone()]);
            return self.leaf(&range, &extent, &path, start, false, ledger).map(Some);
        }
        // Runs differ by one point at most, larger ones first.
        let low_leaves = leaves.div_ceil(2);
        let longer = count % leaves;
        let low = range.start + low_leaves * (count / leaves) + longer.min(low_leaves);
        stack.push(child(low..range.end, true, What::Cut { leaves: leaves - low_leaves }));
        stack.push(child(range.start..low, false, What::Cut { leaves: low_leaves }));
        Ok(inner(NodeKind::Degenerate { high: 0 }))
    }

    /// Moves what is not above `m` to the front, in order; returns how many these are.
    fn partition(&mut self, range: Range<usize>, axis: usize, m: i32) -> usize {
        let items = &mut self.room.items[range];
        if self.room.swap.len() < items.len() {
            self.room.swap.resize(items.len(), Item::default());
        }
        let swap = &mut self.room.swap[..items.len()];
        // Both places are written and one of them counts: no branch that half of the points mispredict.
        let (mut low, mut high) = (0, 0);
        for i in 0..items.len() {
            let item = items[i];
            items[low] = item;
            swap[high] = item;
            let is_low = usize::from(rule::is_low(item.q[axis], m));
            low += is_low;
            high += 1 - is_low;
        }
        items[low..].copy_from_slice(&swap[..high]);
        low
    }

    fn median(&self, range: Range<usize>, axis: usize, max: i32) -> i32 {
        let mut values: Vec<i32> = self.room.items[range].iter().map(|i| i.q[axis]).collect();
        let rank = rule::median_rank(values.len() as u64) as usize;
        let (_, value, _) = values.select_nth_unstable(rank);
        let value = *value;
        let below_max = || values.iter().copied().filter(|v| *v < max).max();
        if value < max { value } else { below_max().unwrap_or(value) }
    }

    /// Points of one place.
    fn put_in_order(&mut self, range: &Range<usize>) {
        let stride = self.cloud.frame.stride;
        let (columns, records) = (self.columns, &self.room.records);
        let record = |item: &Item| &records[item.record as usize * stride..][..stride];
        // In place: there may be as many as a task has points.
        self.room.items[range.clone()].sort_unstable_by(|a, b| columns.compare(record(a), record(b)));
    }

    /// Encodes and writes a leaf.
    fn leaf(
        &mut self,
        range: &Range<usize>,
        extent: &Extent,
        path: &[bool],
        start: u64,
        must_order: bool,
        ledger: &mut Ledger,
    ) -> Result<Node, ConvertError> {
        let stride = self.cloud.frame.stride;
        let (columns, records) = (self.columns, &self.room.records);
        let record = |item: &Item| &records[item.record as usize * stride..][..stride];
        let items = &self.room.items[range.clone()];
        if must_order {
            order(items, extent.min, extent.max, &mut self.room.sorter, &mut self.room.order, |a, b| {
                columns.compare(record(a), record(b))
            });
        } else {
            self.room.order.clear();
            self.room.order.extend(0..items.len() as u32);
        }
        let world = World { lattice: &self.cloud.lattice.lattice, origin: self.cloud.frame.origin };
        let center = leaf_center(world.of(StoredPoint(extent.min)), world.of(StoredPoint(extent.max)));
        self.room.bytes.clear();
        self.room.bytes.reserve(items.len() * columns.record.stride());
        let mut leaf = LeafEncoder::new(&columns.record, center, &mut self.room.bytes);
        for &i in &self.room.order {
            let item = &items[i as usize];
            let stored = record(item);
            ledger.written.add(stored);
            let rest = leaf.push(world.of(item.q), columns.class(stored));
            columns.fill(stored, rest);
        }
        let deviations = *leaf.deviations();
        let bounds = leaf.finish();
        self.deviations.merge(&deviations);
        if !self.recovery.is_certain(deviations.max) {
            self.lost.merge(self.lost_of(range, center));
        }
        let start = self.leaves.put(path, start + range.start as u64, &self.room.bytes)?;
        Ok(Node::new(bounds, items.len() as u64, NodeKind::Leaf { center, start }))
    }

    /// Points of the leaf just encoded that do not come back from its bytes.
    fn lost_of(&self, range: &Range<usize>, center: [f64; 3]) -> Lost {
        let origin = self.cloud.frame.origin;
        let points = self.room.order.iter().zip(self.room.bytes.chunks_exact(self.columns.record.stride()));
        self.recovery.count(points.map(|(&i, bytes)| {
            let offset = record_offset(bytes);
            let decoded = std::array::from_fn(|a| center[a] + f64::from(offset[a]));
            (decoded, origin.job(self.room.items[range.start + i as usize].q).0)
        }))
    }
}

/// The offset from the center at the start of a leaf record.
pub(super) fn record_offset(record: &[u8]) -> [f32; 3] {
    let words = record.as_chunks::<4>().0;
    std::array::from_fn(|a| words.get(a).map_or(0.0, |w| f32::from_le_bytes(*w)))
}

struct World<'a> {
    lattice: &'a Lattice,
    origin: StoredOrigin,
}

impl World<'_> {
    #[inline]
    fn of(&self, q: StoredPoint) -> [f64; 3] {
        self.lattice.world(self.origin.job(q).0)
    }
}

/// Boxes of inner nodes: the unions of what is below. Children come after their parents, so backwards.
pub(super) fn unite(nodes: &mut [Node]) {
    for i in (0..nodes.len()).rev() {
        if let Some(high) = nodes[i].high() {
            nodes[i].bounds = nodes[i + 1].bounds.union(&nodes[high as usize].bounds);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_takes_its_record_two_items_and_its_part_of_a_large_leaf() {
        let core = RecordLayout::core(); // 16 bytes
        let bytes = |capacity| Builder::bytes_per_point(18, &core, capacity);
        assert_eq!([1000, 100_000, 100_001].map(bytes), [18 + 2 * 16 + 2, 18 + 2 * 16 + 2, 18 + 2 * 16 + 20 + 16]);
    }
}
