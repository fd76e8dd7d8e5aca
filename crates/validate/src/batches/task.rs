//! What a pass over the batches works on.

use pointmill_format::ReadError;

use super::batch_records::Box32;
use super::blocks::Column;
use super::bytes::Bytes;
use super::description::Description;
use super::formulas::{BATCH, slot};
use super::header::Header;
use super::originals::Originals;
use crate::against::Sums;
use crate::finding::Findings;
use crate::memory::Budget;
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
    /// Batches that are examined at once.
    pub(crate) window: u64,
}

/// Where Morton batch `number` is.
pub(crate) fn slot_of(header: &Header, number: u64) -> u64 {
    if header.swapped() { slot(number, header.batches) } else { number }
}

/// What a batch takes in tables: its box, its originals, its record as it is read.
pub(crate) const BATCH_BYTES: u64 = 24 + 8 + 32;

/// Batches examined at once.
///
/// # Errors
/// Not even one fits what is left.
pub(crate) fn window(header: &Header, columns: &[&Column], budget: &Budget) -> Result<u64, ReadError> {
    let most = budget.left() / 4 * 3;
    let fits = |batches: &u64| window_bytes(header, columns, *batches) <= most;
    let window = [64, 32, 16, 8, 4, 2].into_iter().find(fits).unwrap_or(1);
    budget.require(window_bytes(header, columns, window))?;
    Ok(window)
}

/// What that many batches take while they are examined: two windows are in memory, and the blocks of one and of what
/// comes next, at both ends of the file as slots are exchanged.
pub(crate) fn window_bytes(header: &Header, columns: &[&Column], batches: u64) -> u64 {
    let batches = batches.min(header.batches);
    let stored: u64 = columns.iter().map(|c| c.stride).sum();
    // lattice integers, positions, codes, distances, colours, flags
    let point_bytes = 2 * stored + 160;
    let blocks = columns.iter().map(|c| c.batches_decompressed_for(batches).min(header.batches) * BATCH * c.stride);
    2 * batches * BATCH * point_bytes + blocks.sum::<u64>()
}
