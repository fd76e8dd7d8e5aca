//! Binary rows to columns, one tight loop for each number of a row.

use super::number::{Endian, Number, count_change, unit_to_u16};
use super::schema::{Field, Rule, Target};
use crate::{AttributeType, Changes, Column, Element, Piece, PointBatch, Positions, Wanted};

/// Points of a piece of binary rows: one batch, some MB.
pub(crate) const PIECE_POINTS: u64 = 50_000;

/// Pieces over `points` rows of `stride` bytes from byte `start` on.
pub(crate) fn pieces(start: u64, stride: u64, points: u64) -> Vec<Piece> {
    let firsts = (0..points).step_by(PIECE_POINTS as usize);
    firsts
        .map(|first_point| {
            let points = PIECE_POINTS.min(points - first_point);
            Piece { first_point, points, byte_offset: start + first_point * stride, byte_len: points * stride }
        })
        .collect()
}

/// A value that its column cannot hold.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Misfit {
    /// Row, counted from the first one given.
    pub(crate) row: usize,
    /// Where in the row (binary: its byte in the record; text: its byte in the line).
    pub(crate) at: usize,
    /// The value and what was expected.
    pub(crate) what: String,
}

/// Where the rows of one column lie: every `stride` bytes.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) stride: usize,
    pub(crate) endian: Endian,
}

impl<'a> Rows<'a> {
    /// The bytes of a number `at` bytes into each row.
    fn numbers<const N: usize>(self, at: usize) -> impl Iterator<Item = &'a [u8]> {
        self.bytes.chunks_exact(self.stride.max(1)).map(move |row| row.get(at..at + N).unwrap_or_default())
    }
}

/// Writes `rows` to the batch from its row `first` on; the columns have room. Columns that are not wanted stay as
/// they are.
pub(crate) fn fill(
    rows: Rows<'_>,
    fields: &[Field],
    wanted: &Wanted,
    first: usize,
    batch: &mut PointBatch,
) -> Result<(), Misfit> {
    fields.iter().try_for_each(|field| field_to_column(rows, field, wanted, first, batch))
}

/// Runs `$body` with `$t` being the Rust type of `$ty` and `N` its bytes.
macro_rules! with_type {
    ($ty:expr, $t:ident => $body:expr) => {{
        macro_rules! arm {
            ($rust:ty) => {{
                type $t = $rust;
                const N: usize = size_of::<$rust>();
                $body
            }};
        }
        match $ty {
            AttributeType::Int8 => arm!(i8),
            AttributeType::UInt8 => arm!(u8),
            AttributeType::Int16 => arm!(i16),
            AttributeType::UInt16 => arm!(u16),
            AttributeType::Int32 => arm!(i32),
            AttributeType::UInt32 => arm!(u32),
            AttributeType::Int64 => arm!(i64),
            AttributeType::UInt64 => arm!(u64),
            AttributeType::Float32 => arm!(f32),
            AttributeType::Float64 => arm!(f64),
        }
    }};
}

/// Writes one number of each row to its place.
pub(crate) fn field_to_column(
    rows: Rows<'_>,
    field: &Field,
    wanted: &Wanted,
    first: usize,
    batch: &mut PointBatch,
) -> Result<(), Misfit> {
    let is_wanted = |column: usize| wanted.is_wanted(column);
    match field.target {
        Target::Skip | Target::List => Ok(()),
        Target::Axis(axis) => {
            let Positions::World(xyz) = &mut batch.positions else { return Ok(()) };
            let Some(out) = xyz[axis].get_mut(first..) else { return Ok(()) };
            with_type!(field.ty, T => {
                for (out, bytes) in out.iter_mut().zip(rows.numbers::<N>(field.at)) {
                    *out = T::read(bytes, rows.endian).as_f64();
                }
            });
            Ok(())
        }
        Target::Packed { column, alpha } => {
            let wanted = (Some(column).filter(|c| is_wanted(*c)), alpha.filter(|c| is_wanted(*c)));
            packed(rows, field.at, wanted, first, batch);
            Ok(())
        }
        Target::Harmonic { value, colour, element } => {
            let kept = Target::Value { column: value, element: 0, rule: Rule::Keep };
            let seen = Target::Value { column: colour, element, rule: Rule::Harmonic };
            [kept, seen]
                .into_iter()
                .try_for_each(|target| field_to_column(rows, &Field { target, ..*field }, wanted, first, batch))
        }
        Target::Value { column, .. } if !is_wanted(column) => Ok(()),
        Target::Value { column, element, rule } => {
            let elements = batch.columns[column].len().checked_div(batch.len()).unwrap_or(1).max(1);
            let place = Place { at: field.at, element, elements, first };
            let values = &mut batch.columns[column];
            with_type!(field.ty, T => place.fill::<T, N>(rows, rule, values))?;
            if is_float(field.ty) && !is_float(values.ty()) && rule != Rule::Harmonic {
                let mut changes = Changes::default();
                with_type!(field.ty, T => {
                    let numbers = rows.numbers::<N>(field.at).map(|bytes| T::read(bytes, rows.endian).as_f64());
                    numbers.for_each(|v| count_change(v, rule == Rule::Unit, &mut changes));
                });
                batch.count_changes(column, &changes);
            }
            Ok(())
        }
    }
}

