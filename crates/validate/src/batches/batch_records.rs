//! The batch records (§6.1).

use pointmill_format::ReadError;
use serde_json::json;

use super::bytes::{Bytes, u32_at};
use super::formulas::BATCH;
use super::header::Header;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// The box of a slot, relative to the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Box32 {
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
}

impl Box32 {
    /// m of an axis.
    pub(crate) fn min(&self, axis: usize) -> f64 {
        f64::from(self.min[axis])
    }

    /// s of an axis.
    pub(crate) fn side(&self, axis: usize) -> f64 {
        f64::from(self.max[axis]) - f64::from(self.min[axis])
    }

    /// What rounding may add to the error of a decoded coordinate: M · 2^−51 (§5).
    pub(crate) fn rounding(&self, axis: usize) -> f64 {
        f64::from(self.max[axis]) / (1u64 << 51) as f64
    }
}

/// The boxes in slot order; `None` for one that no position can be decoded against.
///
/// # Errors
/// The operating system cannot read the file.
pub(crate) fn read(bytes: &Bytes, header: &Header, findings: &Findings) -> Result<Vec<Option<Box32>>, ReadError> {
    const STEP: u64 = 1 << 15;
    findings.checked(Check::BatchRecords, header.batches);
    let mut boxes = Vec::new();
    let mut raw = Vec::new();
    while (boxes.len() as u64) < header.batches {
        let done = boxes.len() as u64;
        let n = (header.batches - done).min(STEP);
        bytes.read(header.batches_at + 32 * done, 32 * n, &mut raw)?;
        boxes.extend(raw.chunks_exact(32).zip(done..).map(|(record, slot)| check(record, slot, header, findings)));
    }
    Ok(boxes)
}

fn check(record: &[u8], slot: u64, header: &Header, findings: &Findings) -> Option<Box32> {
    let fault = |what: &str, expected, found| {
        findings.push(Finding::new(Check::BatchRecords, format!("{what} of slot {slot}"), expected, found));
    };
    let (first, count) = (u32_at(record, 12), u32_at(record, 28));
    if u64::from(first) != BATCH * slot {
        fault("first point", json!(BATCH * slot), json!(first));
    }
    if u64::from(count) != header.points_in(slot) {
        fault("points", json!(header.points_in(slot)), json!(count));
    }
    let corner = |at: usize| [0, 1, 2].map(|axis| f32::from_bits(u32_at(record, at + 4 * axis)));
    let bounds = Box32 { min: corner(0), max: corner(16) };
    let sane = |a: usize| bounds.min[a].is_finite() && bounds.max[a].is_finite() && bounds.min[a] <= bounds.max[a];
    if (0..3).all(sane) {
        return Some(bounds);
    }
    let found = format!("{:?} to {:?}", bounds.min, bounds.max);
    fault("box", json!("finite, min at most max"), json!(found));
    None
}
