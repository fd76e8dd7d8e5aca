//! Where bytes of sections begin and end.

use super::formulas::BATCH;
use super::header::Header;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// A section that the file is too short for.
pub(crate) fn beyond(findings: &Findings, name: &str, offset: u64, bytes: u64, file: u64) {
    let expected = format!("inside the {file} bytes of the file");
    let found = format!("bytes {offset} to {}", offset.saturating_add(bytes));
    findings.push(Finding::new(Check::Sections, name.to_owned(), expected, found));
}

/// Raw bytes of all points at `stride` bytes each.
pub(crate) fn raw_bytes(header: &Header, stride: u64) -> u64 {
    header.points.saturating_mul(stride)
}

/// First raw byte of `slot`, relative to its section, and how many there are.
pub(crate) fn slot_range(header: &Header, slot: u64, stride: u64) -> (u64, u64) {
    (slot * BATCH * stride, header.points_in(slot) * stride)
}
