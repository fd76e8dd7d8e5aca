//! Splits of nodes that are too large for memory: planes from the sums of cells, and only the cells that a plane crosses
//! are read.

use pointmill_format::bintree::MAX_DEPTH;
use serde::{Deserialize, Serialize};

use super::rule;
use super::settings::BintreeSettings;
use crate::cloud::{Cloud, JobPoint, Moments, Segment, Segments, Store, StoredOrigin, position};
use crate::error::ConvertError;
use crate::runtime::Runtime;

/// Bytes of a side that are put into a block together.
const SIDE_BYTES: usize = 4 << 20;

/// Records that are read and divided together, and bytes of wide ones.
const CUT_POINTS: usize = 65_536;
const CUT_BYTES: usize = 4 << 20;

/// Bins of the histogram by which a median is narrowed down.
const BINS: u64 = 4096;

/// Points of a node that lie near each other, wherever they are stored.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Part {
    points: u64,
    segments: Segments,
    moments: Moments,
}

/// A subtree to build in memory.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Task {
    pub(super) parts: Vec<Part>,
    /// Points before it in the order of leaves.
    pub(super) start: u64,
    /// From the root: true is high.
    pub(super) path: Vec<bool>,
}

impl Task {
    pub(super) fn points(&self) -> u64 {
        self.parts.iter().map(|p| p.points).sum()
    }

    /// Memory that the lists of its records take.
    pub(super) fn bytes(&self) -> u64 {
        self.parts.iter().map(|p| p.segments.bytes() + size_of::<Part>() as u64).sum()
    }

    pub(super) fn segments(&self) -> impl Iterator<Item = &Segment> {
        self.parts.iter().flat_map(|p| p.segments.iter())
    }

    pub(super) fn moments(&self) -> Moments {
        moments(&self.parts)
    }
}

/// An upper node.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Split {
    pub(super) axis: u8,
    /// World coordinate of the plane.
    pub(super) plane: f64,
    pub(super) points: u64,
}

/// The top of the tree, in preorder: splits, and in their places (`None`) the tasks one after the other.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Upper {
    pub(super) splits: Vec<Option<Split>>,
    pub(super) tasks: Vec<Task>,
}

impl Upper {
    /// True if it can be of a cloud with so many points: where others have split it, nobody has looked.
    pub(super) fn can_be_of(&self, points: u64) -> bool {
        let is_part = |part: &Part| part.points == part.segments.points();
        let is_split = |split: &Split| split.axis < 3 && split.plane.is_finite();
        let mut next = 0u64;
        let mut follow = |task: &Task| {
            let all = task.parts.iter().try_fold(next, |all, part| all.checked_add(part.points));
            let is_next = task.start == next && task.path.len() <= MAX_DEPTH;
            next = all.unwrap_or(u64::MAX);
            is_next && all.is_some()
        };
        // one open end at first; a split opens one more, a task closes one
        let ends = self.splits.iter().try_fold(1usize, |ends, split| match split {
            _ if ends == 0 => None,
            Some(split) => Some(ends + 1).filter(|_| is_split(split)),
            None => Some(ends - 1),
        });
        self.tasks.iter().flat_map(|task| &task.parts).all(is_part)
            && self.tasks.iter().all(&mut follow)
            && next == points
            && ends == Some(0)
            && self.splits.iter().filter(|split| split.is_none()).count() == self.tasks.len()
    }
}

