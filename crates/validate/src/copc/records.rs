//! The records: LASzip, coordinate reference system, extra bytes, and how often each is there.

use serde_json::json;

use super::front::{Front, Record, bytes};
use super::header::RECORD_BYTES;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Bytes that describe an attribute in extra bytes.
pub(super) const DESCRIPTOR: usize = 192;

/// Bytes of values of the data types 1 to 10 of extra bytes.
const TYPE_BYTES: [u16; 10] = [1, 1, 2, 2, 4, 4, 8, 8, 4, 8];

/// Types of a LASzip item: point, colours, colours with near infrared, extra bytes.
const ITEMS: [u16; 4] = [10, 11, 12, 14];

/// Reports records that are missing, double, or say something else than the header.
pub(super) fn check(front: &Front, findings: &Findings) {
    let judge = Judge(findings);
    let first = front.records.first().filter(|record| record.at == 375 && !record.is_extended);
    let found = first.map(|record| format!("{} {}", record.user, record.number));
    judge.that(first.is_some_and(|r| r.is("copc", 1)), "first record", json!("copc 1"), json!(found));
    let count = |user, number| front.all(user, number).count();
    judge.that(count("copc", 1) == 1, "records copc 1", json!(1), json!(count("copc", 1)));
    judge.that(count("copc", 1000) == 1, "records copc 1000", json!(1), json!(count("copc", 1000)));
    let laszip = count("laszip encoded", 22204);
    judge.that(laszip == 1, "records laszip encoded 22204", json!(1), json!(laszip));
    front.all("laszip encoded", 22204).take(1).for_each(|record| self::laszip(front, record, &judge));
    reference_system(front, &judge);
    extra_bytes(front, &judge);
    ends(front, &judge);
}

struct Judge<'a>(&'a Findings);

impl Judge<'_> {
    fn that(&self, is_so: bool, subject: &'static str, expected: serde_json::Value, found: serde_json::Value) {
        self.0.checked(Check::Records, 1);
        if !is_so {
            self.0.push(Finding::new(Check::Records, subject, expected, found));
        }
    }

    /// As [`Self::that`], of what is allowed.
    fn wish(&self, is_so: bool, subject: &'static str, expected: serde_json::Value, found: serde_json::Value) {
        self.0.checked(Check::Records, 1);
        if !is_so {
            self.0.push(Finding::new(Check::Records, subject, expected, found).warning());
        }
    }
}

/// What the record of LASzip says against the point format.
fn laszip(front: &Front, record: &Record, judge: &Judge<'_>) {
    let data = record.data.as_slice();
    let u16_at = |at| u16::from_le_bytes(bytes(data, at));
    judge.that(u16_at(0) == 3, "compressor of LASzip", json!("3, layered chunks"), json!(u16_at(0)));
    let chunk = u32::from_le_bytes(bytes(data, 12));
    judge.that(chunk == u32::MAX, "chunk size of LASzip", json!(u32::MAX), json!(chunk));
    let format = front.point_format();
    let Some(least) = RECORD_BYTES.get(usize::from(format).wrapping_sub(6)) else { return };
    let extra = front.u16(105).saturating_sub(*least);
    let mut expected = vec![[ITEMS[0], 30]];
    expected.extend((format == 7).then_some([ITEMS[1], 6]));
    expected.extend((format == 8).then_some([ITEMS[2], 8]));
    expected.extend((extra > 0).then_some([ITEMS[3], extra]));
    let items = data.get(34..).unwrap_or_default().as_chunks::<6>().0;
    let field = |item: &[u8; 6], at| u16::from_le_bytes(bytes(item, at));
    let found: Vec<[u16; 2]> = items.iter().map(|item| [field(item, 0), field(item, 2)]).collect();
    judge.that(
        found == expected && usize::from(u16_at(32)) == items.len(),
        "items of LASzip, types and bytes",
        json!(expected),
        json!(found),
    );
    let versions: Vec<u16> = items.iter().map(|item| field(item, 4)).collect();
    judge.that(versions.iter().all(|v| *v >= 3), "versions of the items of LASzip", json!(3), json!(versions));
    judge.wish(versions.iter().all(|v| *v <= 3), "versions of the items of LASzip", json!(3), json!(versions));
}

