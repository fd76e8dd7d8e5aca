//! Tasks that are larger than others because their points share one code of the buckets: put in order on the disk, and cut
//! into tasks of the usual size. Cells and batches that go on in the next task are put together as always.

use super::buckets::Task;
use super::content::Content;
use super::frame::Frame;
use super::order::compare;
use crate::cloud::{BigSort, Cloud, Segment, Segments, Store};
use crate::error::ConvertError;
use crate::runtime::Runtime;

/// Bytes of the colour word behind a record that was put in order.
pub(super) const WORD_BYTES: usize = 4;

/// Records that are loaded together, and those of the tasks that are made.
const PIECE_POINTS: u32 = 1 << 16;

/// A record that was put in order, and its colour word.
pub(super) fn split(entry: &[u8]) -> (&[u8], u32) {
    match entry.split_last_chunk::<WORD_BYTES>() {
        Some((record, word)) => (record, u32::from_le_bytes(*word)),
        None => (entry, 0),
    }
}

/// Cuts tasks of more than `max_points`. Their records, each with its colour word behind it, go into `sorted`.
pub(super) fn cut(
    tasks: Vec<Task>,
    cloud: &Cloud<'_>,
    rt: &Runtime<'_>,
    (frame, content): (&Frame, &Content),
    sorted: &Store,
    max_points: u64,
) -> Result<Vec<Task>, ConvertError> {
    let mut all = Vec::with_capacity(tasks.len());
    for task in tasks {
        if task.points <= max_points {
            all.push(task);
            continue;
        }
        let stride = cloud.frame.stride;
        let order = |a: &[u8], b: &[u8]| compare(frame, &content.extras, split(a), split(b));
        let mut sort = BigSort::new(rt, stride + WORD_BYTES, rt.budget.chunk_bytes(), order);
        let (mut loaded, mut words) = (Vec::new(), Vec::new());
        let pieces: Vec<Segment> = task.segments.iter().flat_map(|s| s.split(PIECE_POINTS)).collect();
        sort.fill(&pieces, |segment, entries| {
            loaded.clear();
            words.clear();
            let source = cloud.store.take(segment, &mut loaded)?;
            content.words(&loaded, stride, source, &mut words);
            for (record, word) in loaded.chunks_exact(stride).zip(&words) {
                entries.extend_from_slice(record);
                entries.extend_from_slice(&word.to_le_bytes());
            }
            Ok(())
        })?;
        let (mut block, mut first_point) = (Vec::new(), task.first_point);
        let mut put = |block: &mut Vec<u8>| -> Result<(), ConvertError> {
            let points = (block.len() / (stride + WORD_BYTES)) as u64;
            let mut segments = Segments::default();
            segments.push(Segment { block: sorted.open(0)?, start: 0, count: points as u32 });
            segments.iter().try_for_each(|segment| sorted.fill(segment.block, block))?;
            all.push(Task { first_point, points, start: task.start, segments, is_sorted: true });
            first_point += points;
            Ok(())
        };
        sort.finish(|entry| {
            block.extend_from_slice(entry);
            let is_full = block.len() as u64 >= max_points.min(u64::from(PIECE_POINTS)) * entry.len() as u64;
            if is_full { put(&mut block) } else { Ok(()) }
        })?;
        if !block.is_empty() {
            put(&mut block)?;
        }
    }
    Ok(all)
}