/// Splits until every part has at most `task_points` points, or is a leaf, or shares one place.
pub(super) fn split(
    cloud: &Cloud<'_>,
    rt: &Runtime<'_>,
    settings: &BintreeSettings,
    task_points: u64,
) -> Result<Upper, ConvertError> {
    let lattice = &cloud.lattice.lattice;
    let parts = cloud.cells.iter();
    let parts: Vec<Part> =
        parts.map(|c| Part { points: c.points, segments: c.segments.clone(), moments: c.moments }).collect();
    let mut upper = Upper { splits: Vec::new(), tasks: Vec::new() };
    let mut stack = vec![Task { parts, start: 0, path: Vec::new() }];
    while let Some(node) = stack.pop() {
        let points = node.points();
        if points == 0 {
            continue;
        }
        let moments = node.moments();
        let axis = rule::longest_axis(&moments.bounds, lattice.scale);
        let Some(axis) = axis.filter(|_| points > task_points.max(u64::from(settings.capacity))) else {
            upper.splits.push(None);
            upper.tasks.push(node);
            continue;
        };
        rt.check_stop()?;
        let cut = Cut { store: &cloud.store, stride: cloud.frame.stride, origin: cloud.frame.origin, axis };
        let rule = rule::rule_at(settings.split, node.path.len());
        let m = match rule::plane(rule, &moments, points, axis) {
            Some(m) => m,
            None => cut.median(&node.parts, &moments, points)?,
        };
        let [low, high] = cut.divide(node.parts, m)?;
        let low_points: u64 = low.iter().map(|p| p.points).sum();
        let plane = m as f64 * lattice.scale[axis] + lattice.offset[axis];
        upper.splits.push(Some(Split { axis: axis as u8, plane, points }));
        let child = |parts, start, high| Task { parts, start, path: [&node.path[..], &[high]].concat() };
        stack.push(child(high, node.start + low_points, true));
        stack.push(child(low, node.start, false)); // the low side comes first
    }
    Ok(upper)
}

fn moments(parts: &[Part]) -> Moments {
    let mut all = Moments::default();
    parts.iter().for_each(|p| all.merge(&p.moments));
    all
}

/// A plane across an axis.
struct Cut<'a> {
    store: &'a Store,
    stride: usize,
    origin: StoredOrigin,
    axis: usize,
}

impl Cut<'_> {
    #[inline]
    fn job(&self, record: &[u8]) -> JobPoint {
        self.origin.job(position(record))
    }

    /// Low (not above `m`) and high side. Parts on one side stay as they are.
    fn divide(&self, parts: Vec<Part>, m: i64) -> Result<[Vec<Part>; 2], ConvertError> {
        let mut sides = [Side::default(), Side::default()];
        let mut records = Vec::new();
        for part in parts {
            let bounds = &part.moments.bounds;
            if rule::is_low(bounds.max[self.axis], m) {
                sides[0].parts.push(part);
            } else if !rule::is_low(bounds.min[self.axis], m) {
                sides[1].parts.push(part);
            } else {
                sides.iter_mut().for_each(Side::start_part);
                for segment in
                    part.segments.iter().flat_map(|s| s.split((CUT_BYTES / self.stride).clamp(1, CUT_POINTS) as u32))
                {
                    records.clear();
                    let source = self.store.take(segment, &mut records)?;
                    for side in &mut sides {
                        side.reserve(self.store, source)?;
                    }
                    for record in records.chunks_exact(self.stride) {
                        let q = self.job(record);
                        sides[usize::from(!rule::is_low(q[self.axis], m))].add(record, q);
                    }
                    for side in &mut sides {
                        side.end_segment(self.stride);
                    }
                }
                sides.iter_mut().for_each(Side::end_part);
            }
        }
        for side in &mut sides {
            side.close(self.store)?;
        }
        Ok(sides.map(|s| s.parts))
    }

    /// The median's integer (section 6.2 of the format's page), by counting in ever narrower ranges; parts that one bin
    /// holds are counted unread.
    fn median(&self, parts: &[Part], moments: &Moments, points: u64) -> Result<i64, ConvertError> {
        let max = moments.bounds.max[self.axis];
        let rank = rule::median_rank(points);
        let value = self.value_at(parts, moments.bounds.min[self.axis], max, rank)?;
        if value < max {
            return Ok(value);
        }
        // The largest value below the maximum: the one before the first that equals it.
        let below = self.count_below(parts, max)?;
        self.value_at(parts, moments.bounds.min[self.axis], max, below.saturating_sub(1))
    }

    /// The value at `rank` in ascending order, between `low` and `high`.
    fn value_at(&self, parts: &[Part], mut low: i64, mut high: i64, mut rank: u64) -> Result<i64, ConvertError> {
        let mut records = Vec::new();
        while low < high {
            let width = (high.abs_diff(low) + 1).div_ceil(BINS).max(1);
            let bin = |v: i64| (v.abs_diff(low) / width) as usize;
            let mut counts = vec![0u64; BINS as usize + 1];
            for part in parts {
                let (min, max) = (part.moments.bounds.min[self.axis], part.moments.bounds.max[self.axis]);
                if max < low || min > high {
                    continue;
                }
                if min >= low && max <= high && bin(min) == bin(max) {
                    counts[bin(min)] += part.points;
                    continue;
                }
                self.each(part, &mut records, |v| {
                    if (low..=high).contains(&v) {
                        counts[bin(v)] += 1;
                    }
                })?;
            }
            let mut chosen = 0;
            while chosen < counts.len() - 1 && rank >= counts[chosen] {
                rank -= counts[chosen];
                chosen += 1;
            }
            let start = low.saturating_add_unsigned(chosen as u64 * width);
            high = high.min(start.saturating_add_unsigned(width - 1));
            low = start;
        }
        Ok(low)
    }

    fn count_below(&self, parts: &[Part], value: i64) -> Result<u64, ConvertError> {
        let (mut count, mut records) = (0, Vec::new());
        for part in parts {
            let (min, max) = (part.moments.bounds.min[self.axis], part.moments.bounds.max[self.axis]);
            if max < value {
                count += part.points;
            } else if min < value {
                self.each(part, &mut records, |v| count += u64::from(v < value))?;
            }
        }
        Ok(count)
    }

    /// The values of a part's points, which stay where they are.
    fn each(&self, part: &Part, records: &mut Vec<u8>, mut see: impl FnMut(i64)) -> Result<(), ConvertError> {
        for segment in part.segments.iter().flat_map(|s| s.split((CUT_BYTES / self.stride).clamp(1, CUT_POINTS) as u32))
        {
            records.clear();
            self.store.read(segment, records)?;
            records.chunks_exact(self.stride).for_each(|r| see(self.job(r)[self.axis]));
        }
        Ok(())
    }
}

