//! How the memory ceiling is shared out.

use crate::error::{ConvertError, MemoryNeed};
use crate::plan::Plan;

/// The program itself, headers, tables.
const FIXED_BYTES: u64 = 40 << 20;

/// A thread's buffers beside the chunk that it builds: a piece as read and as decoded, a batch of columns, a block of
/// records, the decompressor's models, the sampler's grid.
const THREAD_BYTES: u64 = 28 << 20;

/// Larger chunks gain nothing: they leave the caches and the threads uneven.
pub(crate) const MAX_CHUNK_POINTS: u64 = 400_000;

/// Chunks that may be finished before the oldest unfinished one, per thread.
const AHEAD_PER_THREAD: usize = 2;

/// The minimum that the outputs need.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Least {
    /// Points that must be in memory together.
    points: u64,
}

impl Least {
    /// Of outputs that need as many points together.
    pub(crate) fn of(points: impl IntoIterator<Item = u64>) -> Self {
        Self { points: points.into_iter().fold(10_000, u64::max) }
    }
}

/// What each part of a run may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    /// For what grows with the points: records first of all, which go to the disk when others need it.
    pub(crate) pool_bytes: u64,
    /// Points of a chunk.
    pub(crate) chunk_points: u64,
    /// Chunks in flight.
    pub(crate) window: usize,
    /// Fixed costs, all threads included.
    fixed_bytes: u64,
    bytes_per_chunk_point: u64,
    ceiling: u64,
    /// For tests.
    asked_task_points: Option<u64>,
}

impl Budget {
    /// Shares out `plan.memory_bytes` for records of `stride` bytes.
    pub(crate) fn new(plan: &Plan, stride: usize, least: Least) -> Result<Self, ConvertError> {
        let ceiling = plan.memory_bytes;
        let threads = plan.threads.max(1) as u64;
        let window = plan.threads.max(1) * (1 + AHEAD_PER_THREAD);
        let fixed_bytes = FIXED_BYTES + threads * THREAD_BYTES;
        // Allocators keep some of what is freed.
        let usable = ceiling - ceiling / 10;
        let bytes_per_chunk_point = bytes_per_chunk_point(stride, window as u64, threads);
        let least_chunk = least.points.max(20_000);
        let least_bytes = fixed_bytes + threads * least_chunk * bytes_per_chunk_point + (8 << 20);
        if usable < least_bytes {
            return Err(ConvertError::Memory {
                ceiling,
                needed: least_bytes + least_bytes / 9 + 1,
                why: MemoryNeed::Threads { threads, points: least_chunk },
            });
        }
        let free = usable - fixed_bytes;
        let chunk_points =
            (free / 2 / threads / bytes_per_chunk_point).clamp(least_chunk, MAX_CHUNK_POINTS.max(least_chunk));
        let pool_bytes = free - threads * chunk_points * bytes_per_chunk_point;
        Ok(Self {
            pool_bytes,
            chunk_points,
            window,
            fixed_bytes,
            bytes_per_chunk_point,
            ceiling,
            asked_task_points: plan.task_points,
        })
    }

    /// Points of a unit of work that takes `bytes_per_point`: what a chunk may use, at most `at_most`.
    pub(crate) fn task_points(&self, bytes_per_point: u64, at_most: u64) -> u64 {
        let at_most = self.asked_task_points.unwrap_or(at_most).max(1);
        (self.chunk_points * self.bytes_per_chunk_point / bytes_per_point).min(at_most)
    }

    /// Highest resident set of a run over `points` points of `stride` bytes, estimated.
    pub(crate) fn estimate_peak(&self, points: u64, stride: usize) -> u64 {
        let data = points.saturating_mul(stride as u64);
        let chunks = (self.ceiling - self.fixed_bytes - self.pool_bytes).min(points * self.bytes_per_chunk_point);
        self.fixed_bytes + data.min(self.pool_bytes) + chunks
    }
}

/// A chunk's records, tree coordinates, keys twice, points and lists; and its share of finished payloads in flight.
fn bytes_per_chunk_point(stride: usize, window: u64, threads: u64) -> u64 {
    let stride = stride as u64;
    stride + 12 + 16 + 16 + 8 + stride * (window / threads + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_stay_below_the_ceiling_and_tiny_ceilings_are_refused() {
        for mib in [256u64, 512, 1024, 8192, 65_536] {
            for threads in [1, 2, 4] {
                let mut plan = Plan::new(vec![], "out".into());
                plan.memory_bytes = mib << 20;
                plan.threads = threads;
                let b = Budget::new(&plan, 38, Least::of([])).unwrap();
                let used = b.fixed_bytes + b.pool_bytes + threads as u64 * b.chunk_points * b.bytes_per_chunk_point;
                assert!(used <= plan.memory_bytes && b.chunk_points >= 10_000);
            }
        }
        let mut plan = Plan::new(vec![], "out".into());
        plan.memory_bytes = 50 << 20;
        assert!(matches!(Budget::new(&plan, 38, Least::of([])), Err(ConvertError::Memory { .. })));
    }
}
