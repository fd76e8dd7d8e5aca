//! The header of the file.

use serde_json::{Value, json};

use super::front::{Front, HEADER};
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Bytes of a point of format 6, 7 and 8 without extra bytes.
pub(super) const RECORD_BYTES: [u16; 3] = [30, 36, 38];

/// Bit of the global encoding: the coordinate reference system is WKT.
const WKT: u16 = 1 << 4;

/// Reports fields that no COPC file has.
pub(super) fn check(front: &Front, findings: &Findings) {
    let judge = |is_so: bool, subject: &'static str, expected: Value, found: Value| {
        findings.checked(Check::Header, 1);
        if !is_so {
            findings.push(Finding::new(Check::Header, subject, expected, found));
        }
    };
    let version = [front.u8(24), front.u8(25)];
    judge(version == [1, 4], "version of LAS", json!("1.4"), json!(format!("{}.{}", version[0], version[1])));
    let size = front.u16(94);
    judge(usize::from(size) == HEADER, "bytes of the header", json!(HEADER), json!(size));
    let format = front.u8(104);
    judge(matches!(format, 134..=136), "point format", json!("6, 7 or 8, and 128"), json!(format));
    if let Some(least) = RECORD_BYTES.get(usize::from(front.point_format()).wrapping_sub(6)) {
        let len = front.u16(105);
        judge(len >= *least, "bytes of a point", json!(format!("{least} or more")), json!(len));
    }
    let encoding = front.u16(6);
    judge(encoding & WKT != 0, "global encoding", json!("bit 4, WKT"), json!(encoding));
    let (scale, offset) = (front.vector(131), front.vector(155));
    judge(scale.iter().all(|s| *s > 0.0 && s.is_finite()), "scale", json!("above 0"), json!(scale));
    judge(offset.iter().all(|o| o.is_finite()), "offset", json!("finite"), json!(offset));
    let bounds = front.bounds();
    let is_box = bounds.iter().all(|[min, max]| min <= max && min.is_finite() && max.is_finite());
    judge(is_box || front.points() == 0, "bounds", json!("least, then greatest coordinates"), json!(bounds));
    places(front, findings);
    legacy(front, findings);
}

/// Where points and extended records begin.
fn places(front: &Front, findings: &Findings) {
    findings.checked(Check::Header, 2);
    let (points, extended, count) = (front.points_start(), front.u64(235), front.u32(243));
    let most = front.file_bytes.saturating_sub(8);
    if points > most {
        let expected = format!("at most {most}, as the file has {} bytes", front.file_bytes);
        findings.push(Finding::new(Check::Header, "start of the points", expected, points));
    }
    if count > 0 && extended < points.saturating_add(8) {
        let expected = format!("behind the points, which begin at {points}");
        findings.push(Finding::new(Check::Header, "start of the extended records", expected, extended));
    }
}

/// The counts of older versions are 0; the true ones do no harm.
fn legacy(front: &Front, findings: &Findings) {
    findings.checked(Check::Header, 1);
    let counts: Vec<u64> = (0..6).map(|i| u64::from(front.u32(107 + 4 * i))).collect();
    if counts.iter().all(|n| *n == 0) {
        return;
    }
    let is_true = counts[0] == front.points() && (1..6).all(|i| counts[i] == front.u64(255 + 8 * (i - 1)));
    let finding =
        Finding::new(Check::Header, "counts of versions before 1.4", json!([0, 0, 0, 0, 0, 0]), json!(counts));
    findings.push(if is_true { finding.warning() } else { finding });
}
