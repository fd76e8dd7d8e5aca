//! The LASzip record (`laszip encoded` 22204): how the points are compressed.

use super::bytes::{u16_at, u32_at};
use super::header::Header;
use super::laz::{Item, ItemKind};
use super::records::Record;

/// Bytes of the record before its items, and of an item.
const FIXED: usize = 34;
const ITEM: usize = 6;

/// More extra bytes per record than this are refused: the decoder's models take up to 5 kB for each.
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

impl Arrangement {
    const fn words(self) -> &'static str {
        match self {
            Self::Plain => "not at all",
            Self::Pointwise => "point by point",
            Self::Chunked => "in chunks of records",
            Self::Layered => "in layers",
        }
    }
}

/// The record, checked against the header: a decompressor built from `items` writes records of exactly
/// [`Header::record_len`] bytes.
#[derive(Debug, Clone)]
pub(super) struct LaszipRecord {
    pub(super) arrangement: Arrangement,
    /// Points a chunk, the last one excepted; `None` if each chunk has its own number.
    pub(super) chunk_points: Option<u32>,
    pub(super) items: Vec<Item>,
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
        let items: Result<Vec<Item>, _> = data[FIXED..FIXED + ITEM * count].chunks_exact(ITEM).map(item).collect();
        let items = items?;
        check_items(&items, header, arrangement)?;
        // u32::MAX by the specification; 0 is what lascopcindex writes
        let chunk_points = Some(u32_at(data, 12)).filter(|n| *n != 0 && *n != u32::MAX);
        Ok(Self { arrangement, chunk_points, items })
    }

    /// Layers of a chunk: their sizes stand behind its first record.
    pub(super) fn layers(&self) -> usize {
        self.items.iter().map(layers).sum()
    }
}

fn item(bytes: &[u8]) -> Result<Item, LaszipFault> {
    let number = u16_at(bytes, 0);
    let kind = ItemKind::of_number(number)
        .ok_or_else(|| LaszipFault::Broken(format!("the LASzip record has an item {number}, which is not known")))?;
    Ok(Item { kind, bytes: u16_at(bytes, 2), version: u16_at(bytes, 4) })
}

/// The items must be those of the point format, in order, each of its usual size and a version that is decoded.
fn check_items(items: &[Item], header: &Header, arrangement: Arrangement) -> Result<(), LaszipFault> {
    use ItemKind as K;
    let extra = header.record_len - header.format_len();
    if extra > MAX_EXTRA_BYTES {
        let what = format!("{extra} compressed extra bytes per point are more than the {MAX_EXTRA_BYTES} supported");
        return Err(LaszipFault::Unknown(what));
    }
    let mut expected = match header.point_format {
        0 => vec![K::Point10],
        1 => vec![K::Point10, K::GpsTime11],
        2 => vec![K::Point10, K::Rgb12],
        3 => vec![K::Point10, K::GpsTime11, K::Rgb12],
        4 => vec![K::Point10, K::GpsTime11, K::WavePacket13],
        5 => vec![K::Point10, K::GpsTime11, K::Rgb12, K::WavePacket13],
        6 => vec![K::Point14],
        7 => vec![K::Point14, K::Rgb14],
        8 => vec![K::Point14, K::RgbNir14],
        9 => vec![K::Point14, K::WavePacket14],
        _ => vec![K::Point14, K::RgbNir14, K::WavePacket14],
    };
    let layered = header.point_format >= 6;
    if extra > 0 {
        expected.push(if layered { K::Byte14 } else { K::Byte });
    }
    let found: Vec<K> = items.iter().map(|item| item.kind).collect();
    if found != expected {
        return Err(LaszipFault::Broken(format!(
            "the LASzip items {} are not those of point format {} with records of {} bytes",
            found.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(" "),
            header.point_format,
            header.record_len
        )));
    }
    if let Some(item) = items.iter().find(|item| item.bytes != item.kind.bytes().unwrap_or(extra as u16)) {
        let what = format!("the LASzip item {} claims {} bytes", item.kind.name(), item.bytes);
        return Err(LaszipFault::Broken(what));
    }
    let versions = if layered { 3..=4 } else { 1..=2 };
    let fits = arrangement == Arrangement::Plain || layered == (arrangement == Arrangement::Layered);
    match items.iter().find(|item| !versions.contains(&item.version)) {
        Some(item) if arrangement != Arrangement::Plain => {
            let what = format!("LASzip item {} of version {} is not known", item.kind.name(), item.version);
            Err(LaszipFault::Unknown(what))
        }
        _ if !fits => {
            let what = format!("point format {} cannot be compressed {}", header.point_format, arrangement.words());
            Err(LaszipFault::Broken(what))
        }
        _ => Ok(()),
    }
}

fn layers(item: &Item) -> usize {
    match item.kind {
        ItemKind::Point14 => 9,
        ItemKind::Rgb14 | ItemKind::WavePacket14 => 1,
        ItemKind::RgbNir14 => 2,
        ItemKind::Byte14 => usize::from(item.bytes),
        _ => 0,
    }
}
