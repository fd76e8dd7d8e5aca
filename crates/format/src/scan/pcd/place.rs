//! Where the points lie, and how many are there.

use super::compressed::{self, Compressed};
use super::header::{Encoding, Header};
use super::lzf::Block;
use crate::scan::source::Source;
use crate::scan::tabular::header_lines::header_lines;
use crate::scan::tabular::stream::{RowShape, Rows};
use crate::scan::tabular::text_rows::{self, TextRows};
use crate::scan::tabular::{
    Endian, LineRule, Plane, PlaneRule, Property, Storage, binary, lines, reconcile, warn_of_bytes_behind,
};
use crate::{Piece, ReadError, ScanWarning};

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

/// Two lengths, then the block, which holds the values of each field together.
fn compressed(
    source: &Source,
    header: &Header,
    properties: &[Property],
    warnings: &mut Vec<ScanWarning>,
) -> Result<Placed, ReadError> {
    let stride = header.stride() as u64;
    let empty = Block { at: header.end, len: 0, decompressed: 0 };
    let block = if header.points == 0 { empty } else { compressed::block(source, header.end, header.points, stride)? };
    let total = block.decompressed.checked_div(stride).unwrap_or(0);
    let declared = declared(header, total, warnings);
    let points = reconcile(declared, total, warnings);
    if total > points {
        let bytes = (total - points) * stride;
        warnings.push(ScanWarning::BytesIgnored { declared, bytes });
    }
    let planes: Vec<_> = properties.iter().map(|p| Plane { at: p.at, width: p.ty.size() * p.elements }).collect();
    let of_field = properties.iter().enumerate().flat_map(|(i, p)| std::iter::repeat_n(i, p.elements)).collect();
    let compressed = Compressed::new(source, block, total, planes.clone())?;
    let pieces = compressed.pieces(points);
    let storage = Storage::Planes(PlaneRule { planes: Box::new(compressed), properties: planes, of_field });
    Ok(Placed { declared, pieces, storage })
}
