//! The columns of a record behind position and colour: where their bytes come from.

use pointmill_format::{AttributeType, Changes};

use crate::outputs::number::number;
use crate::outputs::potree2::viewable;
use crate::sources::Schema;

/// A column behind the colour.
#[derive(Debug, Clone)]
pub(super) struct Column {
    /// Byte offset in a record of the dataset.
    pub(super) at: usize,
    /// The attributes of the schema that are in it.
    pub(super) indices: Vec<usize>,
    pub(super) source: Source,
    /// The type of its elements.
    pub(super) stored_as: AttributeType,
}

/// Where the bytes come from; `from`: byte offsets in a stored record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Source {
    /// As they are stored.
    Copy { from: usize, bytes: usize },
    /// 64-bit integers become doubles, which clients read.
    Doubles { from: usize, elements: usize, is_signed: bool },
    /// An integer of another type; what does not fit takes the nearest end.
    Number { from: usize, ty: AttributeType, most: u16 },
    /// A name for something: what does not fit becomes 0.
    Code { from: usize, ty: AttributeType },
    /// A normal in two bytes.
    Octahedron { from: [(usize, AttributeType); 3] },
    /// A normal in three floats.
    Floats { from: [(usize, AttributeType); 3] },
}

impl Source {
    /// Of an attribute under its own name and type.
    pub(super) fn own(schema: &Schema, i: usize) -> Self {
        let (attribute, from) = (&schema.attributes[i], schema.offsets[i]);
        if viewable(attribute.ty) == attribute.ty {
            return Self::Copy { from, bytes: attribute.size() };
        }
        Self::Doubles { from, elements: attribute.elements, is_signed: attribute.ty == AttributeType::Int64 }
    }

    /// Of one number of type `as_type`; `None`: the values of the attribute are of another kind.
    pub(super) fn of_number(schema: &Schema, i: usize, as_type: AttributeType) -> Option<Self> {
        let (attribute, from) = (&schema.attributes[i], schema.offsets[i]);
        let ty = attribute.ty;
        let is_real = matches!(ty, AttributeType::Float32 | AttributeType::Float64);
        match as_type {
            same if same == ty => Some(Self::Copy { from, bytes: ty.size() }),
            _ if is_real => None,
            AttributeType::UInt8 if attribute.name == "classification" => Some(Self::Code { from, ty }),
            AttributeType::UInt8 => Some(Self::Number { from, ty, most: u16::from(u8::MAX) }),
            AttributeType::UInt16 => Some(Self::Number { from, ty, most: u16::MAX }),
            _ => None,
        }
    }

    /// True if what doubles cannot hold was counted when it was read.
    pub(super) const fn doubles(&self) -> bool {
        matches!(self, Self::Doubles { .. })
    }

    /// Fills the column of records of `stride` bytes, which begins at `at`, from `records` of `stored_stride` bytes.
    pub(super) fn fill(
        &self,
        records: &[u8],
        stored_stride: usize,
        out: &mut [u8],
        (at, stride): (usize, usize),
        changes: &mut Changes,
    ) {
        let pairs =
            records.chunks_exact(stored_stride).zip(out.chunks_exact_mut(stride).map(|record| &mut record[at..]));
        match *self {
            Self::Copy { from, bytes: 1 } => pairs.for_each(|(record, out)| out[0] = record[from]),
            Self::Copy { from, bytes: 2 } => {
                pairs.for_each(|(record, out)| out[..2].copy_from_slice(&record[from..from + 2]));
            }
            Self::Copy { from, bytes } => {
                pairs.for_each(|(record, out)| out[..bytes].copy_from_slice(&record[from..from + bytes]));
            }
            Self::Doubles { from, elements, is_signed } => {
                for (record, out) in pairs {
                    let values = record[from..from + 8 * elements].as_chunks::<8>().0;
                    for (value, out) in values.iter().zip(out.as_chunks_mut::<8>().0) {
                        *out = as_double(*value, is_signed).to_le_bytes();
                    }
                }
            }
            Self::Number { from, ty, most } => {
                for (record, out) in pairs {
                    let held = held(number(&record[from..], ty), most, changes).to_le_bytes();
                    let bytes = if most > u16::from(u8::MAX) { 2 } else { 1 };
                    out[..bytes].copy_from_slice(&held[..bytes]);
                }
            }
            Self::Code { from, ty } => {
                for (record, out) in pairs {
                    let value = number(&record[from..], ty);
                    let is_held = (0.0..=255.0).contains(&value);
                    if !is_held {
                        changes.leave_out(value);
                    }
                    out[0] = if is_held { value as u8 } else { 0 };
                }
            }
            Self::Octahedron { from } => {
                for (record, out) in pairs {
                    out[..2].copy_from_slice(&octahedron(components(record, from), changes));
                }
            }
            Self::Floats { from } => {
                for (record, out) in pairs {
                    for (value, out) in components(record, from).into_iter().zip(out.as_chunks_mut::<4>().0) {
                        let held = value as f32;
                        if f64::from(held) != value && !value.is_nan() {
                            changes.round(value);
                        }
                        *out = held.to_le_bytes();
                    }
                }
            }
        }
    }
}

fn as_double(bytes: [u8; 8], is_signed: bool) -> f64 {
    if is_signed { i64::from_le_bytes(bytes) as f64 } else { u64::from_le_bytes(bytes) as f64 }
}

