//! The header (§1.2): its fields, and whether they are possible and agree with each other.

use pointmill_format::ReadError;
use serde_json::json;

use super::bytes::{Bytes, u32_at, u64_at, vector_at};
use super::formulas::{BATCH, power};
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Bytes of the header.
pub(crate) const HEADER_BYTES: u64 = 256;

/// The fields, as they stand in the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Header {
    /// N.
    pub(crate) points: u64,
    /// B, from N; the value in the file is compared with it.
    pub(crate) batches: u64,
    pub(crate) origin: [f64; 3],
    pub(crate) min: [f64; 3],
    pub(crate) max: [f64; 3],
    pub(crate) cell: f64,
    flags: u32,
    morton_bits: u32,
    pub(crate) batches_at: u64,
    /// hi10, mid10, lo10; 0 if absent.
    pub(crate) planes_at: [u64; 3],
    pub(crate) colour_at: u64,
    pub(crate) originals_at: u64,
    pub(crate) description_at: u64,
    pub(crate) description_bytes: u64,
    exponent: u32,
}

impl Header {
    /// Slots are swapped.
    pub(crate) fn swapped(&self) -> bool {
        self.flags & 1 != 0
    }
    /// The top byte of colour words is a level of detail.
    pub(crate) fn levels(&self) -> bool {
        self.flags & 2 != 0
    }
    /// Points with a level below 3 show the mean of their cell.
    pub(crate) fn averaged(&self) -> bool {
        self.flags & 4 != 0
    }
    /// There are originals.
    pub(crate) fn originals(&self) -> bool {
        self.flags & 8 != 0 && self.originals_at != 0
    }
    /// Sections are compressed.
    pub(crate) fn compressed(&self) -> bool {
        self.flags & 16 != 0
    }
    /// Planes that are there, 1 to 3.
    pub(crate) fn planes(&self) -> usize {
        if self.planes_at[1] == 0 { 1 } else { 2 + usize::from(self.planes_at[2] != 0) }
    }
    /// Bits of q that are there.
    pub(crate) fn bits(&self) -> u32 {
        10 * self.planes() as u32
    }
    /// e: from the file, or from the extent if that of the file is impossible; at most 30.
    pub(crate) fn exponent(&self) -> i32 {
        self.exponent as i32
    }
    /// n, as e makes it.
    pub(crate) fn morton_bits(&self) -> i32 {
        if self.exponent <= 19 { 21 } else { 32 }
    }
    /// Points in `slot`.
    pub(crate) fn points_in(&self, slot: u64) -> u64 {
        (self.points - (BATCH * slot).min(self.points)).min(BATCH)
    }
}

/// Reads the header and checks it; `None` if nothing behind it can be made sense of.
///
/// # Errors
/// The operating system cannot read the file.
pub(crate) fn read(bytes: &Bytes, findings: &Findings) -> Result<Option<Header>, ReadError> {
    findings.checked(Check::Header, 1);
    if bytes.len < HEADER_BYTES {
        fault(findings, "length of the file", format!("at least {HEADER_BYTES} bytes"), bytes.len);
        return Ok(None);
    }
    let mut raw = Vec::new();
    bytes.read(0, HEADER_BYTES, &mut raw)?;
    let word = |at| u32_at(&raw, at);
    let mut sane = true;
    if raw[..8] != *b"QBATCHES" {
        fault(findings, "magic", "QBATCHES", String::from_utf8_lossy(&raw[..8]).into_owned());
        sane = false;
    }
    for (at, name, expected) in [(8, "version", 1), (12, "header size", 256), (24, "batch size", BATCH as u32)] {
        if word(at) != expected {
            fault(findings, name, expected, word(at));
            sane = false;
        }
    }
    let points = u64_at(&raw, 16);
    if points > u64::from(u32::MAX) {
        fault(findings, "points", "at most 4294967295", points);
        sane = false;
    }
    if !sane {
        return Ok(None);
    }
    let mut header = Header {
        points,
        batches: points.div_ceil(BATCH),
        origin: vector_at(&raw, 32),
        min: vector_at(&raw, 56),
        max: vector_at(&raw, 80),
        cell: f64::from_bits(u64_at(&raw, 104)),
        flags: word(112),
        morton_bits: word(116),
        batches_at: u64_at(&raw, 120),
        planes_at: [u64_at(&raw, 128), u64_at(&raw, 136), u64_at(&raw, 144)],
        colour_at: u64_at(&raw, 152),
        originals_at: u64_at(&raw, 160),
        description_at: u64_at(&raw, 168),
        description_bytes: u64_at(&raw, 176),
        exponent: word(184),
    };
    if u64::from(word(28)) != header.batches {
        fault(findings, "batch count", header.batches, word(28));
    }
    if word(188) != 0 || raw[192..].iter().any(|b| *b != 0) {
        fault(findings, "bytes 188 to 255", "0", "other bytes");
    }
    flags(&header, findings);
    Ok(grid(&mut header, findings).then_some(header))
}