fn is_float(ty: AttributeType) -> bool {
    matches!(ty, AttributeType::Float32 | AttributeType::Float64)
}

/// Where the values of a number go in a column.
struct Place {
    at: usize,
    element: usize,
    elements: usize,
    first: usize,
}

impl Place {
    fn fill<T: Number + Element, const N: usize>(
        &self,
        rows: Rows<'_>,
        rule: Rule,
        column: &mut Column,
    ) -> Result<(), Misfit> {
        let read = |bytes: &[u8]| T::read(bytes, rows.endian);
        let numbers = || rows.numbers::<N>(self.at).map(read);
        let wrong = match (rule, column) {
            (Rule::Keep, column) => {
                if let Some(out) = column.values_mut::<T>() {
                    self.slots(out).zip(numbers()).for_each(|(out, v)| *out = v);
                }
                None
            }
            (Rule::Unit, Column::UInt16(out)) => self.checked(out, numbers(), |v| unit_to_u16(v.as_f64())),
            (Rule::Harmonic, Column::UInt16(out)) => {
                self.checked(out, numbers(), |v| Some(harmonic_colour(v.as_f64())))
            }
            (Rule::Shift, Column::UInt16(out)) => self.checked(out, numbers(), |v| (v.as_f64() + 2048.0).as_u16()),
            (_, Column::UInt16(out)) => self.checked(out, numbers(), T::as_u16),
            (_, Column::UInt8(out)) => self.checked(out, numbers(), T::as_u8),
            (_, Column::Float32(out)) => {
                self.slots(out).zip(numbers()).for_each(|(out, v)| *out = v.as_f64() as f32);
                None
            }
            (_, Column::Float64(out)) => {
                self.slots(out).zip(numbers()).for_each(|(out, v)| *out = v.as_f64());
                None
            }
            _ => None,
        };
        let Some(row) = wrong else { return Ok(()) };
        let value = numbers().nth(row).map_or(f64::NAN, T::as_f64);
        Err(Misfit { row, at: self.at, what: out_of_range(value, rule) })
    }

    fn slots<'a, V>(&self, out: &'a mut [V]) -> impl Iterator<Item = &'a mut V> {
        let start = (self.first * self.elements + self.element).min(out.len());
        out[start..].iter_mut().step_by(self.elements)
    }

    /// Converts; the first row whose value does not fit, if one does not.
    fn checked<T, V: Default>(
        &self,
        out: &mut [V],
        numbers: impl Iterator<Item = T>,
        convert: impl Fn(T) -> Option<V>,
    ) -> Option<usize> {
        let mut wrong = None;
        for (row, (out, v)) in self.slots(out).zip(numbers).enumerate() {
            *out = convert(v).unwrap_or_else(|| {
                wrong.get_or_insert(row);
                V::default()
            });
        }
        wrong
    }
}

/// The first spherical harmonic, which is the same in all directions: ½ √(1/π).
pub(crate) const BAND_0: f64 = 0.282_094_791_773_878_14;

/// A splat's colour of 0–255 from its constant harmonic; NaN is 0.
#[inline]
pub(crate) fn harmonic_colour(v: f64) -> u16 {
    // NaN becomes 0 in the cast
    ((0.5 + BAND_0 * v).clamp(0.0, 1.0) * 255.0 + 0.5) as u16
}

/// For people: why a value does not fit.
pub(crate) fn out_of_range(value: f64, rule: Rule) -> String {
    match rule {
        Rule::Unit => format!("the colour {value} is outside 0–1, the range of this file's other colours"),
        Rule::Shift => format!("the intensity {value} is outside the range of PTS files, −2048 to 2047"),
        _ => format!("the value {value} does not fit its column"),
    }
}

