//! What stands before and behind the points, byte by byte; nothing in it is trusted.

use std::fs::File;
use std::ops::Range;
use std::path::Path;

use pointmill_format::ReadError;
use pointmill_format::bytes::{open_file, read_exact_at};
use serde_json::Value;

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::{self, Budget};

/// Bytes of the header of LAS 1.4.
pub(super) const HEADER: usize = 375;

/// Bytes of a record before its data, and of an extended one.
const HEADS: [u64; 2] = [54, 60];

/// The data of a record that is looked at is not longer.
const MAX_DATA: u64 = 16 << 20;

/// What a record takes in memory without its data.
const RECORD_BYTES: u64 = 160;

/// A record, or an extended one.
#[derive(Debug)]
pub(super) struct Record {
    /// First byte of its head.
    pub(super) at: u64,
    pub(super) is_extended: bool,
    pub(super) user: String,
    pub(super) number: u16,
    /// Where its data stands.
    pub(super) range: Range<u64>,
    /// The data, if the record is one that is looked at.
    pub(super) data: Vec<u8>,
}

impl Record {
    pub(super) fn is(&self, user: &str, number: u16) -> bool {
        self.user == user && self.number == number
    }
}

/// The header, and all records that could be read.
#[derive(Debug)]
pub(super) struct Front {
    pub(super) file: File,
    pub(super) file_bytes: u64,
    header: [u8; HEADER],
    /// In the order of the file.
    pub(super) records: Vec<Record>,
    /// Where the records before the points end.
    pub(super) records_end: u64,
    /// Where the extended records end.
    pub(super) extended_end: u64,
}

impl Front {
    /// Reads them, and reports records that are not whole; `None` if there is no header.
    ///
    /// # Errors
    /// The operating system could not read, or the records do not fit memory.
    pub(super) fn read(path: &Path, budget: &Budget, findings: &Findings) -> Result<Option<Self>, ReadError> {
        let file = open_file(path).map_err(|e| ReadError::io(path, "opening", e))?;
        let file_bytes = file.metadata().map_err(|e| ReadError::io(path, "reading", e))?.len();
        findings.checked(Check::Header, 1);
        let mut header = [0; HEADER];
        if file_bytes < HEADER as u64 {
            findings.push(Finding::new(Check::Header, "bytes of the file", format!("{HEADER} or more"), file_bytes));
            return Ok(None);
        }
        read_exact_at(&file, &mut header, 0).map_err(|e| ReadError::io(path, "reading the header", e))?;
        if !header.starts_with(b"LASF") {
            findings.push(Finding::new(Check::Header, "first bytes", "LASF", "something else"));
            return Ok(None);
        }
        let mut front = Self { file, file_bytes, header, records: Vec::new(), records_end: 0, extended_end: 0 };
        let (before, behind) = (u64::from(front.u32(100)), u64::from(front.u32(243)));
        let start = u64::from(front.u16(94));
        let points_start = front.points_start().min(file_bytes);
        let mut reading = Reading { front: &mut front, path, budget, findings };
        let records_end = reading.records(start, before, points_start, false)?;
        let extended_start = reading.front.u64(235);
        let extended_end = reading.records(extended_start, behind, file_bytes, true)?;
        (front.records_end, front.extended_end) = (records_end, extended_end);
        Ok(Some(front))
    }

