//! Where the points lie, and how many are there.

use super::header::{Encoding, Header};
use super::lzf;
use crate::scan::source::Source;
use crate::scan::tabular::header_lines::header_lines;
use crate::scan::tabular::stream::{RowShape, Rows};
use crate::scan::tabular::text_rows::{self, TextRows};
use crate::scan::tabular::{
    Endian, LineRule, Planes, Property, Storage, binary, lines, reconcile, warn_of_bytes_behind,
};
use crate::{Advice, Piece, ReadError, ScanWarning};

/// Bytes of text in which the first row is.
const FIRST_ROW: u64 = 64 << 10;

/// The pieces and how to read them.
pub(super) struct Placed {
    /// As the header declares them; where it says two numbers, the one that is there.
    pub(super) declared: u64,
    pub(super) pieces: Vec<Piece>,
    pub(super) storage: Storage,
}

/// Finds the points and cuts them into pieces.
pub(super) fn place(
    source: &Source,
    header: &Header,
    properties: &[Property],
    warnings: &mut Vec<ScanWarning>,
) -> Result<Placed, ReadError> {
    match header.encoding {
        Encoding::Ascii => ascii(source, header, warnings),
        Encoding::Binary => Ok(binary(source, header, warnings)),
        Encoding::Compressed => compressed(source, header, properties, warnings),
    }
}

/// The number of points that the header declares: POINTS, unless as many are there as WIDTH times HEIGHT says.
fn declared(header: &Header, there: u64, warnings: &mut Vec<ScanWarning>) -> u64 {
    let Some((width, height)) = header.grid else { return header.points };
    let points = header.points;
    let taken = if width.checked_mul(height) == Some(there) { there } else { points };
    warnings.push(ScanWarning::GridSize { width, height, points, taken });
    taken
}

fn binary(source: &Source, header: &Header, warnings: &mut Vec<ScanWarning>) -> Placed {
    let stride = header.stride();
    let bytes = source.len() - header.end;
    let there = bytes / stride as u64;
    let declared = declared(header, there, warnings);
    let points = reconcile(declared, there, warnings);
    if there > points {
        warnings.push(ScanWarning::BytesIgnored { declared, bytes: bytes - points * stride as u64 });
    }
    let pieces = binary::pieces(header.end, stride as u64, points);
    Placed { declared, pieces, storage: Storage::Records { stride, endian: Endian::Little } }
}

fn ascii(source: &Source, header: &Header, warnings: &mut Vec<ScanWarning>) -> Result<Placed, ReadError> {
    let product = header.grid.map_or(0, |(w, h)| w.saturating_mul(h));
    let mut found = rows(source, header, header.points.max(product))?;
    let declared = declared(header, found.rows, warnings);
    if found.rows > declared {
        found = rows(source, header, declared)?;
    }
    reconcile(declared, found.rows, warnings);
    warn_of_bytes_behind(source, found.end, declared, warnings)?;
    Ok(Placed { declared, pieces: found.pieces, storage: found.storage })
}

/// At most `count` rows.
fn rows(source: &Source, header: &Header, count: u64) -> Result<TextRows, ReadError> {
    let start = header.end;
    if let Some(separator) = separator(source, start)? {
        let index = lines::index(source, start, count, is_row)?;
        let storage = Storage::Lines(LineRule::new(Some(separator), is_row));
        return Ok(TextRows { pieces: index.pieces, rows: index.rows, end: index.end, storage });
    }
    let shape = RowShape::plain(header.fields.iter().map(|f| f.count).sum());
    text_rows::place(source, start, is_row, &[], &Rows { shape, count }, &[])
}

fn is_row(line: &[u8]) -> bool {
    lines::is_filled(line) && line.first() != Some(&b'#')
}

/// Blanks by the book (`None`); files with commas exist.
fn separator(source: &Source, from: u64) -> Result<Option<u8>, ReadError> {
    let start = source.vec_at(from, FIRST_ROW)?;
    let first = header_lines(&start).map(|line| line.text).find(|text| is_row(text)).unwrap_or_default();
    Ok(first.contains(&b',').then_some(b','))
}

/// One piece: two lengths, then the block, which holds the values of each field together.
fn compressed(
    source: &Source,
    header: &Header,
    properties: &[Property],
    warnings: &mut Vec<ScanWarning>,
) -> Result<Placed, ReadError> {
    let stride = header.stride();
    let (byte_len, total) = if header.points == 0 { (0, 0) } else { block(source, header, stride as u64)? };
    let declared = declared(header, total, warnings);
    let points = reconcile(declared, total, warnings);
    if total > points {
        let bytes = (total - points) * stride as u64;
        warnings.push(ScanWarning::BytesIgnored { declared, bytes });
    }
    let per_field = properties.iter().flat_map(|p| {
        let width = p.ty.size() * p.elements;
        std::iter::repeat_n((p.at, width), p.elements)
    });
    let planes = Planes { points: total, properties: per_field.collect(), stride, decompress };
    let piece = Piece { first_point: 0, points, byte_offset: header.end + 8, byte_len };
    let pieces = if points > 0 { vec![piece] } else { Vec::new() };
    Ok(Placed { declared, pieces, storage: Storage::Planes(planes) })
}

/// Bytes of the compressed block, and points in it.
fn block(source: &Source, header: &Header, stride: u64) -> Result<(u64, u64), ReadError> {
    let broken = |at: u64, what: String| ReadError::broken(source.path(), at, what);
    let start = header.end + 8;
    if source.len() < start {
        return Err(broken(source.len(), "the compressed block is missing".to_owned()).advise(Advice::CutShort));
    }
    let [c0, c1, c2, c3, d0, d1, d2, d3] = source.array_at::<8>(header.end)?;
    let byte_len = u64::from(u32::from_le_bytes([c0, c1, c2, c3]));
    let decompressed = u64::from(u32::from_le_bytes([d0, d1, d2, d3]));
    let there = source.len() - start;
    if byte_len > there {
        let what = format!("{there} of {byte_len} compressed bytes are there");
        return Err(broken(source.len(), what).advise(Advice::CutShort));
    }
    if !decompressed.is_multiple_of(stride) || decompressed > lzf::most(byte_len) {
        let points = header.points;
        let what = format!(
            "{points} points of {stride} bytes cannot be in a block of {byte_len} bytes that claims to become {decompressed}"
        );
        return Err(broken(header.end, what).advise(Advice::Damaged));
    }
    Ok((byte_len, decompressed / stride))
}

/// [`lzf::decompress`], and blocks that writers stored as they are because compression would not have made them smaller.
fn decompress(block: &[u8], len: usize, out: &mut Vec<u8>) -> Result<(), String> {
    let done = lzf::decompress(block, len, out);
    if done.is_err() && block.len() == len {
        out.clear();
        out.extend_from_slice(block);
        return Ok(());
    }
    done
}
