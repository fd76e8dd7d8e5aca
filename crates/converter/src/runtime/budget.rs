//! How the memory ceiling is shared out.

use super::direct::WRITER_BYTES;
use super::pool::{Consumer, Pool, Reservation};
use crate::error::{ConvertError, MemoryNeed};
use crate::plan::Plan;

/// The program itself, its tables and stacks.
const FIXED_BYTES: u64 = 28 << 20;

/// What a reading thread has beside what its reader takes: a block of records, columns of lattice integers, lists by which
/// points are grouped.
const GATHER_BYTES: u64 = 20 << 20;

/// Records that a reading thread puts together, in memory of its own, before it moves them to their places.
pub(crate) const TILE_POINTS: usize = 512;

/// What a building thread has beside the chunk that it builds: the sampler's grid and candidates, records of a node and of a
/// part of one, buffers of encoders.
const BUILD_BYTES: u64 = 10 << 20;

/// Less than this in the pool is not worth beginning.
const LEAST_POOL_BYTES: u64 = 32 << 20;

/// Larger chunks gain nothing: they leave the caches and the threads uneven.
pub(crate) const MAX_CHUNK_POINTS: u64 = 400_000;

/// Chunks that may be finished before the oldest unfinished one, per thread.
const AHEAD_PER_THREAD: usize = 2;

/// The minimum that the inputs and outputs need.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Least {
    /// Points that must be in memory together.
    points: u64,
    /// Bytes of output that a building thread must have in memory together, beside twenty thousand points.
    unit_bytes: u64,
    /// Outputs that are built together: each has its own bytes of a point.
    streams: u64,
    /// Bytes that decoding takes at most, on one thread.
    decode_bytes: u64,
    /// Bytes that all inputs take as long as the run goes on.
    input_bytes: u64,
}

impl Least {
    /// Of outputs that need as many points together.
    pub(crate) fn of(points: impl IntoIterator<Item = u64>, decode_bytes: u64, input_bytes: u64) -> Self {
        Self { points: points.into_iter().fold(10_000, u64::max), unit_bytes: 0, streams: 1, decode_bytes, input_bytes }
    }

    /// The same, where a thread puts as many bytes of output together.
    pub(crate) fn with_units(self, unit_bytes: impl IntoIterator<Item = u64>) -> Self {
        Self { unit_bytes: unit_bytes.into_iter().fold(self.unit_bytes, u64::max), ..self }
    }

    /// The same, where so many outputs are built together.
    pub(crate) fn with_streams(self, streams: u64) -> Self {
        Self { streams: streams.max(1), ..self }
    }
}

/// What each part of a run may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    /// For all that is not there from the beginning to the end; records go to the disk when others need it.
    pub(crate) pool_bytes: u64,
    /// Points of a chunk.
    pub(crate) chunk_points: u64,
    /// Chunks in flight.
    pub(crate) window: usize,
    /// The least ceiling with which the run can begin.
    pub(crate) least_ceiling: u64,
    threads: u64,
    /// Of a thread that reads.
    reader_bytes: u64,
    bytes_per_chunk_point: u64,
    fixed_bytes: u64,
    /// The least points of a chunk.
    least_points: u64,
    /// Outputs that are built together.
    streams: u64,
    /// For tests.
    asked_task_points: Option<u64>,
}

impl Budget {
    /// Shares out `plan.memory_bytes` for records of `stride` bytes.
    pub(crate) fn new(plan: &Plan, stride: usize, least: Least) -> Result<Self, ConvertError> {
        let ceiling = plan.memory_bytes;
        let threads = plan.threads.max(1) as u64;
        let window = plan.threads.max(1) * (1 + AHEAD_PER_THREAD);
        let fixed_bytes = FIXED_BYTES + least.streams * WRITER_BYTES + least.input_bytes;
        let reader_bytes = GATHER_BYTES + (TILE_POINTS * stride) as u64 + least.decode_bytes;
        // Allocators keep some of what is freed.
        let usable = ceiling - ceiling / 10;
        let bytes_per_chunk_point = bytes_per_chunk_point(stride, window as u64, threads, least.streams);
        let of_unit = least.unit_bytes + least.points.max(20_000) * chunk_point_in_unit(stride);
        let least_chunk = least.points.max(20_000).max(of_unit.div_ceil(bytes_per_chunk_point));
        let least_build = BUILD_BYTES + least_chunk.saturating_mul(bytes_per_chunk_point);
        let of_threads = threads.saturating_mul(reader_bytes.max(least_build));
        let least_bytes = fixed_bytes.saturating_add(of_threads).saturating_add(LEAST_POOL_BYTES);
        let least_ceiling = (least_bytes.saturating_mul(10).div_ceil(9) + 1).next_multiple_of(1 << 20);
        if ceiling < least_ceiling {
            let why = if least.input_bytes > of_threads {
                MemoryNeed::Inputs { bytes: least.input_bytes }
            } else {
                MemoryNeed::Threads { threads, points: least_chunk }
            };
            return Err(ConvertError::Memory { ceiling, needed: least_ceiling, why });
        }
        let pool_bytes = usable - fixed_bytes;
        let share = (pool_bytes / 2 / threads).saturating_sub(BUILD_BYTES);
        let chunk_points = (share / bytes_per_chunk_point).clamp(least_chunk, MAX_CHUNK_POINTS.max(least_chunk));
        Ok(Self {
            pool_bytes,
            chunk_points,
            window,
            least_ceiling,
            threads,
            reader_bytes,
            bytes_per_chunk_point,
            fixed_bytes,
            least_points: least.points,
            streams: least.streams,
            asked_task_points: plan.task_points,
        })
    }

