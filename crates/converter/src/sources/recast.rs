//! From a column as it was read to the type and unit that the attribute has in the records.

use pointmill_format::{AttributeType, Changes, Column, with_column};

/// How a column becomes that of the attribute: value = (stored · scale + offset) · unit, in double precision, where that
/// is not the stored value itself; then the type.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Recast {
    pub(crate) ty: AttributeType,
    /// `None`: the stored values are the values.
    pub(crate) linear: Option<Linear>,
}

/// What stored values mean, by element.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Linear {
    pub(crate) scale: Vec<f64>,
    pub(crate) offset: Vec<f64>,
    /// From the unit of the file to that of the quantity.
    pub(crate) unit: f64,
}

impl Linear {
    /// The value that a stored one means.
    fn value(&self, stored: f64, element: usize) -> f64 {
        (stored * self.scale[element] + self.offset[element]) * self.unit
    }
}

impl Recast {
    /// The converted column, and which values a double had to round.
    #[allow(clippy::unnecessary_cast)] // one body for every type of column
    pub(crate) fn apply(&self, column: &Column) -> (Column, Changes) {
        if let Some(linear) = &self.linear {
            let elements = linear.scale.len().max(1);
            let meant = with_column!(column, values => {
                values.iter().enumerate().map(|(i, v)| linear.value(*v as f64, i % elements)).collect::<Vec<f64>>()
            });
            let meant = match self.ty {
                AttributeType::Float32 => Column::Float32(meant.iter().map(|v| *v as f32).collect()),
                _ => Column::Float64(meant),
            };
            return (meant, Changes::default());
        }
        let changes = if self.ty == AttributeType::Float64 { doubled(column, 1, None) } else { Changes::default() };
        (widened(column, self.ty), changes)
    }
}

/// The same values in a type that holds them.
#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn widened(column: &Column, ty: AttributeType) -> Column {
    macro_rules! to {
        ($($name:ident = $t:ty),*) => {
            match ty {
                $(AttributeType::$name => {
                    with_column!(column, values => Column::$name(values.iter().map(|v| *v as $t).collect()))
                })*
            }
        };
    }
    to!(
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

/// The values of 64-bit integers that a double does not hold exactly, `elements` a point, among the points that
/// `selection` names (`None`: all). Nothing for other types.
pub(crate) fn doubled(column: &Column, elements: usize, selection: Option<&[u32]>) -> Changes {
    macro_rules! count {
        ($values:expr) => {{
            let mut changes = Changes::default();
            let mut add = |v: i128| {
                if (v as f64) as i128 != v {
                    changes.round(v as f64);
                }
            };
            match selection {
                None => $values.iter().for_each(|v| add(i128::from(*v))),
                Some(s) => s.iter().for_each(|i| {
                    let first = *i as usize * elements;
                    $values[first..first + elements].iter().for_each(|v| add(i128::from(*v)));
                }),
            }
            changes
        }};
    }
    match column {
        Column::Int64(values) => count!(values),
        Column::UInt64(values) => count!(values),
        _ => Changes::default(),
    }
}

/// The least type that holds all values of both exactly; double where none does (64-bit integers of either sign, or with
/// floats).
pub(crate) fn common_type(a: AttributeType, b: AttributeType) -> AttributeType {
    use AttributeType as T;
    if a == b {
        return a;
    }
    let is_float = |ty| matches!(ty, T::Float32 | T::Float64);
    if is_float(a) || is_float(b) {
        // 24 bits of single precision
        let is_short = |ty| matches!(ty, T::Int8 | T::UInt8 | T::Int16 | T::UInt16 | T::Float32);
        return if is_short(a) && is_short(b) { T::Float32 } else { T::Float64 };
    }
    let is_signed = |ty| matches!(ty, T::Int8 | T::Int16 | T::Int32 | T::Int64);
    let bytes = |ty: T, signed: bool| if signed && !is_signed(ty) { 2 * ty.size() } else { ty.size() };
    let signed = is_signed(a) || is_signed(b);
    match (bytes(a, signed).max(bytes(b, signed)), signed) {
        (1, _) => T::Int8, // two different types of one byte are not of one sign
        (2, true) => T::Int16,
        (2, false) => T::UInt16,
        (4, true) => T::Int32,
        (4, false) => T::UInt32,
        (8, true) => T::Int64,
        (8, false) => T::UInt64,
        _ => T::Float64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use AttributeType as T;

    #[test]
    fn the_common_type_holds_both() {
        let cases = [
            (T::UInt8, T::UInt16, T::UInt16),
            (T::UInt8, T::Int8, T::Int16),
            (T::Int16, T::UInt16, T::Int32),
            (T::Int32, T::UInt32, T::Int64),
            (T::Int64, T::UInt64, T::Float64),
            (T::UInt32, T::UInt64, T::UInt64),
            (T::UInt16, T::Float32, T::Float32),
            (T::Int32, T::Float32, T::Float64),
            (T::Float32, T::Float64, T::Float64),
        ];
        for (a, b, common) in cases {
            assert_eq!((common_type(a, b), common_type(b, a)), (common, common), "{a} {b}");
        }
        // every value of either type comes back
        for a in T::ALL {
            for b in T::ALL.into_iter().filter(|b| a.size() < 4 && b.size() < 4) {
                let ends = Column::Int32(vec![0, 127]);
                let back = widened(&widened(&widened(&ends, a), common_type(a, b)), T::Int32);
                assert_eq!(back, ends);
            }
        }
    }

    #[test]
    fn values_stay_and_what_a_double_rounds_is_counted() {
        let plain = |ty| Recast { ty, linear: None };
        let (column, changes) = plain(T::Int16).apply(&Column::Int8(vec![-1, 127]));
        assert_eq!((column, changes.is_empty()), (Column::Int16(vec![-1, 127]), true));
        let wide = Column::Int64(vec![-3, 1 << 53, (1 << 53) + 1, i64::MAX]);
        let (column, changes) = plain(T::Float64).apply(&wide);
        assert_eq!((column.ty(), changes.rounded), (T::Float64, 2));
        assert_eq!(doubled(&wide, 1, Some(&[0, 2])).rounded, 1);
        assert!(doubled(&Column::UInt64(vec![7]), 1, None).is_empty());
    }

    #[test]
    fn scales_and_units_are_applied() {
        let angle = Linear { scale: vec![1.0], offset: vec![0.0], unit: 0.006 };
        let (column, _) = Recast { ty: T::Float64, linear: Some(angle) }.apply(&Column::Int16(vec![2500, -30000]));
        assert_eq!(column, Column::Float64(vec![15.0, -180.0]));
        let normal = Linear { scale: vec![1.0 / 127.0], offset: vec![0.0], unit: 1.0 };
        let (column, _) = Recast { ty: T::Float32, linear: Some(normal) }.apply(&Column::Int8(vec![-127, 0]));
        assert_eq!(column, Column::Float32(vec![-1.0, 0.0]));
    }
}
