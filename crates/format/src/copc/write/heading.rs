//! From what a writer knows to the bytes before and behind its chunks.

use crate::potree2::NodeEntry;
use crate::scan::las::chunk_table_entries;
use crate::scan::las::write::header::{Fields, LEN_1_4};
use crate::scan::las::write::records::{self, EXTENDED_HEADER};
use crate::scan::las::write::{Ending, Summary};
use crate::{Attribute, Lattice, WriteError};

use super::super::Info;
use super::pages::{MAX_PAGE_ENTRIES, encode_pages};

/// Bytes before the chunks: where the chunk table is.
const TABLE_OFFSET: u64 = 8;

/// User and number of the record with WKT.
const PROJECTION: (&str, u16) = ("LASF_Projection", 2112);

/// What a COPC file says of its points before the first one is there. How many bytes it takes is known then
/// ([`Self::chunks_start`]): chunks may be written at once, by any number of threads, and the rest at the end ([`Self::finish`]).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Heading {
    /// 6, 7 (with colours) or 8 (with colours and near infrared).
    pub point_format: u8,
    /// What the records have behind the fields of their format, in order.
    pub extra_bytes: Vec<Attribute>,
    /// What the positions are on.
    pub lattice: Lattice,
    /// The coordinate reference system as WKT.
    pub wkt: Option<String>,
    /// GPS times are adjusted standard time, not seconds of a week.
    pub is_adjusted_time: bool,
    /// The program that writes, up to 32 bytes.
    pub software: String,
    /// What pointmill says of the making: JSON. Empty: nothing.
    pub making: String,
}

impl Heading {
    /// Points of that format on that lattice, without extra bytes and a coordinate reference system.
    ///
    /// # Errors
    /// A point format that COPC does not have.
    pub fn new(point_format: u8, lattice: Lattice) -> Result<Self, WriteError> {
        if !matches!(point_format, 6..=8) {
            return Err(WriteError::input(format!("point format {point_format}; COPC has 6, 7 and 8")));
        }
        let software = concat!("pointmill ", env!("CARGO_PKG_VERSION")).to_owned();
        Ok(Self {
            point_format,
            extra_bytes: Vec::new(),
            lattice,
            wkt: None,
            is_adjusted_time: false,
            software,
            making: String::new(),
        })
    }

    /// Bytes of a point before compression.
    #[must_use]
    pub fn record_len(&self) -> usize {
        let own = match self.point_format {
            6 => 30,
            7 => 36,
            _ => 38,
        };
        own + self.extra_len()
    }

    fn extra_len(&self) -> usize {
        self.extra_bytes.iter().map(Attribute::size).sum()
    }

    /// The data of the LASzip record, which encoders take.
    ///
    /// # Errors
    /// More extra bytes than a record can have.
    pub fn laszip_record(&self) -> Result<Vec<u8>, WriteError> {
        let extra = u16::try_from(self.extra_len()).ok().filter(|_| self.record_len() <= usize::from(u16::MAX));
        let extra = extra.ok_or_else(|| WriteError::input("points of more than 65535 bytes"))?;
        Ok(records::laszip(self.point_format, extra))
    }

    /// The records behind the info record, and how many they are with it.
    fn records(&self) -> Result<(Vec<u8>, u32), WriteError> {
        let (mut out, mut count) = (Vec::new(), 2);
        records::append(&mut out, "laszip encoded", 22204, &self.laszip_record()?)?;
        if !self.extra_bytes.is_empty() {
            records::append(&mut out, "LASF_Spec", 4, &records::extra_bytes(&self.extra_bytes)?)?;
            count += 1;
        }
        if let Some(wkt) = self.wkt_data().filter(|wkt| !is_long(wkt)) {
            records::append(&mut out, PROJECTION.0, PROJECTION.1, &wkt)?;
            count += 1;
        }
        Ok((out, count))
    }

    /// The text with the zero byte that ends it.
    fn wkt_data(&self) -> Option<Vec<u8>> {
        self.wkt.as_ref().map(|wkt| [wkt.as_bytes(), &[0]].concat())
    }

    /// The extended records behind that of the hierarchy.
    fn extended(&self) -> (Vec<u8>, u32) {
        let (mut out, mut count) = (Vec::new(), 0);
        let mut add = |(user, number): (&str, u16), data: &[u8]| {
            records::append_extended(&mut out, user, number, data.len() as u64);
            out.extend(data);
            count += 1;
        };
        if let Some(wkt) = self.wkt_data().filter(|wkt| is_long(wkt)) {
            add(PROJECTION, &wkt);
        }
        if !self.making.is_empty() {
            add(("pointmill", 1), self.making.as_bytes());
        }
        (out, count)
    }

