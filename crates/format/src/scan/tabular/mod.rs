//! Points stored as rows of numbers, binary or text: what PLY, PCD, XYZ, PTS, PTX and OFF have in common.
//!
//! A reader parses its header into a [`Schema`] (which number of a row goes where) and a [`Storage`] (how rows lie in
//! the file), cuts the file into pieces with [`binary::pieces`] or [`lines::index`], and leaves the rest to [`RowScan`].
//!
//! Positions are world coordinates in double precision. A number written as text keeps its decimals even where the
//! header declares single precision. NaN and infinite positions pass; what to do with them is the caller's policy.

pub(crate) mod ascii;
pub(crate) mod binary;
mod decimal_mark;
pub(crate) mod header_lines;
mod line_reader;
pub(crate) mod lines;
mod lists;
mod names;
pub(crate) mod number;
mod planes;
mod probe;
mod scan;
mod schema;
pub(crate) mod stream;
pub(crate) mod text_rows;

pub(crate) use decimal_mark::DecimalMark;
pub(crate) use lists::Part;
pub(crate) use names::{Role, las_type, role};
pub(crate) use number::Endian;
pub(crate) use planes::{Plane, PlaneReader, PlaneRule, Planes};
pub(crate) use probe::{ColumnRange, probe_rows, settle_float_colours};
pub(crate) use scan::{LineRule, Pose, RowScan, Storage, Unpack};
pub(crate) use schema::{Field, MAX_FIELDS, Property, Rule, Schema, Target};

use crate::scan::source::Source;
use crate::{Counted, ReadError, ScanWarning};

/// Warns if the file holds another number of points than it declares; returns the number to read.
pub(crate) fn reconcile(declared: u64, there: u64, warnings: &mut Vec<ScanWarning>) -> u64 {
    if there < declared {
        warnings.push(ScanWarning::PointsMissing { declared, found: there, counted: Counted::Rows });
    }
    declared.min(there)
}

/// Bytes behind the points of a text that are looked at: blank lines are nothing.
const BEHIND: u64 = 64 << 10;

/// Warns if more than blanks follows the `declared` points of a text, which end before byte `end`.
pub(crate) fn warn_of_bytes_behind(
    source: &Source,
    end: u64,
    declared: u64,
    warnings: &mut Vec<ScanWarning>,
) -> Result<(), ReadError> {
    if source.vec_at(end, BEHIND)?.iter().any(|b| *b > b' ') {
        warnings.push(ScanWarning::BytesIgnored { declared, bytes: source.len() - end });
    }
    Ok(())
}

/// How finely the positions among `properties` are stored, per axis; an axis that is not there is zero.
pub(crate) fn resolutions(properties: &[Property]) -> [crate::Resolution; 3] {
    std::array::from_fn(|axis| {
        let property = properties.iter().find(|p| p.role == Role::Axis(axis));
        property.map_or(crate::Resolution::Single, |p| resolution(p.ty))
    })
}

/// How finely positions of that type are stored.
fn resolution(ty: crate::AttributeType) -> crate::Resolution {
    use crate::AttributeType as T;
    match ty {
        T::Float32 => crate::Resolution::Single,
        T::Float64 => crate::Resolution::Double,
        _ => crate::Resolution::Grid(crate::AxisGrid { step: 1.0, offset: 0.0 }),
    }
}

/// The kind of number that positions are, for people.
pub(crate) fn precision(ty: crate::AttributeType) -> &'static str {
    use crate::AttributeType as T;
    match ty {
        T::Float32 => "float32",
        T::Float64 => "float64",
        _ => "integer",
    }
}
