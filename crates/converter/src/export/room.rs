//! How the memory ceiling is shared out: nothing of an export grows with the number of points but lists of chunks.

use crate::error::{ConvertError, MemoryNeed};
use crate::plan::{ExportFormat, Plan};
use crate::runtime::WRITER_BYTES;

/// The program itself, its tables and stacks.
const FIXED_BYTES: u64 = 28 << 20;

/// What a thread has beside what its reader takes: columns of a slice, tables of an encoder.
const THREAD_BYTES: u64 = 8 << 20;

/// Points that are encoded together, a chunk of LAZ: no more than this, nor than so many bytes hold.
const PART_POINTS: u64 = 50_000;
const PART_BYTES: u64 = 16 << 20;

/// Parts that a unit keeps at most while those before it are not written.
const MOST_KEPT: u64 = 4;

/// What each part of a run may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Room {
    /// Points that are encoded together: whatever the ceiling is, or it would change the bytes of a file.
    pub(super) part_points: usize,
    /// Parts that a unit keeps while those before it are not written.
    pub(super) parts_kept: usize,
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
        let points = (PART_BYTES / row_bytes.max(1)).clamp(1, PART_POINTS);
        let fixed = FIXED_BYTES + WRITER_BYTES + input_bytes + threads * (THREAD_BYTES + decode_bytes);
        // the rows of a thread, and what they are becoming in two forms
        let of_threads = threads * points * (row_bytes + 2 * encoded);
        let needs = |window: u64, kept: u64| fixed + of_threads + window * kept * points * encoded;
        let usable = plan.memory_bytes - plan.memory_bytes / 10;
        for (window, kept) in [(3 * threads, MOST_KEPT), (2 * threads, MOST_KEPT), (threads, 2), (threads, 1)] {
            if needs(window, kept) <= usable {
                return Ok(Self { part_points: points as usize, parts_kept: kept as usize, window: window as usize });
            }
        }
        let needed = (needs(threads, 1).saturating_mul(10).div_ceil(9) + 1).next_multiple_of(1 << 20);
        let why = if input_bytes > needed / 2 {
            MemoryNeed::Inputs { bytes: input_bytes }
        } else {
            MemoryNeed::Threads { threads, points }
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
            assert_eq!(room(&plan).unwrap(), Room { part_points: 50_000, parts_kept: 1, window: threads });
            plan.memory_bytes = 64 << 30;
            assert_eq!(room(&plan).unwrap(), Room { part_points: 50_000, parts_kept: 4, window: 3 * threads });
        }
    }
}
