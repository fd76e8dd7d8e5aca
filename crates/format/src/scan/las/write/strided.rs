//! Columns wherever they lie: among the records of a store, or alone.

use std::borrow::Cow;

use crate::{AttributeType, Column, with_column};

/// The values of an attribute in memory, little-endian, at equal distances: a column of records that stand one behind the
/// other, or a [`Column`]. Nothing is copied.
#[derive(Debug, Clone)]
pub struct StridedColumn<'a> {
    /// From the first value on.
    bytes: Cow<'a, [u8]>,
    stride: usize,
    ty: AttributeType,
    elements: usize,
}

impl<'a> StridedColumn<'a> {
    /// Values of that type, `elements` of them side by side for each point, the first at byte `first`, the next ones always
    /// `stride` bytes further.
    #[must_use]
    pub fn new(bytes: &'a [u8], first: usize, stride: usize, ty: AttributeType, elements: usize) -> Self {
        Self { bytes: Cow::Borrowed(bytes.get(first..).unwrap_or_default()), stride: stride.max(1), ty, elements }
    }

    /// The values of a column, `elements` a point.
    #[must_use]
    pub fn of(column: &'a Column, elements: usize) -> Self {
        let ty = column.ty();
        let bytes = with_column!(column, values => little_endian(values, ty));
        Self { bytes, stride: (ty.size() * elements).max(1), ty, elements }
    }

    /// One coordinate of points.
    #[must_use]
    pub fn of_axis(axis: &'a [i32]) -> Self {
        let ty = AttributeType::Int32;
        Self { bytes: little_endian(axis, ty), stride: ty.size(), ty, elements: 1 }
    }

    /// The type of an element.
    pub fn ty(&self) -> AttributeType {
        self.ty
    }

    /// Elements of a point.
    pub fn elements(&self) -> usize {
        self.elements
    }

    /// Points that have values.
    pub fn len(&self) -> usize {
        let size = self.elements * self.ty.size();
        self.bytes.len().checked_sub(size).map_or(0, |rest| rest / self.stride + 1)
    }

    /// True without values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The bytes from the value of the point `first` on, and the distance of values.
    pub(super) fn from(&self, first: usize) -> (&[u8], usize) {
        (self.bytes.get(first * self.stride..).unwrap_or_default(), self.stride)
    }
}

/// Numbers as they are stored.
fn little_endian<T: bytemuck::NoUninit>(values: &[T], ty: AttributeType) -> Cow<'_, [u8]> {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    if cfg!(target_endian = "little") {
        return Cow::Borrowed(bytes);
    }
    let mut bytes = bytes.to_vec();
    bytes.chunks_exact_mut(ty.size()).for_each(<[u8]>::reverse);
    Cow::Owned(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_as_many_values_as_their_bytes_hold() {
        let records = [0; 30];
        let len = |first, stride, elements| {
            StridedColumn::new(&records, first, stride, AttributeType::UInt16, elements).len()
        };
        assert_eq!([len(0, 10, 1), len(8, 10, 1), len(8, 10, 3), len(29, 10, 1), len(99, 1, 1)], [3, 3, 2, 0, 0]);
        assert_eq!(StridedColumn::of(&Column::UInt16(vec![1, 2, 3, 4, 5, 6]), 3).len(), 2);
        assert_eq!(StridedColumn::of(&Column::Float64(vec![]), 1).len(), 0);
        let axis = StridedColumn::of_axis(&[1, -2]);
        assert_eq!((axis.len(), axis.from(1).0), (2, &(-2i32).to_le_bytes()[..]));
    }
}