fn fault(
    findings: &Findings,
    subject: &'static str,
    expected: impl Into<serde_json::Value>,
    found: impl Into<serde_json::Value>,
) {
    findings.push(Finding::new(Check::Header, subject, expected, found));
}

fn flags(header: &Header, findings: &Findings) {
    let has = |bit: u32| header.flags & bit != 0;
    if header.flags > 31 {
        fault(findings, "flags", "1, 2, 4, 8 and 16 alone", header.flags);
    }
    if has(4) && !has(2) {
        fault(findings, "flag 4 (averaged colours)", "flag 2 (levels) with it", header.flags);
    }
    if has(8) && !has(4) {
        fault(findings, "flag 8 (originals)", "flag 4 (averaged colours) with it", header.flags);
    }
    if has(8) != (header.originals_at != 0) {
        fault(findings, "flag 8", "set exactly if there are originals", header.flags);
    }
    if header.planes_at[1] == 0 && header.planes_at[2] != 0 {
        fault(findings, "planes", "lo10 only with mid10", "lo10 alone");
    }
}

/// Origin, boxes, cell, e and n. False if positions make no sense.
fn grid(header: &mut Header, findings: &Findings) -> bool {
    let Header { origin, min, max, cell, .. } = &*header;
    if !(cell.is_finite() && *cell > 0.0) {
        fault(findings, "cell", "finite, above 0", json!(cell));
        return false;
    }
    if ![origin, min, max].iter().all(|v| v.iter().all(|x| x.is_finite())) || (0..3).any(|a| min[a] > max[a]) {
        fault(findings, "origin and tight box", "finite, min at most max", json!([origin, min, max]));
        return false;
    }
    if header.points == 0 && [origin, min, max].iter().any(|v| **v != [0.0; 3]) {
        fault(findings, "origin and tight box", "0 without points", json!([origin, min, max]));
    }
    if *origin != min.map(f64::floor) {
        fault(findings, "origin", json!(min.map(f64::floor)), json!(origin));
        if (0..3).any(|a| origin[a] > min[a]) {
            return false; // cells and Morton coordinates would be below 0
        }
    }
    // r and u grow with p, also as doubles: the largest belong to the box's max
    let largest = (0..3).map(|a| (max[a] - origin[a]) / cell).fold(0.0, f64::max);
    let least = (0..=30).find(|e| largest < power(*e));
    match least {
        _ if header.points == 0 && header.exponent == 0 => {}
        Some(e) if e as u32 == header.exponent => {}
        Some(e) => fault(findings, "exponent of the Morton cube", e, header.exponent),
        None => fault(findings, "extent", "below 2^30 cells", format!("{largest} cells")),
    }
    let bits = if header.exponent <= 19 { 21 } else { 32 };
    if header.morton_bits != bits {
        fault(findings, "Morton bits an axis", bits, header.morton_bits);
    }
    let Some(least) = least else { return false };
    if header.exponent > 30 || header.exponent < least as u32 {
        header.exponent = least as u32; // what order and cells are checked with
    }
    true
}
