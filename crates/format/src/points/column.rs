//! The values of one attribute, typed.

use super::AttributeType;

/// The values of one attribute: `points · elements` values, the elements of a point side by side.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // the names say it
pub enum Column {
    Int8(Vec<i8>),
    UInt8(Vec<u8>),
    Int16(Vec<i16>),
    UInt16(Vec<u16>),
    Int32(Vec<i32>),
    UInt32(Vec<u32>),
    Int64(Vec<i64>),
    UInt64(Vec<u64>),
    Float32(Vec<f32>),
    Float64(Vec<f64>),
}

/// Runs `$body` with `$v` bound to the typed vector of `$column`, whatever its type.
#[macro_export]
macro_rules! with_column {
    ($column:expr, $v:ident => $body:expr) => {
        match $column {
            $crate::Column::Int8($v) => $body,
            $crate::Column::UInt8($v) => $body,
            $crate::Column::Int16($v) => $body,
            $crate::Column::UInt16($v) => $body,
            $crate::Column::Int32($v) => $body,
            $crate::Column::UInt32($v) => $body,
            $crate::Column::Int64($v) => $body,
            $crate::Column::UInt64($v) => $body,
            $crate::Column::Float32($v) => $body,
            $crate::Column::Float64($v) => $body,
        }
    };
}

impl Column {
    /// An empty column of that type.
    #[must_use]
    pub fn new(ty: AttributeType) -> Self {
        match ty {
            AttributeType::Int8 => Self::Int8(Vec::new()),
            AttributeType::UInt8 => Self::UInt8(Vec::new()),
            AttributeType::Int16 => Self::Int16(Vec::new()),
            AttributeType::UInt16 => Self::UInt16(Vec::new()),
            AttributeType::Int32 => Self::Int32(Vec::new()),
            AttributeType::UInt32 => Self::UInt32(Vec::new()),
            AttributeType::Int64 => Self::Int64(Vec::new()),
            AttributeType::UInt64 => Self::UInt64(Vec::new()),
            AttributeType::Float32 => Self::Float32(Vec::new()),
            AttributeType::Float64 => Self::Float64(Vec::new()),
        }
    }

    /// The element type.
    pub fn ty(&self) -> AttributeType {
        match self {
            Self::Int8(_) => AttributeType::Int8,
            Self::UInt8(_) => AttributeType::UInt8,
            Self::Int16(_) => AttributeType::Int16,
            Self::UInt16(_) => AttributeType::UInt16,
            Self::Int32(_) => AttributeType::Int32,
            Self::UInt32(_) => AttributeType::UInt32,
            Self::Int64(_) => AttributeType::Int64,
            Self::UInt64(_) => AttributeType::UInt64,
            Self::Float32(_) => AttributeType::Float32,
            Self::Float64(_) => AttributeType::Float64,
        }
    }

    /// Number of values: points · elements.
    pub fn len(&self) -> usize {
        with_column!(self, v => v.len())
    }

    /// True without values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Empties the column and keeps its memory.
    pub fn clear(&mut self) {
        with_column!(self, v => v.clear());
    }
}
