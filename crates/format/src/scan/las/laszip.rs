//! The LASzip record (`laszip encoded` 22204): how the points are compressed.

use laz::{LazItem, LazItemType, LazVlr};

use super::bytes::{u16_at, u32_at};
use super::header::Header;
use super::records::Record;

/// Bytes of the record before its items, and of an item.
const FIXED: usize = 34;
const ITEM: usize = 6;

/// More extra bytes per record than this are refused: the decompressor's models take 16 kB for each.
const MAX_EXTRA_BYTES: usize = 2048;

/// How the compressed points are arranged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arrangement {
    /// Not compressed after all.
    Plain,
    /// One run over all points, no chunks, no chunk table (LASzip before 2.0).
    Pointwise,
    /// Chunks of records, compressed one after the other (formats 0–5).
    Chunked,
    /// Chunks of layers (formats 6–10).
    Layered,
}

/// The record, checked against the header: a decompressor built from `items` writes records of exactly
/// [`Header::record_len`] bytes.
#[derive(Debug, Clone)]
pub(super) struct LaszipRecord {
    pub(super) arrangement: Arrangement,
    /// Points a chunk, the last one excepted; `None` if each chunk has its own number.
    pub(super) chunk_points: Option<u32>,
    pub(super) items: Vec<LazItem>,
}

/// Why the points cannot be decompressed, as text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum LaszipFault {
    /// The record contradicts itself or the header.
    Broken(String),
    /// The file may be sound; a codec that this reader does not have would be needed.
    Unknown(String),
}

impl LaszipRecord {
    /// # Errors
    /// What does not fit, or is not known.
    pub(super) fn parse(record: &Record, header: &Header) -> Result<Self, LaszipFault> {
        let data = &record.data;
        let count = usize::from(u16_at(data, 32));
        if data.len() < FIXED + ITEM * count || count == 0 {
            return Err(LaszipFault::Broken(format!(
                "the LASzip record has {} bytes and declares {count} items",
                data.len()
            )));
        }
        let arrangement = match u16_at(data, 0) {
            0 => Arrangement::Plain,
            1 => Arrangement::Pointwise,
            2 => Arrangement::Chunked,
            3 => Arrangement::Layered,
            other => return Err(LaszipFault::Unknown(format!("LASzip compressor {other} is not known"))),
        };
        if u16_at(data, 2) != 0 {
            return Err(LaszipFault::Unknown(format!("LASzip coder {} is not known", u16_at(data, 2))));
        }
        let items = LazVlr::from_buffer(data)
            .map_err(|e| LaszipFault::Broken(format!("the LASzip record: {e}")))?
            .items()
            .clone();
        check_items(&items, header, arrangement)?;
        // u32::MAX by the specification; 0 is what lascopcindex writes
        let chunk_points = Some(u32_at(data, 12)).filter(|n| *n != 0 && *n != u32::MAX);
        Ok(Self { arrangement, chunk_points, items })
    }

    /// Layers of a chunk: their sizes stand behind its first record.
    pub(super) fn layers(&self) -> usize {
        self.items.iter().map(|item| layers(item.item_type())).sum()
    }
}

/// The items must be those of the point format, in order, each of its usual size and a version that is decoded.
fn check_items(items: &[LazItem], header: &Header, arrangement: Arrangement) -> Result<(), LaszipFault> {
    use LazItemType as I;
    let extra = header.record_len - header.format_len();
    if extra > MAX_EXTRA_BYTES {
        let what = format!("{extra} compressed extra bytes per point are more than the {MAX_EXTRA_BYTES} supported");
        return Err(LaszipFault::Unknown(what));
    }
    let n = extra as u16;
    let mut expected = match header.point_format {
        0 => vec![I::Point10],
        1 => vec![I::Point10, I::GpsTime],
        2 => vec![I::Point10, I::RGB12],
        3 => vec![I::Point10, I::GpsTime, I::RGB12],
        4 => vec![I::Point10, I::GpsTime, I::WavePacket13],
        5 => vec![I::Point10, I::GpsTime, I::RGB12, I::WavePacket13],
        6 => vec![I::Point14],
        7 => vec![I::Point14, I::RGB14],
        8 => vec![I::Point14, I::RGBNIR14],
        9 => vec![I::Point14, I::WavePacket14],
        _ => vec![I::Point14, I::RGBNIR14, I::WavePacket14],
    };
    let layered = header.point_format >= 6;
    if n > 0 {
        expected.push(if layered { I::Byte14(n) } else { I::Byte(n) });
    }
    let found: Vec<I> = items.iter().map(LazItem::item_type).collect();
    if found != expected {
        return Err(LaszipFault::Broken(format!(
            "the LASzip items {found:?} are not those of point format {} with records of {} bytes",
            header.point_format, header.record_len
        )));
    }
    if let Some(item) = items.iter().find(|item| item.size() != size(item.item_type())) {
        let what = format!("the LASzip item {:?} claims {} bytes", item.item_type(), item.size());
        return Err(LaszipFault::Broken(what));
    }
    let versions = if layered { 3..=4 } else { 1..=2 };
    let fits = arrangement == Arrangement::Plain || layered == (arrangement == Arrangement::Layered);
    match items.iter().find(|item| !versions.contains(&item.version())) {
        Some(item) if arrangement != Arrangement::Plain => {
            let what = format!("LASzip item {:?} of version {} is not known", item.item_type(), item.version());
            Err(LaszipFault::Unknown(what))
        }
        _ if !fits => {
            let what = format!("point format {} cannot be arranged as {arrangement:?}", header.point_format);
            Err(LaszipFault::Broken(what))
        }
        _ => Ok(()),
    }
}

fn size(item: LazItemType) -> u16 {
    use LazItemType as I;
    match item {
        I::Byte(n) | I::Byte14(n) => n,
        I::Point10 => 20,
        I::GpsTime | I::RGBNIR14 => 8,
        I::RGB12 | I::RGB14 => 6,
        I::WavePacket13 | I::WavePacket14 => 29,
        I::Point14 => 30,
    }
}

fn layers(item: LazItemType) -> usize {
    use LazItemType as I;
    match item {
        I::Point14 => 9,
        I::RGB14 | I::WavePacket14 => 1,
        I::RGBNIR14 => 2,
        I::Byte14(n) => usize::from(n),
        I::Byte(_) | I::Point10 | I::GpsTime | I::RGB12 | I::WavePacket13 => 0,
    }
}
