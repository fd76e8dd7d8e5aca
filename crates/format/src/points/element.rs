//! Rust types that stand for the types of attributes.

use super::{AttributeType, Column};

mod sealed {
    /// Keeps [`super::Element`] to the ten types of the format; plain numbers, so that bytes of a file are values.
    pub trait Sealed: bytemuck::AnyBitPattern {}
}

/// A number that a column can hold: `i8` to `u64`, `f32`, `f64`. Sealed: there are no others.
///
/// ```
/// use pointmill_format::{AttributeType, Column, Element};
///
/// assert_eq!(u16::TYPE, AttributeType::UInt16);
/// let column = Column::UInt16(vec![7, 8]);
/// assert_eq!(column.values::<u16>(), Some(&[7, 8][..]));
/// assert_eq!(column.values::<i16>(), None);
/// ```
pub trait Element: sealed::Sealed + Copy + Default + PartialEq + PartialOrd + std::fmt::Debug + Send + Sync {
    /// The type of an attribute whose elements these are.
    const TYPE: AttributeType;

    #[doc(hidden)]
    fn values(column: &Column) -> Option<&[Self]>;

    #[doc(hidden)]
    fn values_mut(column: &mut Column) -> Option<&mut Vec<Self>>;
}

macro_rules! elements {
    ($($rust:ty = $name:ident),*) => {$(
        impl sealed::Sealed for $rust {}

        impl Element for $rust {
            const TYPE: AttributeType = AttributeType::$name;

            fn values(column: &Column) -> Option<&[Self]> {
                match column {
                    Column::$name(values) => Some(values),
                    _ => None,
                }
            }

            fn values_mut(column: &mut Column) -> Option<&mut Vec<Self>> {
                match column {
                    Column::$name(values) => Some(values),
                    _ => None,
                }
            }
        }
    )*};
}
elements!(
    i8 = Int8,
    u8 = UInt8,
    i16 = Int16,
    u16 = UInt16,
    i32 = Int32,
    u32 = UInt32,
    i64 = Int64,
    u64 = UInt64,
    f32 = Float32,
    f64 = Float64
);

impl Column {
    /// The values, if they are of type `T`.
    pub fn values<T: Element>(&self) -> Option<&[T]> {
        T::values(self)
    }

    /// The values, if they are of type `T`, to be changed.
    pub fn values_mut<T: Element>(&mut self) -> Option<&mut Vec<T>> {
        T::values_mut(self)
    }
}
