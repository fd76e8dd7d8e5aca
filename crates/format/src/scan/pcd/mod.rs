//! PCD, the file format of the Point Cloud Library: ascii, binary and compressed binary, versions .5 to .7.
//!
//! Fields `x`, `y`, `z` (case does not count) of any type are positions in double precision; `rgb` and `rgba` packed in
//! a 32-bit number become "rgb" of 0–255 (and "alpha"). Other names mean what they mean in PLY; `_` is padding. A field
//! with a COUNT above 1 becomes an attribute of that many elements. The sensor's VIEWPOINT is not applied, as in PCL;
//! one that is not the identity is reported in [`ScanInfo::warnings`](crate::ScanInfo::warnings).
//!
//! A compressed file holds each field of all points together: it is one piece, and decoding it takes memory for its
//! compressed and decompressed bytes (each at most 4 GiB, and the latter at most 88 times the former).
//!
//! Sources: "The PCD (Point Cloud Data) file format", PCL documentation; M. Lehmann's LibLZF for the compression.

mod header;
mod lzf;

use std::path::Path;

use crate::scan::source::Source;
use crate::scan::tabular::{
    Endian, LineRule, Planes, Property, Role, RowScan, Schema, Storage, binary, lines, precision, reconcile,
    resolutions, settle_float_colours,
};
use crate::{Advice, AttributeType, Fault, Piece, ReadError, Scan, ScanWarning};
use header::{Encoding, Header};

pub use header::is_pcd;

/// Opens a PCD file: reads its header; ascii lines are counted, no point is decoded but a sample of those whose
/// colours are floats.
///
/// # Errors
/// Not PCD, a header that makes no sense or is cut short, fields without x and y, a compressed block outside the file.
pub fn open(path: impl AsRef<Path>) -> Result<Box<dyn Scan>, ReadError> {
    let path = path.as_ref();
    let source = Source::open(path)?;
    let header = Header::read(&source)?;
    let mut warnings = header.warnings.clone();
    let properties = properties(&header.fields);
    let schema = Schema::new(&properties, &mut warnings).map_err(|what| {
        ReadError::broken(path, header.fields_at, Fault::NoPositions(format!("the points cannot be placed: {what}")))
            .advise(Advice::ExportPositions)
    })?;
    let (pieces, storage) = place(&source, &header, &properties, &mut warnings)?;
    let axis = properties.iter().find(|p| p.role == Role::Axis(0)).map_or(AttributeType::Float32, |p| p.ty);
    let format = format!("PCD {}, {}, {} positions", header.version, header.encoding.name(), precision(axis));
    let mut scan = RowScan::new(source, format, header.points, schema, storage);
    scan.pieces = pieces;
    scan.info.warnings = warnings;
    scan.info.resolution = resolutions(&properties);
    settle_float_colours(&mut scan);
    Ok(Box::new(scan))
}

/// The fields with their places in a record.
fn properties(fields: &[header::Field]) -> Vec<Property> {
    let mut at = 0;
    let with_place = |f: &header::Field| {
        let mut property = Property { at, elements: f.count, ..Property::new(&f.name, f.ty) };
        if f.name == "_" {
            property.role = Role::Padding;
        }
        at += f.ty.size() * f.count;
        property
    };
    fields.iter().map(with_place).collect()
}

fn place(
    source: &Source,
    header: &Header,
    properties: &[Property],
    warnings: &mut Vec<ScanWarning>,
) -> Result<(Vec<Piece>, Storage), ReadError> {
    let stride: usize = properties.iter().map(|p| p.ty.size() * p.elements).sum();
    match header.encoding {
        Encoding::Ascii => {
            let separator = ascii_separator(source, header.end)?;
            let index = lines::index(source, header.end, header.points, is_row)?;
            reconcile(header.points, index.rows, warnings);
            let rule = LineRule::new(separator, is_row);
            Ok((index.pieces, Storage::Lines(rule)))
        }
        Encoding::Binary => {
            let there = (source.len() - header.end) / stride as u64;
            let points = reconcile(header.points, there, warnings);
            let pieces = binary::pieces(header.end, stride as u64, points);
            Ok((pieces, Storage::Records { stride, endian: Endian::Little }))
        }
        Encoding::Compressed => {
            let pieces = compressed_piece(source, header, stride)?;
            let per_field = properties.iter().flat_map(|p| {
                let width = p.ty.size() * p.elements;
                std::iter::repeat_n((p.at, width), p.elements)
            });
            let planes =
                Planes { points: header.points, properties: per_field.collect(), stride, decompress: lzf::decompress };
            Ok((pieces, Storage::Planes(planes)))
        }
    }
}

fn is_row(line: &[u8]) -> bool {
    lines::is_filled(line) && line.first() != Some(&b'#')
}

/// Blanks by the book; files with commas exist.
fn ascii_separator(source: &Source, from: u64) -> Result<Option<u8>, ReadError> {
    let first = lines::first_filled(source, from, 1)?;
    Ok(first.first().filter(|(_, line)| line.contains(&b',')).map(|_| b','))
}

/// The one piece of a compressed file: two lengths, then the block.
fn compressed_piece(source: &Source, header: &Header, stride: usize) -> Result<Vec<Piece>, ReadError> {
    if header.points == 0 {
        return Ok(Vec::new());
    }
    let broken = |at: u64, what: String| ReadError::broken(source.path(), at, what);
    if source.len() < header.end + 8 {
        return Err(broken(source.len(), "the compressed block is missing".to_owned()).advise(Advice::CutShort));
    }
    let [c0, c1, c2, c3, d0, d1, d2, d3] = source.array_at::<8>(header.end)?;
    let byte_len = u64::from(u32::from_le_bytes([c0, c1, c2, c3]));
    let decompressed = u64::from(u32::from_le_bytes([d0, d1, d2, d3]));
    let byte_offset = header.end + 8;
    if byte_len > source.len() - byte_offset {
        let there = source.len() - byte_offset;
        return Err(
            broken(source.len(), format!("{there} of {byte_len} compressed bytes are there")).advise(Advice::CutShort)
        );
    }
    if header.points.checked_mul(stride as u64) != Some(decompressed) || decompressed > lzf::most(byte_len) {
        let what = format!(
            "{} points of {stride} bytes cannot be in a block of {byte_len} bytes that claims to become {decompressed}",
            header.points
        );
        return Err(broken(header.end, what).advise(Advice::Damaged));
    }
    Ok(vec![Piece { first_point: 0, points: header.points, byte_offset, byte_len }])
}

impl Encoding {
    fn name(self) -> &'static str {
        match self {
            Self::Ascii => "ascii",
            Self::Binary => "binary",
            Self::Compressed => "binary compressed",
        }
    }
}