    /// The first byte of the first chunk.
    ///
    /// # Errors
    /// What does not fit the records of a LAS file.
    pub fn chunks_start(&self) -> Result<u64, WriteError> {
        let (records, _) = self.records()?;
        Ok(Info::OFFSET + (Info::LEN + records.len()) as u64 + TABLE_OFFSET)
    }

    /// The bytes around the chunks, which are written: `nodes` are all nodes, with the places of their chunks in the file. Chunks follow one
    /// another without gaps, in any order, from [`Self::chunks_start`] on.
    ///
    /// `info`: the cube and the spacing; its other fields are filled. `chunk_table`: what the encoder makes of the points and bytes of the
    /// chunks, in the order of the file, its head of 8 bytes included.
    ///
    /// # Errors
    /// Nodes that make no tree; chunks with gaps, or others than those of the table; counts that do not sum up; what does not fit the
    /// records of a LAS file.
    pub fn finish(
        &self,
        info: Info,
        summary: &Summary,
        nodes: &mut [NodeEntry],
        chunk_table: &[u8],
    ) -> Result<Ending, WriteError> {
        info.check().map_err(|(_, what)| WriteError::input(what))?;
        let (records, count) = self.records()?;
        let chunks_start = self.chunks_start()?;
        let tail_start = check_chunks(nodes, chunks_start, chunk_table, summary.points)?;
        let mut tail = chunk_table.to_vec();
        let hierarchy_start = tail_start + tail.len() as u64;
        let pages_start = hierarchy_start + EXTENDED_HEADER;
        let pages = encode_pages(nodes, pages_start, MAX_PAGE_ENTRIES)?;
        records::append_extended(&mut tail, "copc", 1000, pages.bytes.len() as u64);
        tail.extend(&pages.bytes);
        let (more, more_count) = self.extended();
        tail.extend(more);
        let too_long = || WriteError::input("records of more than 4 GiB");
        let fields = Fields {
            is_1_4: true,
            point_format: self.point_format,
            is_compressed: true,
            record_len: u16::try_from(self.record_len()).unwrap_or(u16::MAX),
            lattice: self.lattice,
            software: &self.software,
            is_adjusted_time: self.is_adjusted_time,
            is_wkt: true,
            records: count,
            points_start: u32::try_from(chunks_start - TABLE_OFFSET).map_err(|_| too_long())?,
            extended: (hierarchy_start, 1 + more_count),
            summary,
        };
        let mut head = Vec::with_capacity(LEN_1_4 + records.len());
        head.extend(fields.bytes());
        let (root_page_offset, root_page_size, gps_time) = (pages_start, pages.root_size, summary.gps_time);
        let info = Info { root_page_offset, root_page_size, gps_time, ..info };
        records::append(&mut head, "copc", 1, &info.to_bytes())?;
        head.extend(records);
        head.extend(tail_start.to_le_bytes());
        Ok(Ending::new(head, tail_start, tail))
    }
}

/// True for data that only an extended record holds.
fn is_long(data: &[u8]) -> bool {
    data.len() > usize::from(u16::MAX)
}

/// Where the chunks end, if they are those of the table, without gaps.
fn check_chunks(nodes: &[NodeEntry], start: u64, chunk_table: &[u8], points: u64) -> Result<u64, WriteError> {
    let mut chunks: Vec<&NodeEntry> = nodes.iter().filter(|node| node.points > 0).collect();
    chunks.sort_unstable_by_key(|node| node.byte_offset);
    let mut at = start;
    for node in &chunks {
        if node.byte_offset != at || node.byte_size == 0 {
            let what = format!("the chunk of node {} is not at byte {at}, where the one before ends", node.key);
            return Err(WriteError::input(what));
        }
        at += node.byte_size;
    }
    let table = chunk_table_entries(chunk_table).unwrap_or_default();
    let is_same = |((points, bytes), node): (&(u32, u32), &&NodeEntry)| {
        (*points, u64::from(*bytes)) == (node.points, node.byte_size)
    };
    if table.len() != chunks.len() || !table.iter().zip(&chunks).all(is_same) {
        return Err(WriteError::input("the chunk table is not that of the nodes"));
    }
    let sum: u64 = chunks.iter().map(|node| u64::from(node.points)).sum();
    if sum != points {
        return Err(WriteError::input(format!("the nodes have {sum} points, {points} are to be written")));
    }
    Ok(at)
}
