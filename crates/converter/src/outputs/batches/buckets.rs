//! Cuts the cloud into tasks: runs of the batches' Morton order that are small enough to be sorted in memory.
//!
//! Records are grouped by the cells of the partition, which do not lie on the grid of the batches. A cell that lies in
//! one bucket of that grid is assigned unread; others are read, and their records put back grouped by bucket. Which
//! buckets and tasks these are changes nothing in the output; it is a matter of memory and load.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::frame::{BUCKET_LEVELS, Frame, code_of};
use crate::cloud::{Cell, Cloud, JobBounds, Regrouper, Segments, position};
use crate::error::ConvertError;
use crate::runtime::Runtime;

/// Points of a piece of work while records are grouped.
const PIECE_POINTS: u64 = 1 << 20;

/// Levels by which a bucket that is too large is divided at once.
const SPLIT_LEVELS: u32 = 3;

/// At the level of buckets that is chosen, at most one point in this many is in a bucket that must be divided again.
const MOST_FIT: u64 = 16;

/// A run of the Morton order that one thread sorts and encodes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Task {
    /// Morton index of its first point.
    pub(super) first_point: u64,
    pub(super) points: u64,
    /// The bucket code at which it begins.
    pub(super) start: u64,
    pub(super) segments: Segments,
    /// Its records were put in order already, and are not in the store of the cloud ([`super::large`]).
    pub(super) is_sorted: bool,
}

impl Task {
    /// True if these can be all of a cloud with so many points: where others have cut it, nobody has looked.
    pub(super) fn can_be_of(tasks: &[Self], points: u64) -> bool {
        let mut next = 0u64;
        let follow = |task: &Self| {
            let is_next = task.first_point == next && task.points == task.segments.points();
            next = next.saturating_add(task.points);
            is_next
        };
        tasks.iter().all(follow) && next == points
    }
}

/// An aligned cube of the grid, by the Morton code of its first corner (21 bits per axis) and its level (0: all).
type Bucket = (u64, u32);
type Buckets = HashMap<Bucket, Segments>;

/// All points as tasks in Morton order, none larger than `max_points` unless its points share one Morton code of 21
/// bits per axis.
pub(super) fn tasks(
    cloud: &Cloud<'_>,
    rt: &Runtime<'_>,
    frame: &Frame,
    max_points: u64,
) -> Result<Vec<Task>, ConvertError> {
    let spans: Vec<[[u32; 3]; 2]> =
        cloud.cells.iter().map(|cell| frame.buckets_of(&cell_bounds(cell, cloud))).collect();
    let level = choose_level(&cloud.cells, &spans, max_points);
    let (mut buckets, mut pieces) = (Buckets::new(), Pieces::default());
    for (cell, [lo, hi]) in cloud.cells.iter().zip(&spans) {
        let at = |c: &[u32; 3]| c.map(|c| c >> (BUCKET_LEVELS - level));
        if at(lo) == at(hi) {
            buckets.entry((start_of(*lo, level), level)).or_default().extend(cell.segments.iter().copied());
        } else {
            pieces.add(&cell.segments, level);
        }
    }
    merge(&mut buckets, divide(cloud, rt, frame, &pieces.finish())?);
    while let Some(large) = take_large(&mut buckets, max_points) {
        let mut pieces = Pieces::default();
        for ((_, level), segments) in large {
            pieces.add(&segments, (level + SPLIT_LEVELS).min(BUCKET_LEVELS));
            pieces.close();
        }
        merge(&mut buckets, divide(cloud, rt, frame, &pieces.finish())?);
    }
    Ok(join(buckets, max_points))
}

fn start_of(bucket: [u32; 3], level: u32) -> u64 {
    code_of(bucket.map(|c| c >> (BUCKET_LEVELS - level) << (BUCKET_LEVELS - level)))
}

fn merge(buckets: &mut Buckets, more: Vec<Buckets>) {
    for (bucket, segments) in more.into_iter().flatten() {
        buckets.entry(bucket).or_default().append(segments);
    }
}

/// Takes out the buckets that hold too many points and can be divided; `None` if there are none.
fn take_large(buckets: &mut Buckets, max_points: u64) -> Option<Vec<(Bucket, Segments)>> {
    let is_large =
        |(bucket, segments): &(&Bucket, &Segments)| bucket.1 < BUCKET_LEVELS && segments.points() > max_points;
    let keys: Vec<Bucket> = buckets.iter().filter(is_large).map(|(bucket, _)| *bucket).collect();
    let large = keys.into_iter().filter_map(|key| buckets.remove_entry(&key)).collect::<Vec<_>>();
    (!large.is_empty()).then_some(large)
}

/// Small neighbours become one task.
fn join(buckets: Buckets, max_points: u64) -> Vec<Task> {
    let mut buckets: Vec<(Bucket, Segments)> = buckets.into_iter().collect();
    buckets.sort_unstable_by_key(|((start, _), _)| *start);
    let mut tasks: Vec<Task> = Vec::new();
    let mut first_point = 0;
    for ((start, _), segments) in buckets {
        let points = segments.points();
        match tasks.last_mut().filter(|t| t.points + points <= max_points) {
            Some(task) => {
                task.points += points;
                task.segments.append(segments);
            }
            None => tasks.push(Task { first_point, points, start, segments, is_sorted: false }),
        }
        first_point += points;
    }
    tasks.iter_mut().for_each(|t| t.segments.sort());
    tasks
}

