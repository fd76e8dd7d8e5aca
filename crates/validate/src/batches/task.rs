//! What a pass over the batches works on.

use super::batch_records::Box32;
use super::blocks::Column;
use super::bytes::Bytes;
use super::description::Description;
use super::formulas::{BATCH, slot};
use super::header::Header;
use super::originals::Originals;
use crate::against::Sums;
use crate::finding::Findings;
use crate::options::ProgressFn;

/// What is walked, and where findings go.
pub(crate) struct Task<'a> {
    pub(crate) bytes: &'a Bytes,
    pub(crate) header: &'a Header,
    pub(crate) description: &'a Description,
    /// In slot order.
    pub(crate) boxes: &'a [Option<Box32>],
    /// Planes, colour, extra attributes.
    pub(crate) columns: &'a [&'a Column],
    /// If they can be used.
    pub(crate) originals: Option<&'a Originals>,
    /// Lattice integers of all points in Morton order, from the sources, where the planes do not determine them.
    pub(crate) known: Option<&'a [[i64; 3]]>,
    pub(crate) findings: &'a Findings,
    pub(crate) sums: Option<&'a Sums>,
    pub(crate) progress: &'a ProgressFn<'a>,
    pub(crate) memory_bytes: u64,
}

/// Where Morton batch `number` is.
pub(crate) fn slot_of(header: &Header, number: u64) -> u64 {
    if header.swapped() { slot(number, header.batches) } else { number }
}

/// Batches examined at once: two windows are in memory, and what a batch takes is known.
pub(crate) fn window_batches(task: &Task<'_>) -> u64 {
    let stored: u64 = task.columns.iter().map(|c| c.stride).sum();
    // lattice integers, positions, codes, distances, colours, flags
    let point_bytes = 2 * stored + 160;
    (task.memory_bytes / 4 / (BATCH * point_bytes)).clamp(1, 64)
}