    /// Takes what the threads need while they read.
    pub(crate) fn reading(&self, memory: &std::sync::Arc<Pool>) -> Result<Reservation, ConvertError> {
        let mut reservation = Reservation::new(memory, Consumer::Threads);
        reservation.resize(self.threads * self.reader_bytes)?;
        Ok(reservation)
    }

    /// Takes what the threads need while they build an output of so many points.
    pub(crate) fn building(&self, memory: &std::sync::Arc<Pool>, points: u64) -> Result<Reservation, ConvertError> {
        let mut reservation = Reservation::new(memory, Consumer::Threads);
        reservation.resize(self.build_bytes(points))?;
        Ok(reservation)
    }

    fn build_bytes(&self, points: u64) -> u64 {
        let chunks = (self.threads * self.chunk_points).min(points);
        self.threads * BUILD_BYTES + chunks * self.bytes_per_chunk_point
    }

    /// How a thread builds units of at most `unit_points` whose output it puts together: points of the chunks that it has in
    /// memory at a time, and how many units may be in flight.
    pub(crate) fn units(&self, unit_points: u64, stride: usize) -> (u64, usize) {
        if self.chunk_points >= unit_points {
            return (unit_points, self.window);
        }
        let output = self.streams * unit_points * stride as u64;
        let points = self.chunk_bytes().saturating_sub(output) / chunk_point_in_unit(stride);
        (points.max(self.least_points), self.threads as usize)
    }

    /// Bytes of a thread for the unit of work that it builds.
    pub(crate) fn chunk_bytes(&self) -> u64 {
        self.chunk_points * self.bytes_per_chunk_point
    }

    /// Points of a unit of work that takes `bytes_per_point`: what a chunk may use, at most `at_most`.
    pub(crate) fn task_points(&self, bytes_per_point: u64, at_most: u64) -> u64 {
        let at_most = self.asked_task_points.unwrap_or(at_most).max(1);
        (self.chunk_points * self.bytes_per_chunk_point / bytes_per_point).min(at_most)
    }

    /// Bytes of records that can stay in memory while they are read and built.
    pub(crate) fn record_bytes(&self, points: u64) -> u64 {
        self.pool_bytes.saturating_sub(self.build_bytes(points).max(self.threads * self.reader_bytes))
    }

    /// Highest resident set of a run over `points` points of `stride` bytes, estimated.
    pub(crate) fn estimate_peak(&self, points: u64, stride: usize) -> u64 {
        let data = points.saturating_mul(stride as u64).min(self.record_bytes(points));
        self.fixed_bytes + data + self.build_bytes(points).max(self.threads * self.reader_bytes)
    }
}

/// A chunk's records, tree coordinates, keys twice, points and lists; and its share of finished payloads in flight.
fn bytes_per_chunk_point(stride: usize, window: u64, threads: u64, streams: u64) -> u64 {
    let stride = stride as u64;
    stride + 12 + 16 + 16 + 8 + streams * stride * (window / threads + 1)
}

/// The same of a chunk whose payloads are part of a larger unit: records, tree coordinates, keys twice, points and lists;
/// and copies of what the nodes above take.
fn chunk_point_in_unit(stride: usize) -> u64 {
    2 * stride as u64 + 12 + 16 + 16 + 8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(mib: u64, threads: usize) -> Plan {
        let mut plan = Plan::new(vec![], "out".into());
        (plan.memory_bytes, plan.threads) = (mib << 20, threads);
        plan
    }

    #[test]
    fn the_parts_stay_below_the_ceiling() {
        let least = Least::of([], 8 << 20, 1 << 20);
        for mib in [256u64, 512, 1024, 8192, 65_536] {
            for threads in [1, 2, 4] {
                let b = Budget::new(&plan(mib, threads), 38, least).unwrap();
                let used = b.fixed_bytes + b.pool_bytes;
                assert!(used <= mib << 20 && b.chunk_points >= 10_000);
                assert!(b.build_bytes(u64::MAX) <= b.pool_bytes && b.threads * b.reader_bytes < b.pool_bytes);
                assert!(b.estimate_peak(1 << 40, 38) <= mib << 20);
            }
        }
    }

    #[test]
    fn a_ceiling_that_is_too_small_is_refused_and_the_one_named_instead_is_enough() {
        for (threads, decode_bytes, input_bytes) in [(1, 0, 0), (2, 8 << 20, 0), (64, 1 << 20, 0), (1, 0, 500 << 20)] {
            let least = Least::of([50_000], decode_bytes, input_bytes);
            let Err(ConvertError::Memory { needed, .. }) = Budget::new(&plan(50, threads), 38, least) else {
                panic!("50 MiB are enough for {threads} threads?")
            };
            let enough = Budget::new(&plan(needed >> 20, threads), 38, least).unwrap();
            assert_eq!(enough.least_ceiling, needed);
            assert!(enough.build_bytes(u64::MAX) + LEAST_POOL_BYTES / 2 <= enough.pool_bytes);
            assert!(Budget::new(&plan((needed >> 20) - 1, threads), 38, least).is_err());
        }
    }
    #[test]
    fn a_thread_that_reads_wide_records_takes_more() {
        let taken = |stride| {
            let budget = Budget::new(&plan(8192, 2), stride, Least::of([], 3 << 20, 0)).unwrap();
            let memory = std::sync::Arc::new(Pool::new(budget.pool_bytes, 8192 << 20));
            let reading = budget.reading(&memory).unwrap();
            assert_eq!(memory.free(), budget.pool_bytes - reading.bytes());
            reading.bytes()
        };
        assert_eq!(taken(38), 2 * (GATHER_BYTES + (3 << 20) + 512 * 38));
        assert_eq!(taken(5000) - taken(38), 2 * 512 * (5000 - 38));
    }
}
