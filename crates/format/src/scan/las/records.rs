//! Variable length records, before the points (VLR) or anywhere (EVLR, LAS 1.4): LAS 1.4 R15 §2.5 and §2.7.

use super::bytes::{text, u16_at, u64_at};
use super::header::Header;
use crate::scan::source::Source;
use crate::{ReadError, ScanWarning};

const VLR_HEADER: u64 = 54;
const EVLR_HEADER: u64 = 60;

/// A file with more records than this is hostile; reading stops there.
const MAX_RECORDS: u32 = 100_000;
/// Records that are kept are texts and small tables; those that make them larger together are not read.
const MAX_KEPT: u64 = 8 << 20;

/// One record of those that this reader understands.
#[derive(Debug, Clone)]
pub(super) struct Record {
    pub(super) user_id: String,
    pub(super) record_id: u16,
    /// Offset in the file of `data`.
    pub(super) data_offset: u64,
    pub(super) data: Vec<u8>,
}

impl Record {
    pub(super) fn is(&self, user_id: &str, record_id: u16) -> bool {
        self.record_id == record_id && self.user_id == user_id
    }
}

/// What stands around the points.
#[derive(Debug, Default)]
pub(super) struct Records {
    /// The records of interest: VLRs in file order, then EVLRs.
    pub(super) kept: Vec<Record>,
    /// Bytes of their data.
    pub(super) kept_bytes: u64,
    /// One that was not read is in the warnings.
    pub(super) is_ignored_told: bool,
    /// Where the EVLRs begin, if every one of them lies inside the file.
    pub(super) evlr_start: Option<u64>,
}

impl Records {
    /// The first record with that identity.
    pub(super) fn find(&self, user_id: &str, record_id: u16) -> Option<&Record> {
        self.kept.iter().find(|r| r.is(user_id, record_id))
    }

    /// Reads all records; those that do not fit become a line in `warnings`.
    pub(super) fn read(source: &Source, header: &Header, warnings: &mut Vec<ScanWarning>) -> Result<Self, ReadError> {
        let mut records = Self::default();
        let vlrs = Area { kind: "VLR", count: header.vlr_count, start: header.header_size, end: header.points_start };
        records.read_area(source, &vlrs, VLR_HEADER, warnings)?;
        if header.evlr_count > 0 {
            let evlrs = Area { kind: "EVLR", count: header.evlr_count, start: header.evlr_start, end: source.len() };
            let whole = records.read_area(source, &evlrs, EVLR_HEADER, warnings)?;
            records.evlr_start = whole.then_some(header.evlr_start);
        }
        Ok(records)
    }

    /// True if every record of the area is there.
    fn read_area(
        &mut self,
        source: &Source,
        area: &Area,
        header_len: u64,
        warnings: &mut Vec<ScanWarning>,
    ) -> Result<bool, ReadError> {
        let Area { kind, count, start, end } = *area;
        let mut at = start;
        for index in 0..count.min(MAX_RECORDS) {
            let Some(data_offset) = at.checked_add(header_len).filter(|data| *data <= end) else {
                warnings.push(ScanWarning::RecordOutside { kind, index, count, at });
                return Ok(false);
            };
            let mut head = [0; EVLR_HEADER as usize];
            source.read_at(at, &mut head[..header_len as usize])?;
            let len = if header_len == VLR_HEADER { u64::from(u16_at(&head, 20)) } else { u64_at(&head, 20) };
            let (user_id, record_id) = (text(&head[2..18]), u16_at(&head, 18));
            let Some(next) = data_offset.checked_add(len).filter(|next| *next <= end) else {
                let (bytes, at) = (len, data_offset);
                warnings.push(ScanWarning::RecordTooLong { kind, index, count, user_id, record_id, bytes, at });
                return Ok(false);
            };
            if is_of_interest(&user_id, record_id) {
                if self.kept_bytes + len <= MAX_KEPT {
                    let data = source.vec_at(data_offset, len)?;
                    self.kept_bytes += len;
                    self.kept.push(Record { user_id, record_id, data_offset, data });
                } else if !std::mem::replace(&mut self.is_ignored_told, true) {
                    warnings.push(ScanWarning::RecordIgnored { kind, index, user_id, record_id, bytes: len });
                }
            }
            at = next;
        }
        if count > MAX_RECORDS {
            warnings.push(ScanWarning::RecordsIgnored { kind, count, read: MAX_RECORDS });
        }
        Ok(count <= MAX_RECORDS)
    }
}

struct Area {
    kind: &'static str,
    count: u32,
    start: u64,
    end: u64,
}

/// Extra bytes, WKT, GeoTIFF keys, LASzip and its compatibility mode, COPC; user id and record id together, for numbers alone are not unique.
fn is_of_interest(user_id: &str, record_id: u16) -> bool {
    matches!(
        (user_id, record_id),
        ("LASF_Spec", 4)
            | ("LASF_Projection", 2112 | 34735..=34737)
            | ("laszip encoded" | "lascompatible", 22204)
            | ("copc", 1)
    )
}
