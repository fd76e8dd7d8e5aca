//! Bytes to typed columns: one loop an attribute.

use crate::Column;
use crate::with_column;

/// A number stored little-endian.
trait LittleEndian: Copy + Default {
    /// Reads the number at `at`.
    fn read(bytes: &[u8], at: usize) -> Self;
}

macro_rules! little_endian {
    ($($ty:ty),*) => {$(
        impl LittleEndian for $ty {
            fn read(bytes: &[u8], at: usize) -> Self {
                let mut number = [0; size_of::<$ty>()];
                number.copy_from_slice(&bytes[at..at + size_of::<$ty>()]);
                <$ty>::from_le_bytes(number)
            }
        }
    )*};
}
little_endian!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64);

/// Appends to `column` the `elements` values that stand at byte `at` of every record of `record_len` bytes.
pub(crate) fn append(column: &mut Column, records: &[u8], record_len: usize, at: usize, elements: usize) {
    with_column!(column, values => append_typed(values, records, record_len, at, elements));
}

/// Appends one coordinate of every record.
pub(crate) fn append_i32(values: &mut Vec<i32>, records: &[u8], record_len: usize, at: usize) {
    append_typed(values, records, record_len, at, 1);
}

fn append_typed<T: LittleEndian>(values: &mut Vec<T>, records: &[u8], record_len: usize, at: usize, elements: usize) {
    let records = records.chunks_exact(record_len);
    if elements == 1 {
        values.extend(records.map(|r| T::read(r, at)));
        return;
    }
    let start = values.len();
    values.resize(start + records.len() * elements, T::default());
    let new = &mut values[start..];
    if elements == 3 {
        for (out, record) in new.as_chunks_mut::<3>().0.iter_mut().zip(records) {
            *out = std::array::from_fn(|e| T::read(record, at + e * size_of::<T>()));
        }
    } else {
        for (out, record) in new.chunks_exact_mut(elements).zip(records) {
            out.iter_mut().enumerate().for_each(|(e, out)| *out = T::read(record, at + e * size_of::<T>()));
        }
    }
}
