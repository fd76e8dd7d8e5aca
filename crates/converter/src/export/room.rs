//! How the memory ceiling is shared out: nothing of an export grows with the number of points but lists of chunks.

use crate::error::{ConvertError, MemoryNeed};
use crate::plan::{ExportFormat, Plan};

use super::pass::PARTS_KEPT;

/// The program itself, its tables and stacks.
const FIXED_BYTES: u64 = 32 << 20;

/// What a thread has beside what its reader takes: columns of a slice, tables of an encoder.
const THREAD_BYTES: u64 = 8 << 20;

/// Points that are encoded together: a chunk of LAZ.
const PART_POINTS: u64 = 50_000;

/// Fewer make poor chunks.
const LEAST_POINTS: u64 = 5_000;

/// What each part of a run may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Room {
    /// Points that are encoded together.
    pub(super) part_points: usize,
    /// Units in flight.
    pub(super) window: usize,
}

impl Room {
    /// `row_bytes`: of a point in memory; `decode_bytes`: of a reader on one thread; `input_bytes`: of all inputs, as long as
    /// the run goes on.
    pub(super) fn new(
        plan: &Plan,
        format: ExportFormat,
        row_bytes: u64,
        decode_bytes: u64,
        input_bytes: u64,
    ) -> Result<Self, ConvertError> {
        let threads = plan.threads.max(1) as u64;
        // text of a value is up to three times as long
        let encoded = if format == ExportFormat::Csv { 3 * row_bytes + 60 } else { row_bytes + 40 };
        let of_part = |points: u64| points * (row_bytes + 2 * encoded);
        let of_window = |points: u64, window: u64| window * PARTS_KEPT as u64 * points * encoded;
        let fixed = FIXED_BYTES + input_bytes + threads * (THREAD_BYTES + decode_bytes);
        let needs = |points: u64, window: u64| fixed + threads * of_part(points) + of_window(points, window);
        let usable = plan.memory_bytes - plan.memory_bytes / 10;
        for points in [PART_POINTS, 20_000, LEAST_POINTS] {
            for window in [3 * threads, 2 * threads, threads] {
                if needs(points, window) <= usable {
                    return Ok(Self { part_points: points as usize, window: window as usize });
                }
            }
        }
        let needed = (needs(LEAST_POINTS, threads).saturating_mul(10).div_ceil(9) + 1).next_multiple_of(1 << 20);
        let why = if input_bytes > needed / 2 {
            MemoryNeed::Inputs { bytes: input_bytes }
        } else {
            MemoryNeed::Threads { threads, points: LEAST_POINTS }
        };
        Err(ConvertError::Memory { ceiling: plan.memory_bytes, needed, why })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ceiling_that_is_too_small_is_refused_and_the_one_named_instead_is_enough() {
        for threads in [1, 2, 64] {
            let mut plan = Plan::new(vec![], "a.las".into());
            (plan.threads, plan.memory_bytes) = (threads, 1 << 20);
            let room = |plan: &Plan| Room::new(plan, ExportFormat::Laz, 50, 6 << 20, 1 << 20);
            let Err(ConvertError::Memory { needed, .. }) = room(&plan) else { panic!() };
            plan.memory_bytes = needed;
            assert_eq!(room(&plan).unwrap(), Room { part_points: 5000, window: threads });
            plan.memory_bytes = 64 << 30;
            assert_eq!(room(&plan).unwrap(), Room { part_points: 50_000, window: 3 * threads });
        }
    }
}
