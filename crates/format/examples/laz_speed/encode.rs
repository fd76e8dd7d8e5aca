//! Points of format 3 in another format, compressed by `laz`.

use std::io::Cursor;

use laz::{LasZipCompressor, LasZipDecompressor, LazItemRecordBuilder, LazVlr};

use crate::Result;

/// Bytes of a record without extra bytes, by point format.
pub(crate) const RECORD_LEN: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Where the records of variable length begin.
const HEADER_LEN: usize = 375;
const VLR_HEAD: usize = 54;

/// A point format, and a number of extra bytes.
pub(crate) type Format = (u8, u16);

/// Formats as the command line has them: `3,7+4`.
pub(crate) fn formats(list: &str) -> Result<Vec<Format>> {
    let format = |word: &str| -> Result<Format> {
        let (number, extra) = word.split_once('+').unwrap_or((word, "0"));
        match (number.parse()?, extra.parse()?) {
            (number @ (0..=3 | 6..=8), extra) => Ok((number, extra)),
            _ => Err(format!("{word}: formats are 0 to 3 and 6 to 8").into()),
        }
    };
    list.split(',').map(format).collect()
}

/// What is needed of the header of a file.
pub(crate) struct Head {
    pub(crate) format: u8,
    pub(crate) record_len: usize,
    pub(crate) points_start: usize,
    pub(crate) points: usize,
}

fn u16_at(bytes: &[u8], at: usize) -> usize {
    usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]))
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u16_at(bytes, at) | u16_at(bytes, at + 2) << 16
}

impl Head {
    pub(crate) fn read(file: &[u8]) -> Result<Self> {
        if file.len() < HEADER_LEN || !file.starts_with(b"LASF") {
            return Err("not a LAS file, or too short".into());
        }
        // of LAS 1.4: 64 bits, of which 32 are enough here
        let points = if file[25] >= 4 { u32_at(file, 247) } else { u32_at(file, 107) };
        let [record_len, points_start] = [u16_at(file, 105), u32_at(file, 96)];
        Ok(Self { format: file[104] & 0x3f, record_len, points_start, points })
    }

    /// The LASzip record.
    pub(crate) fn laszip<'a>(&self, file: &'a [u8]) -> Result<&'a [u8]> {
        let mut at = u16_at(file, 94);
        while at + VLR_HEAD < self.points_start {
            let end = at + VLR_HEAD + u16_at(file, at + 20);
            if file[at + 2..].starts_with(LazVlr::USER_ID.as_bytes()) {
                return Ok(&file[at + VLR_HEAD..end]);
            }
            at = end;
        }
        Err("no LASzip record".into())
    }
}

/// The points of a file of format 3 as a LAZ file of another format.
pub(crate) fn file(source: &[u8], format: Format) -> Result<Vec<u8>> {
    let head = Head::read(source)?;
    if head.format != 3 {
        return Err("points can be encoded anew from format 3 alone".into());
    }
    let mut plain = vec![0; head.points * head.record_len];
    let compressed = &source[head.points_start..];
    match head.laszip(source) {
        Err(_) => plain.copy_from_slice(&compressed[..head.points * head.record_len]),
        Ok(laszip) => {
            let mut source = Cursor::new(source);
            source.set_position(head.points_start as u64);
            LasZipDecompressor::new(source, LazVlr::from_buffer(laszip)?)?.decompress_many(&mut plain)?;
        }
    }
    let (number, extra) = format;
    let vlr = LazVlr::from_laz_items(LazItemRecordBuilder::default_for_point_format_id(number, extra)?);
    let mut laszip = Cursor::new(Vec::new());
    vlr.write_to(&mut laszip)?;
    let laszip = laszip.into_inner();

    let mut out = header(source, &head, format);
    out.extend([0, 0]);
    out.extend(b"laszip encoded\0\0");
    out.extend([LazVlr::RECORD_ID, laszip.len() as u16].map(u16::to_le_bytes).as_flattened());
    out.extend([0; 32]);
    out.extend(laszip);
    let start = out.len() as u32;
    out[96..100].copy_from_slice(&start.to_le_bytes());
    let mut out = Cursor::new(out);
    out.set_position(u64::from(start));
    let mut encoder = LasZipCompressor::new(out, vlr)?;
    let mut record = Vec::new();
    for (i, point) in plain.chunks_exact(head.record_len).enumerate() {
        convert(point, i, format, &mut record);
        encoder.compress_one(&record)?;
    }
    encoder.done()?;
    Ok(encoder.into_inner().into_inner())
}

/// A header of LAS 1.4, with scale, offset and bounds of the source.
fn header(source: &[u8], head: &Head, (number, extra): Format) -> Vec<u8> {
    let mut out = source[..227].to_vec();
    out.resize(HEADER_LEN, 0);
    out[24..26].copy_from_slice(&[1, 4]);
    out[94..96].copy_from_slice(&(HEADER_LEN as u16).to_le_bytes());
    out[100..104].copy_from_slice(&1u32.to_le_bytes());
    out[104] = number | 0x80;
    out[105..107].copy_from_slice(&(RECORD_LEN[usize::from(number)] as u16 + extra).to_le_bytes());
    out[107..131].fill(0);
    out[247..255].copy_from_slice(&(head.points as u64).to_le_bytes());
    out
}

/// Point `i`, of format 3, in another format.
fn convert(point: &[u8], i: usize, (number, extra): Format, out: &mut Vec<u8>) {
    let (time, rgb) = (&point[20..28], &point[28..34]);
    out.clear();
    match number {
        0..=3 => out.extend(&point[..20]),
        _ => {
            let (returns, class, angle) = (point[14], point[15], point[16].cast_signed());
            out.extend(&point[..14]);
            out.extend([returns & 7 | (returns >> 3 & 7) << 4, class >> 5 | returns & 0xc0, class & 31, point[17]]);
            out.extend(((f32::from(angle) / 0.006) as i16).to_le_bytes());
            out.extend(&point[18..20]);
        }
    }
    if !matches!(number, 0 | 2) {
        out.extend(time);
    }
    if matches!(number, 2 | 3 | 7 | 8) {
        out.extend(rgb);
    }
    if number == 8 {
        // near infrared: much as green
        let green = u16::from_le_bytes([rgb[2], rgb[3]]);
        out.extend((green / 2 + green / 4 + noise(i, 0) % 512).to_le_bytes());
    }
    // extra bytes: numbers of 16 bits as the amplitudes and deviations of echoes
    let intensity = u16::from_le_bytes([point[12], point[13]]);
    for e in 0..usize::from(extra) {
        let value = if e & 2 == 0 { intensity / 2 + noise(i, e / 2) % 16 } else { noise(i, e / 2) % 24 };
        out.push(value.to_le_bytes()[e & 1]);
    }
}

fn noise(i: usize, stream: usize) -> u16 {
    ((i as u32 ^ (stream as u32) << 27).wrapping_mul(0x9e37_79b1) >> 15) as u16
}
