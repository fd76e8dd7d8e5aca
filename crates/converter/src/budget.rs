//! How the memory ceiling is shared out.

use crate::error::ConvertError;
use crate::plan::Plan;

/// The program itself, headers, tables.
const FIXED_BYTES: u64 = 40 << 20;

/// A thread's buffers beside the chunk that it builds: a piece as read and as decoded, a batch of columns, a block of
/// records, the decompressor's models, the sampler's grid.
const THREAD_BYTES: u64 = 28 << 20;

/// Larger chunks gain nothing: they leave the caches and the threads uneven.
const MAX_CHUNK_POINTS: u64 = 400_000;

/// Tasks of this size keep all threads busy to the end, and few cells are cut above them.
const MAX_TASK_POINTS: u64 = 2_000_000;

/// Chunks that may be finished before the oldest unfinished one, per thread.
const AHEAD_PER_THREAD: usize = 2;

/// What each part of a run may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    /// Records that wait in memory; more go to disk.
    pub(crate) store_bytes: u64,
    /// Points of a chunk.
    pub(crate) chunk_points: u64,
    /// Chunks in flight.
    pub(crate) window: usize,
    /// Fixed costs, all threads included.
    fixed_bytes: u64,
    bytes_per_chunk_point: u64,
    ceiling: u64,
    max_task_points: u64,
}

impl Budget {
    /// Shares out `plan.memory_bytes` for records of `stride` bytes.
    pub(crate) fn new(plan: &Plan, stride: usize) -> Result<Self, ConvertError> {
        let ceiling = plan.memory_bytes;
        let threads = plan.threads.max(1) as u64;
        let window = plan.threads.max(1) * (1 + AHEAD_PER_THREAD);
        let fixed_bytes = FIXED_BYTES + threads * THREAD_BYTES;
        // Allocators keep some of what is freed.
        let usable = ceiling - ceiling / 10;
        let bytes_per_chunk_point = bytes_per_chunk_point(stride, window as u64, threads);
        let least_chunk = u64::from(plan.leaf_capacity).max(20_000);
        let least = fixed_bytes + threads * least_chunk * bytes_per_chunk_point + (8 << 20);
        if usable < least {
            return Err(ConvertError::Memory {
                ceiling,
                needed: least + least / 9 + 1,
                why: format!("working threads: {threads}, points of a leaf: up to {}", plan.leaf_capacity),
            });
        }
        let free = usable - fixed_bytes;
        let chunk_points =
            (free / 2 / threads / bytes_per_chunk_point).clamp(least_chunk, MAX_CHUNK_POINTS.max(least_chunk));
        let max_task_points = plan.task_points.unwrap_or(MAX_TASK_POINTS).max(1);
        let store_bytes = free - threads * chunk_points * bytes_per_chunk_point;
        Ok(Self { store_bytes, chunk_points, window, fixed_bytes, bytes_per_chunk_point, ceiling, max_task_points })
    }

    /// Points that a thread may hold at once, at `bytes_per_point` each: its share of the memory, whatever an octree's
    /// chunk would take.
    pub(crate) fn points_of_a_task(&self, bytes_per_point: u64) -> u64 {
        (self.chunk_points * self.bytes_per_chunk_point / bytes_per_point).min(self.max_task_points)
    }

    /// Refuses points of one place, which cannot be divided, if they do not fit.
    pub(crate) fn check_one_place(&self, points: u64, bytes_per_point: u64) -> Result<(), ConvertError> {
        let needed = self.fixed_bytes + points.saturating_mul(bytes_per_point);
        if points > self.points_of_a_task(bytes_per_point) && needed > self.ceiling {
            let why = format!("{points} points share one place and must be put in order together");
            return Err(ConvertError::Memory { ceiling: self.ceiling, needed, why });
        }
        Ok(())
    }

    /// Refuses a chunk that cannot be divided and does not fit.
    pub(crate) fn check_chunk(&self, points: u64) -> Result<(), ConvertError> {
        let needed = self.fixed_bytes + points.saturating_mul(self.bytes_per_chunk_point);
        if points > self.chunk_points && needed > self.ceiling {
            let why = format!("{points} points share one place and must be written as one node");
            return Err(ConvertError::Memory { ceiling: self.ceiling, needed, why });
        }
        Ok(())
    }

    /// Points of a task with so many bytes a point: what chunks may use, for them.
    pub(crate) fn task_points(&self, bytes_per_point: u64) -> u64 {
        (self.chunk_points * self.bytes_per_chunk_point / bytes_per_point).min(MAX_CHUNK_POINTS)
    }

    /// Refuses a task that is larger than others because it cannot be divided, and does not fit.
    pub(crate) fn check_task(&self, points: u64, usual_points: u64, bytes_per_point: u64) -> Result<(), ConvertError> {
        let needed = self.fixed_bytes + points.saturating_mul(bytes_per_point);
        if points > usual_points && needed > self.ceiling {
            let why = format!("{points} points share one cell of the order and must be sorted together");
            return Err(ConvertError::Memory { ceiling: self.ceiling, needed, why });
        }
        Ok(())
    }

    /// Highest resident set of a run over `points` points of `stride` bytes, estimated.
    pub(crate) fn estimate_peak(&self, points: u64, stride: usize) -> u64 {
        let data = points.saturating_mul(stride as u64);
        let chunks = (self.ceiling - self.fixed_bytes - self.store_bytes).min(points * self.bytes_per_chunk_point);
        self.fixed_bytes + data.min(self.store_bytes) + chunks
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
                let b = Budget::new(&plan, 38).unwrap();
                let used = b.fixed_bytes + b.store_bytes + threads as u64 * b.chunk_points * b.bytes_per_chunk_point;
                assert!(used <= plan.memory_bytes && b.chunk_points >= 10_000);
            }
        }
        let mut plan = Plan::new(vec![], "out".into());
        plan.memory_bytes = 50 << 20;
        assert!(matches!(Budget::new(&plan, 38), Err(ConvertError::Memory { .. })));
    }
}