/// The length of a list; `None` if it is negative or no integer.
pub(crate) fn count(bytes: &[u8], ty: AttributeType, endian: Endian) -> Option<u64> {
    match ty {
        AttributeType::Float32 | AttributeType::Float64 => None,
        AttributeType::UInt64 => Some(u64::read(bytes, endian)),
        _ => u64::try_from(with_type!(ty, T => T::read(&bytes[..N.min(bytes.len())], endian).as_f64() as i64)).ok(),
    }
}

/// Red, green, blue from the bits of a packed colour: 0xAARRGGBB.
pub(crate) fn unpack(bits: u32) -> ([u16; 3], u8) {
    let [blue, green, red, alpha] = bits.to_le_bytes();
    ([red, green, blue].map(u16::from), alpha)
}

/// Packed colours to their columns, those that are `Some`.
fn packed(
    rows: Rows<'_>,
    at: usize,
    (colour, alpha): (Option<usize>, Option<usize>),
    first: usize,
    batch: &mut PointBatch,
) {
    let bits = || rows.numbers::<4>(at).map(|bytes| unpack(u32::read(bytes, rows.endian)));
    if let Some(Column::UInt16(out)) = colour.and_then(|c| batch.columns.get_mut(c)) {
        for (out, (rgb, _)) in out.chunks_exact_mut(3).skip(first).zip(bits()) {
            out.copy_from_slice(&rgb);
        }
    }
    if let Some(Column::UInt8(out)) = alpha.and_then(|c| batch.columns.get_mut(c)) {
        out.iter_mut().skip(first).zip(bits()).for_each(|(out, (_, alpha))| *out = alpha);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch(columns: Vec<Column>) -> PointBatch {
        let mut batch = PointBatch::new(0, Positions::World([vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]]), []);
        batch.columns = columns;
        batch
    }

    fn value(at: usize, ty: AttributeType, element: usize, rule: Rule) -> Field {
        Field { at, ty, target: Target::Value { column: 0, element, rule } }
    }

    #[test]
    fn a_big_endian_row_gives_its_numbers() {
        let mut b = batch(vec![Column::UInt16(vec![0; 6])]);
        let bytes = [0x3f, 0x80, 0, 0, 7, 8, 9, 0x40, 0, 0, 0, 10, 11, 12];
        let rows = Rows { bytes: &bytes, stride: 7, endian: Endian::Big };
        let mut fields = vec![Field { at: 0, ty: AttributeType::Float32, target: Target::Axis(1) }];
        fields.extend((0..3).map(|e| value(4 + e, AttributeType::UInt8, e, Rule::Convert)));
        fill(rows, &fields, &Wanted::from_iter([true]), 0, &mut b).unwrap();
        assert_eq!(b.columns, [Column::UInt16(vec![7, 8, 9, 10, 11, 12])]);
        let Positions::World(xyz) = b.positions else { panic!() };
        assert_eq!(xyz[1], [1.0, 2.0]);
    }

    #[test]
    fn a_value_out_of_range_is_named_with_its_row() {
        let mut b = batch(vec![Column::UInt8(vec![0; 2])]);
        let rows = Rows { bytes: &[1, 0, 44, 1], stride: 2, endian: Endian::Little };
        let field = value(0, AttributeType::Int16, 0, Rule::Convert);
        let misfit = fill(rows, &[field], &Wanted::from_iter([true]), 0, &mut b).unwrap_err();
        assert_eq!((misfit.row, misfit.what.as_str()), (1, "the value 300 does not fit its column"));
    }

    #[test]
    fn harmonics_become_colours_of_a_byte() {
        let colours = [-9.0, -1.772_453_8, 0.0, 1.0, 1.772_453_9, 9.0, f64::NAN].map(harmonic_colour);
        assert_eq!(colours, [0, 0, 128, 199, 255, 255, 0]);
        for byte in 0..=255u8 {
            assert_eq!(harmonic_colour(f64::from(((f64::from(byte) / 255.0 - 0.5) / BAND_0) as f32)), u16::from(byte));
        }
    }

    #[test]
    fn packed_colours_are_blue_first() {
        assert_eq!(unpack(0xff01_0203), ([1, 2, 3], 255));
    }
}