/// The coordinate reference system: WKT, or none.
fn reference_system(front: &Front, judge: &Judge<'_>) {
    let wkt: Vec<&Record> = front.all("LASF_Projection", 2112).collect();
    judge.that(wkt.len() <= 1, "records LASF_Projection 2112", json!("1 at most"), json!(wkt.len()));
    let Some(wkt) = wkt.first() else {
        judge.wish(false, "coordinate reference system", json!("WKT"), json!("none"));
        return;
    };
    let text = wkt.data.split(|b| *b == 0).next().unwrap_or_default();
    let fault = wkt_fault(text);
    judge.that(fault.is_none(), "coordinate reference system", json!("WKT"), json!(fault));
    let keys = front.all("LASF_Projection", 34735).count();
    judge.wish(keys == 0, "GeoTIFF keys beside WKT", json!(0), json!(keys));
}

/// Why a text cannot be WKT: what is looked at is its shape alone.
fn wkt_fault(text: &[u8]) -> Option<&'static str> {
    let Ok(text) = std::str::from_utf8(text) else { return Some("no UTF-8") };
    let text = text.trim();
    let keyword = text.trim_start_matches(|c: char| c.is_ascii_alphanumeric() || c == '_').trim_start();
    if !text.starts_with(|c: char| c.is_ascii_alphabetic()) || !keyword.starts_with(['[', '(']) {
        return Some("it does not begin with a keyword");
    }
    let (mut depth, mut is_quoted) = (0i64, false);
    for c in text.chars() {
        match c {
            '"' => is_quoted = !is_quoted,
            '[' | '(' if !is_quoted => depth += 1,
            ']' | ')' if !is_quoted => depth -= 1,
            _ => {}
        }
        if depth < 0 {
            return Some("a bracket is closed that was not opened");
        }
    }
    (depth != 0 || is_quoted).then_some("a bracket or a text is not closed")
}

/// Bytes behind the fields of the point format, and what describes them.
fn extra_bytes(front: &Front, judge: &Judge<'_>) {
    let Some(least) = RECORD_BYTES.get(usize::from(front.point_format()).wrapping_sub(6)) else { return };
    let there = front.u16(105).saturating_sub(*least);
    let records: Vec<&Record> = front.all("LASF_Spec", 4).collect();
    judge.that(records.len() <= 1, "records LASF_Spec 4", json!("1 at most"), json!(records.len()));
    let data = records.first().map_or(&[][..], |record| record.data.as_slice());
    let (descriptors, rest) = data.as_chunks::<DESCRIPTOR>();
    let multiple = format!("a multiple of {DESCRIPTOR}");
    judge.that(rest.is_empty(), "bytes of the record LASF_Spec 4", json!(multiple), json!(data.len()));
    let described = descriptors.iter().map(|d| u64::from(size(d))).sum::<u64>();
    judge.that(described <= u64::from(there), "bytes of a point that are described", json!(there), json!(described));
    judge.wish(described >= u64::from(there), "bytes of a point that are described", json!(there), json!(described));
}

/// Bytes of an attribute that is described so.
fn size(descriptor: &[u8; DESCRIPTOR]) -> u16 {
    match descriptor[2] {
        0 => u16::from(descriptor[3]),
        // types 11 to 30 are two and three of the first ten, and withdrawn
        ty @ 1..=30 => TYPE_BYTES[usize::from(ty - 1) % 10] * (u16::from(ty - 1) / 10 + 1),
        _ => 0,
    }
}

/// Bytes that belong to nothing.
fn ends(front: &Front, judge: &Judge<'_>) {
    let (records, points) = (front.records_end, front.points_start());
    judge.wish(records >= points.min(front.file_bytes), "end of the records", json!(points), json!(records));
    if front.u32(243) > 0 {
        let (end, file) = (front.extended_end, front.file_bytes);
        judge.wish(end >= file, "end of the extended records", json!(file), json!(end));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_wkt_is_told() {
        assert_eq!(wkt_fault(b"PROJCS[\"a (b\",UNIT[\"metre\",1]]"), None);
        assert_eq!(wkt_fault(b"GEOGCS(\"a\")  "), None);
        for text in [&b"EPSG:25832"[..], b"PROJCS[\"a\"", b"PROJCS]", b"\xff", b"", b"PROJCS[\"a]"] {
            assert!(wkt_fault(text).is_some() || text == b"EPSG:25832", "{text:?}");
        }
    }

    #[test]
    fn withdrawn_types_of_extra_bytes_are_several_values() {
        let of = |ty: u8, options: u8| {
            let mut descriptor = [0; DESCRIPTOR];
            (descriptor[2], descriptor[3]) = (ty, options);
            size(&descriptor)
        };
        assert_eq!([of(0, 7), of(1, 0), of(10, 0), of(13, 0), of(30, 0), of(31, 0)], [7, 1, 8, 4, 24, 0]);
    }
}
