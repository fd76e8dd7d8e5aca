//! Attributes as the columns of a table: what PLY and text have.

use pointmill_format::{Attribute, AttributeType};

use crate::sources::Schema;

/// Degrees of a step of the scan angle in LAS formats 6–10.
const SCAN_ANGLE_STEP: f64 = 0.006;

/// How deep colours are that stand in 16 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    /// 8 bits, as they are.
    Eight,
    /// 8 bits, times 257.
    EightTimes257,
    Sixteen,
}

impl Depth {
    /// The colour in 8 bits; `None`: it has more.
    pub(super) fn byte(self, value: u16) -> Option<u8> {
        match self {
            Self::Eight => u8::try_from(value).ok(),
            Self::EightTimes257 => value.is_multiple_of(257).then_some((value / 257) as u8),
            Self::Sixteen => None,
        }
    }

    /// What a sample of colours says; nothing is certain but 16 bits. `is_16_bit`: small values are dark, as some file says.
    pub(super) fn of(sample: &[u16], is_16_bit: bool) -> Self {
        if sample.iter().all(|v| *v <= 255) && !is_16_bit {
            Self::Eight
        } else if sample.iter().all(|v| v.is_multiple_of(257)) {
            Self::EightTimes257
        } else {
            Self::Sixteen
        }
    }
}

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    /// Index in the schema.
    pub(super) attribute: usize,
    pub(super) name: String,
    /// Byte in a record.
    pub(super) at: usize,
    pub(super) ty: AttributeType,
    pub(super) value: Value,
}

/// What stands in a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value {
    /// The stored value.
    Stored,
    /// What it means: stored · scale + offset.
    Linear { scale: f64, offset: f64 },
    /// A colour of 8 bits.
    Byte(Depth),
}

/// The columns of a schema. `name_of`: how a file calls an attribute.
pub(super) fn fields(schema: &Schema, depth: Depth, name_of: impl Fn(&str) -> String) -> Vec<Field> {
    let mut out: Vec<Field> = Vec::new();
    let rgb = schema.rgb();
    for (attribute, a) in schema.attributes.iter().enumerate() {
        for element in 0..a.elements {
            let wanted = match (rgb == Some(attribute), a.elements) {
                (true, _) => ["red", "green", "blue"][element.min(2)].to_owned(),
                (false, 1) => name_of(&a.name),
                _ => format!("{}_{element}", name_of(&a.name)),
            };
            let value = match depth {
                Depth::Eight | Depth::EightTimes257 if rgb == Some(attribute) => Value::Byte(depth),
                _ => meaning(a, element),
            };
            let at = schema.offsets[attribute] + element * a.ty.size();
            out.push(Field { attribute, name: free(&wanted, &out), at, ty: a.ty, value });
        }
    }
    out
}

fn meaning(a: &Attribute, element: usize) -> Value {
    let (scale, offset) = (a.scale.get(element).copied(), a.offset.get(element).copied());
    let (scale, offset) = (scale.unwrap_or(1.0), offset.unwrap_or(0.0));
    if a.name == "scan angle" && a.ty == AttributeType::Int16 && scale == 1.0 && offset == 0.0 {
        return Value::Linear { scale: SCAN_ANGLE_STEP, offset: 0.0 };
    }
    if scale == 1.0 && offset == 0.0 { Value::Stored } else { Value::Linear { scale, offset } }
}

/// The name, with a number if another column has it.
fn free(wanted: &str, others: &[Field]) -> String {
    let wanted = if wanted.is_empty() { "value" } else { wanted };
    let is_taken = |name: &str| ["x", "y", "z"].contains(&name) || others.iter().any(|f| f.name == name);
    if !is_taken(wanted) {
        return wanted.to_owned();
    }
    (2..).map(|i| format!("{wanted}_{i}")).find(|name| !is_taken(name)).unwrap_or_default()
}

/// Runs `$body` with `$v` bound to the number at the start of `$bytes`, of the type that `$ty` names.
macro_rules! with_number {
    ($bytes:expr, $ty:expr, $v:ident => $body:expr) => {{
        macro_rules! number {
            ($t:ty) => {{
                let $v = $bytes.first_chunk().map_or(0 as $t, |b| <$t>::from_le_bytes(*b));
                $body
            }};
        }
        match $ty {
            AttributeType::Int8 => number!(i8),
            AttributeType::UInt8 => number!(u8),
            AttributeType::Int16 => number!(i16),
            AttributeType::UInt16 => number!(u16),
            AttributeType::Int32 => number!(i32),
            AttributeType::UInt32 => number!(u32),
            AttributeType::Int64 => number!(i64),
            AttributeType::UInt64 => number!(u64),
            AttributeType::Float32 => number!(f32),
            AttributeType::Float64 => number!(f64),
        }
    }};
}
pub(super) use with_number;
