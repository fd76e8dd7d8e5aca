//! PCD, the file format of the Point Cloud Library: ascii, binary and compressed binary, versions .5 to .7.
//!
//! Fields `x`, `y`, `z` (case does not count) of any type are positions in double precision; `rgb` and `rgba` packed in
//! a 32-bit number become "rgb" of 0–255 (and "alpha"). Other names mean what they mean in PLY; `_` is padding. A field
//! with a COUNT above 1 becomes an attribute of that many elements; with COUNT 0 it holds nothing. Words, types and
//! encodings of the header count in any case, and its lines may end with LF, CR LF or CR. The sensor's VIEWPOINT is not applied, as in PCL;
//! one that is not the identity is reported in [`ScanInfo::warnings`](crate::ScanInfo::warnings).
//!
//! Ascii files of PCL write a packed colour of TYPE F as that float in decimals, or as the integer of its bits: digits
//! alone are the bits, a point or an exponent makes it the float. One that is NaN there has lost its colour: it is
//! black, and counted ([`PointBatch::changes`](crate::PointBatch::changes)).
//!
//! Where WIDTH times HEIGHT is not POINTS, the one that fits the data is taken, with a warning.
//!
//! A compressed file holds each field of all points together, in one block. It is decompressed once when the file is
//! opened, without being held, to find where pieces can begin; if it is damaged, all points are in one piece, whose decode
//! says what is wrong. Blocks that were stored uncompressed are read, too.
//!
//! Sources: "The PCD (Point Cloud Data) file format", PCL documentation; M. Lehmann's LibLZF for the compression.

mod compressed;
mod header;
mod lzf;
mod place;

use std::path::Path;

use crate::scan::source::Source;
use crate::scan::tabular::{Property, Role, RowScan, Schema, precision, resolutions, settle_float_colours};
use crate::{Advice, AttributeType, Fault, ReadError, Scan};
use header::{Encoding, Header};

pub use header::is_pcd;

/// Opens a PCD file: reads its header; ascii lines are counted, a compressed block is checked, no point is decoded but a
/// sample of those whose colours are floats.
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
    let placed = place::place(&source, &header, &properties, &mut warnings)?;
    let axis = properties.iter().find(|p| p.role == Role::Axis(0)).map_or(AttributeType::Float32, |p| p.ty);
    let version = if header.version.is_empty() { String::new() } else { format!(" {}", header.version) };
    let format = format!("PCD{version}, {}, {} positions", header.encoding.name(), precision(axis));
    let mut scan = RowScan::new(source, format, placed.declared, schema, placed.storage);
    scan.pieces = placed.pieces;
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

impl Encoding {
    fn name(self) -> &'static str {
        match self {
            Self::Ascii => "ascii",
            Self::Binary => "binary",
            Self::Compressed => "binary compressed",
        }
    }
}