/// One side of a cut, and the block into which points of crossed parts go.
#[derive(Default)]
struct Side {
    parts: Vec<Part>,
    part: Option<Part>,
    block: Option<OpenBlock>,
    records: Vec<u8>,
    /// Records of the block that belong to earlier segments.
    settled: usize,
}

struct OpenBlock {
    index: u32,
    source: u32,
}

impl Side {
    fn start_part(&mut self) {
        self.part = Some(Part { points: 0, segments: Segments::default(), moments: Moments::default() });
    }

    /// Makes sure that the open block is of `source` and has room. A block holds records of one source.
    fn reserve(&mut self, store: &Store, source: u32) -> Result<(), ConvertError> {
        let fits = self.block.as_ref().is_some_and(|b| b.source == source) && self.records.len() < SIDE_BYTES;
        if !fits {
            self.close(store)?;
            self.block = Some(OpenBlock { index: store.open(source)?, source });
        }
        Ok(())
    }

    #[inline]
    fn add(&mut self, record: &[u8], q: JobPoint) {
        self.records.extend_from_slice(record);
        if let Some(part) = &mut self.part {
            part.points += 1;
            part.moments.add(q);
        }
    }

    fn end_segment(&mut self, stride: usize) {
        let end = self.records.len() / stride;
        if let (Some(part), Some(block)) = (&mut self.part, &self.block)
            && end > self.settled
        {
            let (start, count) = (self.settled as u32, (end - self.settled) as u32);
            part.segments.push(Segment { block: block.index, start, count });
        }
        self.settled = end;
    }

    fn end_part(&mut self) {
        self.parts.extend(self.part.take().filter(|p| p.points > 0));
    }

    fn close(&mut self, store: &Store) -> Result<(), ConvertError> {
        self.settled = 0;
        match self.block.take() {
            Some(block) => store.refill(block.index, &mut self.records),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