/// The coarsest level at which nearly all points lie in buckets that need not be divided, while buckets are not smaller
/// than the cells that they are put together from.
fn choose_level(cells: &[Cell], spans: &[[[u32; 3]; 2]], max_points: u64) -> u32 {
    let width = spans.iter().flat_map(|[lo, hi]| (0..3).map(move |a| hi[a] - lo[a])).max().unwrap_or(0);
    let total: u64 = cells.iter().map(|c| c.points).sum();
    let finest = (u32::BITS - width.leading_zeros()).min(BUCKET_LEVELS);
    let finest = BUCKET_LEVELS - finest;
    for level in 0..finest {
        let mut points: HashMap<u64, u64> = HashMap::new();
        for (cell, [lo, hi]) in cells.iter().zip(spans) {
            let middle = std::array::from_fn(|a| lo[a] + (hi[a] - lo[a]) / 2);
            *points.entry(start_of(middle, level)).or_default() += cell.points;
        }
        let crowded: u64 = points.values().filter(|n| **n > max_points).sum();
        if crowded * MOST_FIT <= total {
            return level;
        }
    }
    finest
}

/// A box of the lattice that holds all points of a cell of the partition.
fn cell_bounds(cell: &Cell, cloud: &Cloud<'_>) -> JobBounds {
    let mut bounds = cloud.frame.cube.bounds_of(cell.key);
    for a in 0..3 {
        bounds.min[a] = bounds.min[a].max(cloud.stats.bounds.min[a]);
        bounds.max[a] = bounds.max[a].min(cloud.stats.bounds.max[a]);
    }
    bounds
}

/// Segments that are to be grouped by the buckets of a level, in pieces for the threads.
#[derive(Default)]
struct Pieces {
    done: Vec<(Segments, u32)>,
    open: (Segments, u32),
    open_points: u64,
}

impl Pieces {
    fn add(&mut self, segments: &Segments, level: u32) {
        for segment in segments {
            self.open.1 = level;
            self.open.0.push(*segment);
            self.open_points += u64::from(segment.count);
            if self.open_points >= PIECE_POINTS {
                self.close();
            }
        }
    }

    fn close(&mut self) {
        self.open_points = 0;
        if !self.open.0.is_empty() {
            self.done.push(std::mem::take(&mut self.open));
        }
    }

    fn finish(mut self) -> Vec<(Segments, u32)> {
        self.close();
        self.done
    }
}

/// Reads records and puts them back grouped by bucket.
fn divide(
    cloud: &Cloud<'_>,
    rt: &Runtime<'_>,
    frame: &Frame,
    pieces: &[(Segments, u32)],
) -> Result<Vec<Buckets>, ConvertError> {
    let divided = rt.in_parallel(
        pieces.len(),
        || (Regrouper::new(&cloud.store, cloud.frame.stride), Buckets::new()),
        |(regrouper, buckets), piece| {
            let (segments, level) = &pieces[piece];
            let code = |record: &[u8]| start_of(frame.bucket(position(record)), *level);
            regrouper.regroup(segments, code, |code, segment| {
                buckets.entry((code, *level)).or_default().push(segment);
            })
        },
        |(_, buckets)| buckets,
    );
    cloud.store.drop_spare(u64::MAX)?;
    divided
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Segment;

    fn segment(start: u32, count: u32) -> Segments {
        let mut segments = Segments::default();
        segments.push(Segment { block: 0, start, count });
        segments
    }

    #[test]
    fn neighbours_are_joined_in_order_up_to_the_size_of_a_task() {
        let mut buckets = Buckets::new();
        for (i, count) in [5, 3, 9, 1, 1].into_iter().enumerate() {
            buckets.insert((i as u64 * 8, 20), segment(100 - 20 * i as u32, count));
        }
        let tasks = join(buckets, 8);
        let found: Vec<_> = tasks.iter().map(|t| (t.first_point, t.points, t.start)).collect();
        assert_eq!(found, [(0, 8, 0), (8, 9, 16), (17, 2, 24)]);
    }

    #[test]
    fn pieces_hold_every_segment_once_and_are_of_one_level() {
        let mut pieces = Pieces::default();
        for i in 0..40 {
            pieces.add(&segment(200_000 * i, 100_000), 3);
        }
        pieces.close();
        pieces.add(&segment(9_000_000, 1), 6);
        let pieces = pieces.finish();
        assert_eq!(pieces.iter().map(|p| p.0.iter().count()).sum::<usize>(), 41);
        assert!(pieces.len() > 3 && pieces.iter().all(|p| p.0.points() < 2 * PIECE_POINTS));
        assert_eq!(pieces.last().map(|p| (p.0.iter().count(), p.1)), Some((1, 6)));
    }
}
