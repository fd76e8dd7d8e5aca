//! PLY, the Stanford polygon format: ascii and binary of both byte orders.
//!
//! Lines of the header may end with LF, CR LF or CR, and words in it count in any case. An ascii body is a stream of
//! numbers: as a rule a row has its line, but it may take several or share one.
//!
//! [`open`] reads the header, finds the vertices among the elements (others may stand before and behind, lists
//! included) and cuts them into pieces; faces are not read.
//!
//! * x, y, z of any type are positions in double precision. Without z all points lie at 0 (with a warning).
//! * `red`, `green`, `blue` (also `r`, `g`, `b`, `diffuse_*`) become "rgb": 8- and 16-bit values as they are, floats of
//!   0–1 as 0–65535. Floats above 1 in a sample of the file mean that all are integers.
//! * `nx`, `ny`, `nz` become "NormalX", "NormalY", "NormalZ" in single precision; `intensity` stays `uint16` or becomes a
//!   float; `classification` becomes `uint8`. What else there is keeps name and type (also CloudCompare's `scalar_*`).
//! * Gaussian splats keep all that they have (`f_dc_*`, `f_rest_*`, `opacity`, `scale_*`, `rot_*`). Without another colour
//!   "rgb" is 0.5 + 0.28209479177387814 · `f_dc`, cut to 0–1, as 0–255, with a warning. Compressed ones (`packed_position`, …,
//!   and an element `chunk`) are unpacked to these, with `alpha` of 0–255 in place of `opacity`.
//! * Fewer vertices than declared are reported in [`ScanInfo::warnings`](crate::ScanInfo::warnings), and read.
//!
//! ```no_run
//! use pointmill_format::scan::ply;
//! use pointmill_format::{Scan, Scratch, Wanted};
//! use std::ops::ControlFlow;
//!
//! let scan = ply::open("scan.ply")?;
//! let (wanted, mut scratch, mut points) = (Wanted::all(scan.info()), Scratch::default(), 0);
//! for piece in 0..scan.pieces().len() {
//!     scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
//!         points += batch.len();
//!         ControlFlow::Continue(())
//!     })?;
//! }
//! # Ok::<(), pointmill_format::ReadError>(())
//! ```
//!
//! Source: G. Turk, "The PLY Polygon File Format", 1994; the type names of both its generations.

mod header;
mod splats;
mod vertices;

use std::path::Path;

use crate::scan::source::Source;
use crate::scan::tabular::{
    Property, RowScan, Schema, Storage, binary, precision, reconcile, resolutions, settle_float_colours,
};
use crate::{Advice, AttributeType, Fault, ReadError, Resolution, Scan};
use header::{Encoding, Header, Kind};

pub use header::is_ply;

/// Opens a PLY file: reads its header, and finds the vertices; ascii lines are counted, no point is decoded but a
/// sample of those whose colours are floats.
///
/// # Errors
/// Not PLY, a header that is cut short or makes no sense, no vertices, vertices without x and y.
pub fn open(path: impl AsRef<Path>) -> Result<Box<dyn Scan>, ReadError> {
    let path = path.as_ref();
    let source = Source::open(path)?;
    let header = Header::read(&source)?;
    let mut warnings = header.warnings.clone();
    let vertices = header.vertices(&source)?;
    if splats::are_compressed(&header.elements[vertices]) {
        return compressed_splats(source, &header, vertices);
    }
    let properties = properties(&header.elements[vertices].properties);
    let schema = Schema::new(&properties, &mut warnings).map_err(|what| {
        ReadError::broken(
            path,
            header.elements[vertices].at,
            Fault::NoPositions(format!("the vertices cannot be placed: {what}")),
        )
        .advise(Advice::ExportPositions)
    })?;
    let placed = vertices::place(&source, &header, vertices, &properties, &mut warnings)?;
    let axis = properties
        .iter()
        .find(|p| p.role == crate::scan::tabular::Role::Axis(0))
        .map_or(AttributeType::Float32, |p| p.ty);
    let format = format!("PLY 1.0, {}, {} positions", header.encoding.name(), precision(axis));
    let mut scan = RowScan::new(source, format, header.elements[vertices].count, schema, placed.storage);
    scan.pieces = placed.pieces;
    scan.info.warnings = warnings;
    scan.info.resolution = resolutions(&properties);
    settle_float_colours(&mut scan);
    Ok(Box::new(scan))
}

/// Splats that are unpacked as they are read.
fn compressed_splats(source: Source, header: &Header, vertices: usize) -> Result<Box<dyn Scan>, ReadError> {
    let splats = splats::Splats::find(&source, header, vertices)?;
    let declared = header.elements[vertices].count;
    let mut warnings = header.warnings.clone();
    let points = reconcile(declared, splats.there(&source), &mut warnings);
    let (start, stride) = splats.rows();
    let schema = Schema::new(&splats.properties(), &mut warnings)
        .map_err(|what| ReadError::broken(source.path(), header.end, what).advise(Advice::ExportAgain))?;
    let format = format!("PLY 1.0, {}, compressed splats", header.encoding.name());
    let mut scan = RowScan::new(source, format, declared, schema, Storage::Unpacked(Box::new(splats)));
    scan.pieces = binary::pieces(start, stride, points);
    scan.info.warnings = warnings;
    // between bounds in single precision
    scan.info.resolution = [Resolution::Single; 3];
    Ok(Box::new(scan))
}

/// The properties of the vertices, with their places in a record without its lists.
fn properties(declared: &[header::Property]) -> Vec<Property> {
    let mut at = 0;
    let mut list = Vec::with_capacity(declared.len());
    for p in declared {
        let mut property = match p.kind {
            Kind::Scalar(ty) => Property { at, ..Property::new(&p.name, ty) },
            Kind::List { count, .. } => Property { list: true, ..Property::new(&p.name, count) },
        };
        // colours have no sign, whatever their type is called
        if matches!(property.role, crate::scan::tabular::Role::Colour(_)) && property.ty == AttributeType::Int8 {
            property.ty = AttributeType::UInt8;
        }
        if !property.list {
            at += property.ty.size();
        }
        list.push(property);
    }
    list
}

impl Encoding {
    fn name(self) -> &'static str {
        match self {
            Self::Ascii => "ascii",
            Self::BinaryLittle => "binary little-endian",
            Self::BinaryBig => "binary big-endian",
        }
    }
}