/// The nearest number that can be held.
fn held(value: f64, most: u16, changes: &mut Changes) -> u16 {
    let held = value.clamp(0.0, f64::from(most));
    if held != value {
        changes.clamp(value);
    }
    held as u16
}

fn components(record: &[u8], from: [(usize, AttributeType); 3]) -> [f64; 3] {
    from.map(|(at, ty)| number(&record[at..], ty))
}

/// The two bytes of a normal (`docs/formats/potree1.md`, 5.3); two bytes hold none exactly. What has no direction points
/// upwards.
fn octahedron(n: [f64; 3], changes: &mut Changes) -> [u8; 2] {
    let sum = n.iter().map(|c| c.abs()).sum::<f64>();
    if !sum.is_finite() {
        changes.not_finite += 1;
    } else {
        changes.rounded += 1;
    }
    if !(sum.is_finite() && sum > 0.0) {
        return [128, 128];
    }
    let [x, y, z] = n.map(|c| c / sum);
    let sign = |c: f64| if c < 0.0 { -1.0 } else { 1.0 };
    let [u, v] = if z >= 0.0 { [x, y] } else { [sign(x) * (1.0 - y.abs()), sign(y) * (1.0 - x.abs())] };
    [u, v].map(|c| ((c + 1.0) * 128.0).min(255.0) as u8)
}

#[cfg(test)]
mod tests {
    use pointmill_format::Attribute;

    use super::*;

    fn fill(source: Source, stored: &[u8], stored_stride: usize, bytes: usize) -> (Vec<u8>, Changes) {
        let (mut out, mut changes) = (vec![9; stored.len() / stored_stride * (bytes + 1)], Changes::default());
        source.fill(stored, stored_stride, &mut out, (1, bytes + 1), &mut changes);
        assert!(out.iter().step_by(bytes + 1).all(|byte| *byte == 9), "bytes of others");
        (out.chunks_exact(bytes + 1).flat_map(|record| record[1..].to_vec()).collect(), changes)
    }

    fn source(name: &str, ty: AttributeType, as_type: AttributeType) -> Option<Source> {
        Source::of_number(&Schema::new(vec![Attribute::new(name, ty, 1)]), 0, as_type)
    }

    #[test]
    fn numbers_that_fit_stay_and_others_take_the_nearest_end() {
        use AttributeType::{Float32, Int32, UInt8, UInt16};
        let records = |values: &[i32]| -> Vec<u8> {
            values.iter().flat_map(|v| [vec![0; 12], v.to_le_bytes().to_vec()].concat()).collect()
        };
        let of = source("intensity", Int32, UInt16).unwrap();
        let (bytes, changes) = fill(of, &records(&[0, 700, 65_535, 70_000, -3]), 16, 2);
        let values: Vec<u16> = bytes.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b)).collect();
        assert_eq!((values, changes.clamped), (vec![0, 700, 65_535, 65_535, 0], 2));
        assert_eq!(changes.extremes, Some([-3.0, 70_000.0]));
        let of = source("classification", Int32, UInt8).unwrap();
        let (bytes, changes) = fill(of, &records(&[2, 255, 256, -1]), 16, 1);
        assert_eq!((bytes, changes.out_of_range, changes.clamped), (vec![2, 255, 0, 0], 2, 0), "no other class");
        assert_eq!(source("intensity", UInt16, UInt16), Some(Source::Copy { from: 12, bytes: 2 }));
        assert_eq!(source("intensity", Float32, UInt16), None, "nobody says what 0.5 means");
    }

    #[test]
    fn normals_in_two_bytes_are_those_of_the_page() {
        let mut changes = Changes::default();
        let mut of = |n| octahedron(n, &mut changes);
        assert_eq!(of([0.0, 0.0, 1.0]), [128, 128]);
        assert_eq!(of([0.0, 0.0, -1.0]), [255, 255]);
        assert_eq!(of([1.0, 0.0, 0.0]), [255, 128]);
        assert_eq!(of([-2.0, 0.0, 0.0]), [0, 128], "of any length");
        assert_eq!(of([0.0, 0.0, 0.0]), [128, 128]);
        assert_eq!(of([f64::NAN, 0.0, 0.0]), [128, 128]);
        assert_eq!((changes.rounded, changes.not_finite), (5, 1));
    }

    #[test]
    fn wide_integers_become_doubles_and_floats_stay() {
        let schema = Schema::new(vec![Attribute::new("id", AttributeType::UInt64, 2)]);
        let of = Source::own(&schema, 0);
        let record: Vec<u8> = [vec![0; 12], [5u64, u64::MAX].iter().flat_map(|v| v.to_le_bytes()).collect()].concat();
        let (bytes, _) = fill(of, &record, 28, 16);
        let values: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        assert_eq!(values, [5.0, u64::MAX as f64]);
        let of = Source::Floats {
            from: [(0, AttributeType::Float32), (4, AttributeType::Float32), (8, AttributeType::Float64)],
        };
        let record = [&0.1f32.to_le_bytes()[..], &f32::NAN.to_le_bytes(), &0.1f64.to_le_bytes()].concat();
        let (bytes, changes) = fill(of, &record, 16, 12);
        assert_eq!(bytes[..4], 0.1f32.to_le_bytes());
        assert_eq!((changes.rounded, bytes[8..].to_vec()), (1, 0.1f32.to_le_bytes().to_vec()));
    }
}