    /// Bytes of the header.
    pub(super) fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        bytes(&self.header, at)
    }

    pub(super) fn u8(&self, at: usize) -> u8 {
        self.bytes::<1>(at)[0]
    }

    pub(super) fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }

    pub(super) fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    pub(super) fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes(at))
    }

    pub(super) fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.bytes(at))
    }

    /// Three doubles side by side.
    pub(super) fn vector(&self, at: usize) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.f64(at + 8 * axis))
    }

    /// Where the points begin, with the place of the chunk table.
    pub(super) fn points_start(&self) -> u64 {
        u64::from(self.u32(96))
    }

    /// Points by the header.
    pub(super) fn points(&self) -> u64 {
        self.u64(247)
    }

    /// The point format without the bits of compression.
    pub(super) fn point_format(&self) -> u8 {
        self.u8(104) & 0x3F
    }

    /// Least and greatest coordinates by the header.
    pub(super) fn bounds(&self) -> [[f64; 2]; 3] {
        [179, 195, 211].map(|at| [self.f64(at + 8), self.f64(at)])
    }

    /// True if the header names pointmill as the program that wrote the file.
    pub(super) fn is_ours(&self) -> bool {
        self.bytes::<32>(58).starts_with(b"pointmill ")
    }

    /// How the file was made, as a record of pointmill's own says it; null without one.
    pub(super) fn own(&self) -> Value {
        let record = self.records.iter().find(|record| record.is("pointmill", 1));
        record.and_then(|record| serde_json::from_slice(&record.data).ok()).unwrap_or(Value::Null)
    }

    /// Records of that user and number.
    pub(super) fn all(&self, user: &'static str, number: u16) -> impl Iterator<Item = &Record> + '_ {
        self.records.iter().filter(move |record| record.is(user, number))
    }
}

/// `N` bytes from `at` on; zeros for those that are not there.
pub(super) fn bytes<const N: usize>(data: &[u8], at: usize) -> [u8; N] {
    data.get(at..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; N])
}

struct Reading<'a> {
    front: &'a mut Front,
    path: &'a Path,
    budget: &'a Budget,
    findings: &'a Findings,
}

impl Reading<'_> {
    /// Reads `count` records from `at` on, none of which goes beyond `end`; says where they end.
    fn records(&mut self, mut at: u64, count: u64, end: u64, is_extended: bool) -> Result<u64, ReadError> {
        let (head_len, what) =
            (HEADS[usize::from(is_extended)], if is_extended { "extended record" } else { "record" });
        let mut head = [0; 60];
        for i in 0..count {
            self.findings.checked(Check::Records, 1);
            let head_end = at.saturating_add(head_len);
            if head_end > end {
                self.cut_short(format!("{what} {i} of {count}"), head_end, end);
                return Ok(at.min(end));
            }
            let head = &mut head[..head_len as usize];
            self.read_at(head, at)?;
            let length = if is_extended { u64::from_le_bytes(bytes(head, 20)) } else { u16_at(head, 20).into() };
            let range = head_end..head_end.saturating_add(length);
            let user = head[2..18].split(|b| *b == 0).next().unwrap_or_default();
            let user = String::from_utf8_lossy(user).into_owned();
            let (number, data) = (u16_at(head, 18), Vec::new());
            let mut record = Record { at, is_extended, user, number, range, data };
            if record.range.end > end {
                self.cut_short(format!("data of {what} {i}, {} {number}", record.user), record.range.end, end);
                return Ok(head_end);
            }
            if is_looked_at(&record) && length <= MAX_DATA {
                self.budget.require(if record.user == "pointmill" { length * memory::JSON } else { length })?;
                record.data.resize(length as usize, 0);
                self.read_at(&mut record.data, head_end)?;
            }
            at = record.range.end;
            self.front.records.push(record);
            self.budget.require(self.front.records.len() as u64 * RECORD_BYTES)?;
        }
        Ok(at)
    }

    fn cut_short(&self, subject: String, found: u64, end: u64) {
        let expected = format!("an end at byte {end} at most");
        self.findings.push(Finding::new(Check::Records, subject, expected, format!("an end at byte {found}")));
    }

    fn read_at(&self, buf: &mut [u8], at: u64) -> Result<(), ReadError> {
        read_exact_at(&self.front.file, buf, at).map_err(|e| ReadError::io(self.path, "reading the records", e))
    }
}

fn u16_at(head: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes(head, at))
}

/// The records of which something is checked.
fn is_looked_at(record: &Record) -> bool {
    let known = [("copc", 1), ("laszip encoded", 22204), ("LASF_Projection", 2112), ("LASF_Spec", 4), ("pointmill", 1)];
    known.iter().any(|(user, number)| record.is(user, *number))
}
