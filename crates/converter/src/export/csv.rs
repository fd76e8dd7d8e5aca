//! Text: a line of titles, then a line a point, with commas between the values.

use std::io::Write as _;

use pointmill_format::scan::las::write::Tally;
use pointmill_format::{AttributeType, Changes};

use super::encoder::{Encoder, Place};
use super::fields::{Depth, Field, Value, fields, with_number};
use super::rows::Block;
use crate::error::ConvertError;
use crate::runtime::DiskFile;
use crate::sources::{Schema, Sources};

/// More decimals than this are no decimals but the digits of a double.
const MOST_DECIMALS: usize = 12;

/// Doubles below this, times a power of ten, are exact as integers.
const EXACT: f64 = 4_503_599_627_370_496.0;

/// A text file.
pub(super) struct CsvFile {
    fields: Vec<Field>,
    /// Of each axis; `None`: the shortest text that gives the double back.
    decimals: [Option<usize>; 3],
}

impl CsvFile {
    pub(super) fn new(schema: &Schema, sources: &Sources) -> Self {
        let fields = fields(schema, Depth::Sixteen, |name| name.to_owned());
        Self { fields, decimals: std::array::from_fn(|axis| decimals(sources, axis)) }
    }

    fn titles(&self) -> Vec<u8> {
        let mut out = b"x,y,z".to_vec();
        for field in &self.fields {
            out.push(b',');
            if field.name.contains(['"', ',', '\n', '\r']) {
                let name = field.name.replace('"', "\"\"").replace(['\n', '\r'], " ");
                out.extend(format!("\"{name}\"").bytes());
            } else {
                out.extend(field.name.bytes());
            }
        }
        out.push(b'\n');
        out
    }
}

/// The decimals of the coordinates of all sources on an axis, if they have such.
fn decimals(sources: &Sources, axis: usize) -> Option<usize> {
    let mut most = 0;
    for source in &sources.all {
        let lattice = source.stored.lattice?;
        most = most.max(decimals_of(lattice.scale[axis])?).max(decimals_of(lattice.offset[axis])?);
    }
    Some(most)
}

/// Decimals of a number that has few.
fn decimals_of(value: f64) -> Option<usize> {
    (0..=MOST_DECIMALS).find(|n| format!("{value:.n$}").parse() == Ok(value))
}

/// Appends a number with so many decimals.
fn put_fixed(out: &mut Vec<u8>, value: f64, decimals: usize) {
    let power = 10f64.powi(decimals as i32);
    let scaled = (value * power).round();
    if scaled.abs() < EXACT && decimals > 0 {
        let (whole, rest) = (scaled as i64 / power as i64, (scaled as i64 % power as i64).unsigned_abs());
        let sign = if scaled < 0.0 && whole == 0 { "-" } else { "" };
        // writing to memory cannot fail
        let _ = write!(out, "{sign}{whole}.{rest:0decimals$}");
    } else {
        let _ = write!(out, "{value:.decimals$}");
    }
}

/// Appends the shortest text that gives the number back.
fn put_shortest(out: &mut Vec<u8>, value: impl std::fmt::Display + std::fmt::LowerExp, size: f64) {
    let is_long = size != 0.0 && size.is_finite() && !(1e-5..1e16).contains(&size.abs());
    let _ = if is_long { write!(out, "{value:e}") } else { write!(out, "{value}") };
}

fn put_field(out: &mut Vec<u8>, field: &Field, from: &[u8]) {
    match (field.value, field.ty) {
        (Value::Linear { scale, offset }, ty) => {
            let value = with_number!(from, ty, v => v as f64) * scale + offset;
            put_shortest(out, value, value);
        }
        (_, AttributeType::Float32) => with_number!(from, field.ty, v => put_shortest(out, v as f32, v as f64)),
        (_, AttributeType::Float64) => with_number!(from, field.ty, v => put_shortest(out, v as f64, v as f64)),
        (_, ty) => {
            let _ = with_number!(from, ty, v => write!(out, "{v}"));
        }
    }
}

impl Encoder for CsvFile {
    fn describe(&self) -> String {
        "CSV with a line of titles".to_owned()
    }

    fn places(&self) -> Vec<Place> {
        let place = |field: &Field| Place { attribute: field.attribute, place: format!("column {}", field.name) };
        self.fields.iter().map(place).collect()
    }

    fn start(&self) -> Result<u64, ConvertError> {
        Ok(self.titles().len() as u64)
    }

    fn encode(
        &self,
        block: &Block,
        _: &Schema,
        tally: &mut Tally,
        _: &mut [Changes],
    ) -> Result<Option<Vec<u8>>, ConvertError> {
        let mut out = Vec::with_capacity(block.len() * (36 + 8 * self.fields.len()));
        let world = block.world();
        for i in 0..block.len() {
            for (a, axis) in world.iter().enumerate() {
                if a > 0 {
                    out.push(b',');
                }
                match self.decimals[a] {
                    Some(decimals) => put_fixed(&mut out, axis[i], decimals),
                    None => put_shortest(&mut out, axis[i], axis[i]),
                }
            }
            let row = block.row(i);
            for field in &self.fields {
                out.push(b',');
                put_field(&mut out, field, &row[field.at..]);
            }
            out.push(b'\n');
        }
        tally.count(block.len() as u64);
        Ok(Some(out))
    }

    fn finish(&self, file: &DiskFile, _: &Tally, _: &[(u32, u32)], end: u64) -> Result<u64, ConvertError> {
        file.write_at(&self.titles(), 0, "writing the titles")?;
        Ok(end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_decimals_of_their_lattice_or_come_back() {
        assert_eq!([0.001, 0.01, 500_000.0, 0.25, 1e-7].map(decimals_of), [3, 2, 0, 2, 7].map(Some));
        assert_eq!([0.1 + 0.2, 1.0 / 3.0].map(decimals_of), [None; 2]);
        let fixed = |v, n| {
            let mut out = Vec::new();
            put_fixed(&mut out, v, n);
            String::from_utf8(out).unwrap()
        };
        let cases = [
            (1.5, 3, "1.500"),
            (-0.001, 3, "-0.001"),
            (5_400_000.07, 2, "5400000.07"),
            (-7.0, 0, "-7"),
            (0.3, 1, "0.3"),
        ];
        for (value, n, expected) in cases {
            assert_eq!(fixed(value, n), expected);
        }
        let shortest = |v: f64| {
            let mut out = Vec::new();
            put_shortest(&mut out, v, v);
            String::from_utf8(out).unwrap()
        };
        for v in [0.1, 1e300, 5e-324, -123_456.789, 0.0, 1e-6] {
            assert_eq!(shortest(v).parse(), Ok(v));
            assert!(shortest(v).len() < 25);
        }
    }
}
