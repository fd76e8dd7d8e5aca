//! Single values of attributes, whatever their type.

use pointmill_format::{Attribute, AttributeType, Column, with_column};
use serde_json::{Value, json};

/// Integers beyond this are not exact as the numbers of JavaScript.
const EXACT_INTEGERS: u64 = 1 << 53;

/// A stored value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Number {
    Signed(i64),
    Unsigned(u64),
    Single(f32),
    Double(f64),
}

macro_rules! numbers {
    ($($rust:ty => $name:ident),*) => {$(
        impl From<$rust> for Number {
            fn from(value: $rust) -> Self {
                Self::$name(value.into())
            }
        }
    )*};
}
numbers!(i8 => Signed, i16 => Signed, i32 => Signed, i64 => Signed, u8 => Unsigned, u16 => Unsigned, u32 => Unsigned,
    u64 => Unsigned, f32 => Single, f64 => Double);

impl Number {
    /// The value at `index` of a column.
    pub(crate) fn of_column(column: &Column, index: usize) -> Option<Self> {
        with_column!(column, values => values.get(index).map(|v| Self::from(*v)))
    }

    /// The value that little-endian bytes begin with.
    pub(crate) fn of_bytes(ty: AttributeType, bytes: &[u8]) -> Option<Self> {
        macro_rules! read {
            ($($name:ident = $rust:ty),*) => {
                match ty {
                    $(AttributeType::$name => bytes.first_chunk().map(|b| Self::from(<$rust>::from_le_bytes(*b))),)*
                }
            };
        }
        read!(
            Int8 = i8,
            UInt8 = u8,
            Int16 = i16,
            UInt16 = u16,
            Int32 = i32,
            UInt32 = u32,
            Int64 = i64,
            UInt64 = u64,
            Float32 = f32,
            Float64 = f64
        )
    }

    pub(crate) fn as_f64(self) -> f64 {
        match self {
            Self::Signed(v) => v as f64,
            Self::Unsigned(v) => v as f64,
            Self::Single(v) => v.into(),
            Self::Double(v) => v,
        }
    }

    /// As JSON: integers exactly, other numbers with as few digits as read back; `null` for what is no number.
    fn to_json(self) -> Value {
        match self {
            Self::Signed(v) => v.into(),
            Self::Unsigned(v) => v.into(),
            // the shortest text of a single, not that of the double with the same value
            Self::Single(v) => v.to_string().parse::<f64>().map_or(Value::Null, Into::into),
            Self::Double(v) => v.into(),
        }
    }

    /// What a number of JavaScript does not say.
    fn text(self) -> Option<String> {
        match self {
            Self::Signed(v) => (v.unsigned_abs() > EXACT_INTEGERS).then(|| v.to_string()),
            Self::Unsigned(v) => (v > EXACT_INTEGERS).then(|| v.to_string()),
            Self::Single(v) => (!v.is_finite()).then(|| v.to_string()),
            Self::Double(v) => (!v.is_finite()).then(|| v.to_string()),
        }
    }
}

/// The meant value of a raw one.
pub(crate) fn scaled(attribute: &Attribute, element: usize, raw: f64) -> f64 {
    let (scale, offset) = scaling(attribute, element);
    raw * scale + offset
}

fn scaling(attribute: &Attribute, element: usize) -> (f64, f64) {
    let scale = attribute.scale.get(element).copied().unwrap_or(1.0);
    (scale, attribute.offset.get(element).copied().unwrap_or(0.0))
}

/// All values of one point: `{"name", "values"}`, and `"text"` where a number does not say it.
pub(crate) fn point_json(attribute: &Attribute, number: impl Fn(usize) -> Option<Number>) -> Value {
    let (mut values, mut texts) = (Vec::new(), Vec::new());
    for (element, raw) in (0..attribute.elements).filter_map(|element| Some((element, number(element)?))) {
        if scaling(attribute, element) == (1.0, 0.0) {
            values.push(raw.to_json());
            texts.extend(raw.text());
        } else {
            values.push(scaled(attribute, element, raw.as_f64()).into());
        }
    }
    if texts.is_empty() {
        return json!({ "name": attribute.name, "values": values });
    }
    json!({ "name": attribute.name, "values": values, "text": texts.join(" ") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_and_bytes_give_the_same_numbers() {
        let column = Column::Int16(vec![-2, 300]);
        let bytes: Vec<u8> = [-2i16, 300].iter().flat_map(|v| v.to_le_bytes()).collect();
        for i in 0..2 {
            let number = Number::of_column(&column, i);
            assert_eq!(number, Number::of_bytes(AttributeType::Int16, &bytes[2 * i..]));
            assert!(number.is_some());
        }
        assert_eq!(Number::of_column(&column, 2), None);
        assert_eq!(Number::of_bytes(AttributeType::Float64, &bytes), None);
    }

    #[test]
    fn values_are_exact_or_have_a_text() {
        let show = |ty, elements, scale: f64, numbers: &[Number]| {
            let mut attribute = Attribute::new("a", ty, elements);
            attribute.scale = vec![scale; elements];
            point_json(&attribute, |e| numbers.get(e).copied()).to_string()
        };
        let wide = show(AttributeType::UInt64, 1, 1.0, &[Number::Unsigned(u64::MAX)]);
        assert_eq!(wide, r#"{"name":"a","text":"18446744073709551615","values":[18446744073709551615]}"#);
        let single = show(AttributeType::Float32, 2, 1.0, &[Number::Single(0.1), Number::Single(f32::NAN)]);
        assert_eq!(single, r#"{"name":"a","text":"NaN","values":[0.1,null]}"#);
        let scaled = show(AttributeType::Int16, 1, 0.006, &[Number::Signed(-5)]);
        assert_eq!(scaled, r#"{"name":"a","values":[-0.03]}"#);
    }
}
