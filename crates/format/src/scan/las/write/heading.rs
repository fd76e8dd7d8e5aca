//! From what a writer knows to the bytes before and behind its points.

use super::crs::CrsRecords;
use super::header::{Fields, LEN_1_2, LEN_1_4};
use super::layout::RecordLayout;
use super::records;
use super::tally::Summary;
use crate::{Lattice, WriteError};

/// What a LAS or LAZ file says of its points before the first one is there. How many bytes it takes is known then
/// ([`Self::points_start`]): records or chunks may be written at once, by any number of threads, and the rest at the end
/// ([`Self::finish`]).
///
/// The version is the oldest that holds everything: 1.4 for point formats 6 and above, extra bytes, WKT and more than
/// 4,294,967,295 points, else 1.2.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Heading {
    /// What the records are.
    pub layout: RecordLayout,
    /// What the positions are on.
    pub lattice: Lattice,
    /// The coordinate reference system.
    pub crs: CrsRecords,
    /// Chunks (LAZ), not records.
    pub is_compressed: bool,
    /// No more points will be written.
    pub most_points: u64,
    /// The program that writes, up to 32 bytes.
    pub software: String,
}

/// The bytes around the points.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Ending {
    /// The first bytes of the file, as many as there are before the points.
    pub head: Vec<u8>,
    /// Where the points end, and the rest of the file begins.
    pub tail_start: u64,
    /// The rest of the file.
    pub tail: Vec<u8>,
}

impl Ending {
    pub(crate) fn new(head: Vec<u8>, tail_start: u64, tail: Vec<u8>) -> Self {
        Self { head, tail_start, tail }
    }
}

/// Records before the points, and those that are too long for that place.
#[derive(Default)]
struct Records {
    bytes: Vec<u8>,
    count: u32,
    extended: Vec<(&'static str, u16, Vec<u8>)>,
}

impl Records {
    fn add(&mut self, user: &'static str, number: u16, data: Vec<u8>) -> Result<(), WriteError> {
        if data.len() > usize::from(u16::MAX) {
            self.extended.push((user, number, data));
            return Ok(());
        }
        self.count += 1;
        records::append(&mut self.bytes, user, number, &data)
    }
}

impl Heading {
    /// Records of that layout, without a coordinate reference system.
    #[must_use]
    pub fn new(layout: RecordLayout, lattice: Lattice, most_points: u64) -> Self {
        let software = concat!("pointmill ", env!("CARGO_PKG_VERSION")).to_owned();
        Self { layout, lattice, crs: CrsRecords::default(), is_compressed: false, most_points, software }
    }

    fn records(&self) -> Result<Records, WriteError> {
        let mut out = Records::default();
        if self.is_compressed {
            let extra = self.layout.extra_bytes().iter().map(crate::Attribute::size).sum::<usize>();
            let extra = u16::try_from(extra).map_err(|_| WriteError::input("points of more than 65535 bytes"))?;
            out.add("laszip encoded", 22204, records::laszip(self.layout.point_format(), extra))?;
        }
        for (number, data) in &self.crs.records {
            out.add("LASF_Projection", *number, data.clone())?;
        }
        if !self.layout.extra_bytes().is_empty() {
            out.add("LASF_Spec", 4, records::extra_bytes(self.layout.extra_bytes())?)?;
        }
        Ok(out)
    }

    /// The version of LAS, major and minor.
    pub fn version(&self) -> (u8, u8) {
        if self.is_1_4() { (1, 4) } else { (1, 2) }
    }

    fn is_1_4(&self) -> bool {
        let is_large = self.most_points > u64::from(u32::MAX);
        is_large || self.layout.point_format() >= 6 || !self.layout.extra_bytes().is_empty() || self.crs.has_wkt()
    }

    fn start(&self, records: &Records) -> u64 {
        (if self.is_1_4() { LEN_1_4 } else { LEN_1_2 } + records.bytes.len()) as u64
    }

    /// The byte of the first record or chunk.
    ///
    /// # Errors
    /// What does not fit the records of a LAS file.
    pub fn points_start(&self) -> Result<u64, WriteError> {
        // where the chunk table is stands before the chunks
        Ok(self.start(&self.records()?) + if self.is_compressed { 8 } else { 0 })
    }

    /// The bytes around the points, which are written from [`Self::points_start`] to `points_end`. `chunk_table`: of
    /// compressed points, what the encoder makes of their chunks.
    ///
    /// # Errors
    /// More points than were promised; what does not fit the records of a LAS file.
    pub fn finish(&self, summary: &Summary, points_end: u64, chunk_table: &[u8]) -> Result<Ending, WriteError> {
        let records = self.records()?;
        if summary.points > self.most_points {
            let what = format!("{} points, {} were promised", summary.points, self.most_points);
            return Err(WriteError::input(what));
        }
        let mut tail = if self.is_compressed { chunk_table.to_vec() } else { Vec::new() };
        let extended_start = points_end + tail.len() as u64;
        for (user, number, data) in &records.extended {
            records::append_extended(&mut tail, user, *number, data.len() as u64);
            tail.extend(data);
        }
        let start = self.start(&records);
        let extended = records.extended.len() as u32;
        let fields = Fields {
            is_1_4: self.is_1_4(),
            point_format: self.layout.point_format(),
            is_compressed: self.is_compressed,
            record_len: u16::try_from(self.layout.record_len())
                .map_err(|_| WriteError::input("points of more than 65535 bytes"))?,
            lattice: self.lattice,
            software: &self.software,
            is_adjusted_time: summary.is_adjusted_time(),
            is_wkt: self.crs.is_wkt,
            records: records.count,
            points_start: u32::try_from(start).map_err(|_| WriteError::input("records of more than 4 GiB"))?,
            extended: (if extended > 0 { extended_start } else { 0 }, extended),
            summary,
        };
        let mut head = fields.bytes();
        head.extend(records.bytes);
        if self.is_compressed {
            head.extend(points_end.to_le_bytes());
        }
        Ok(Ending::new(head, points_end, tail))
    }
}
