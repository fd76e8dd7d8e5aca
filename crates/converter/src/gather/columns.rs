//! Columns into records: the inner loop of putting a block together.

use pointmill_format::{Column, with_column};

use crate::sources::Schema;

/// Columns that are written together.
pub(crate) enum Part<'a> {
    /// One column.
    One { column: &'a Column, offset: usize, elements: usize },
    /// Neighbouring attributes of one byte each: one move instead of one each.
    Bytes { columns: Vec<&'a [u8]>, offset: usize },
}

/// Maximum bytes written by one move.
const MAX_BYTES: usize = 8;

impl<'a> Part<'a> {
    /// The parts of a batch; `places` are the columns' indices in the schema, `None` for columns that are not kept.
    pub(crate) fn of(columns: &[&'a Column], places: &[Option<usize>], schema: &Schema) -> Vec<Self> {
        let mut placed: Vec<(usize, &'a Column)> =
            columns.iter().copied().zip(places).filter_map(|(column, place)| Some(((*place)?, column))).collect();
        placed.sort_unstable_by_key(|(place, _)| schema.offsets[*place]);
        let mut parts: Vec<Self> = Vec::new();
        for (place, column) in placed {
            let offset = schema.offsets[place];
            match (column, parts.last_mut()) {
                (Column::UInt8(v), Some(Self::Bytes { columns, offset: start }))
                    if *start + columns.len() == offset && columns.len() < MAX_BYTES =>
                {
                    columns.push(v);
                }
                (Column::UInt8(v), _) if schema.attributes[place].elements == 1 => {
                    parts.push(Self::Bytes { columns: vec![v], offset });
                }
                (column, _) => {
                    parts.push(Self::One { column, offset, elements: schema.attributes[place].elements });
                }
            }
        }
        parts
    }

    /// Writes rows into the records of a tile, one each.
    #[inline(always)]
    pub(crate) fn put(&self, tile: &mut [u8], stride: usize, rows: RowsOf<'_>) {
        match self {
            Self::Bytes { columns, offset } => match columns[..] {
                [a] => put_bytes([a], tile, stride, *offset, rows),
                [a, b] => put_bytes([a, b], tile, stride, *offset, rows),
                [a, b, c] => put_bytes([a, b, c], tile, stride, *offset, rows),
                [a, b, c, d] => put_bytes([a, b, c, d], tile, stride, *offset, rows),
                [a, b, c, d, e] => put_bytes([a, b, c, d, e], tile, stride, *offset, rows),
                [a, b, c, d, e, f] => put_bytes([a, b, c, d, e, f], tile, stride, *offset, rows),
                [a, b, c, d, e, f, g] => put_bytes([a, b, c, d, e, f, g], tile, stride, *offset, rows),
                [a, b, c, d, e, f, g, h] => put_bytes([a, b, c, d, e, f, g, h], tile, stride, *offset, rows),
                _ => {}
            },
            Self::One { column, offset, elements } => put_column(column, *elements, tile, stride, *offset, rows),
        }
    }
}

/// Rows of columns: a run, or those that are named.
#[derive(Debug, Clone, Copy)]
pub(crate) enum RowsOf<'a> {
    From(usize),
    Named(&'a [u32]),
}

#[inline(always)]
fn put_bytes<const N: usize>(columns: [&[u8]; N], tile: &mut [u8], stride: usize, offset: usize, rows: RowsOf<'_>) {
    let records = tile.chunks_exact_mut(stride);
    match rows {
        RowsOf::From(first) => {
            let columns = columns.map(|c| &c[first..first + records.len()]);
            for (i, record) in records.enumerate() {
                let bytes: [u8; N] = std::array::from_fn(|k| columns[k][i]);
                record[offset..offset + N].copy_from_slice(&bytes);
            }
        }
        RowsOf::Named(rows) => {
            // One length for all, so that one comparison a point will do.
            let len = columns.iter().map(|c| c.len()).min().unwrap_or(0);
            let columns = columns.map(|c| &c[..len]);
            for (record, &i) in records.zip(rows) {
                let bytes: [u8; N] = std::array::from_fn(|k| columns[k][i as usize]);
                record[offset..offset + N].copy_from_slice(&bytes);
            }
        }
    }
}

#[inline(always)]
fn put_column(column: &Column, elements: usize, tile: &mut [u8], stride: usize, offset: usize, rows: RowsOf<'_>) {
    with_column!(column, v => match elements {
        1 => put_values(v.as_chunks::<1>().0, tile, stride, offset, rows),
        3 => put_values(v.as_chunks::<3>().0, tile, stride, offset, rows),
        _ => {
            let records = tile.chunks_exact_mut(stride);
            let put = |record: &mut [u8], row: usize| {
                let mut at = offset;
                for value in &v[row * elements..(row + 1) * elements] {
                    let bytes = value.to_le_bytes();
                    record[at..at + bytes.len()].copy_from_slice(&bytes);
                    at += bytes.len();
                }
            };
            match rows {
                RowsOf::From(first) => records.zip(first..).for_each(|(record, row)| put(record, row)),
                RowsOf::Named(rows) => records.zip(rows).for_each(|(record, row)| put(record, *row as usize)),
            }
        }
    });
}

/// A value of a column.
trait Value: Copy {
    fn put(self, to: &mut [u8]);
}

macro_rules! values {
    ($($ty:ty),*) => {$(
        impl Value for $ty {
            #[inline(always)]
            fn put(self, to: &mut [u8]) {
                to.copy_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}

values!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64);

#[inline(always)]
fn put_values<const N: usize, T: Value>(
    values: &[[T; N]],
    tile: &mut [u8],
    stride: usize,
    offset: usize,
    rows: RowsOf<'_>,
) {
    let bytes = N * size_of::<T>();
    let put = |record: &mut [u8], values: &[T; N]| {
        let to = record[offset..offset + bytes].chunks_exact_mut(size_of::<T>());
        to.zip(values).for_each(|(to, value)| value.put(to));
    };
    let records = tile.chunks_exact_mut(stride);
    match rows {
        RowsOf::From(first) => records.zip(&values[first..]).for_each(|(record, values)| put(record, values)),
        RowsOf::Named(rows) => {
            records.zip(rows).for_each(|(record, row)| put(record, &values[*row as usize]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pointmill_format::{Attribute, AttributeType};

    #[test]
    fn every_column_lands_at_its_place_in_the_rows_that_were_named() {
        let ty = |c: &Column| c.ty();
        let columns = [
            Column::UInt16(vec![1, 2, 3, 4, 5, 6]),
            Column::UInt8(vec![7, 8]),
            Column::UInt8(vec![9, 10]),
            Column::Int8(vec![-1, -2]),
            Column::Float64(vec![0.5, f64::NAN]),
            Column::Int16(vec![1, -1, 2, -2]),
        ];
        let elements = [3, 1, 1, 1, 1, 2];
        let attributes: Vec<Attribute> = columns
            .iter()
            .zip(elements)
            .enumerate()
            .map(|(i, (c, n))| Attribute::new(i.to_string(), ty(c), n))
            .collect();
        assert_eq!(attributes[4].ty, AttributeType::Float64);
        let schema = Schema::new(attributes);
        let mut tile = vec![0; 2 * schema.stride];
        let columns: Vec<&Column> = columns.iter().collect();
        for part in Part::of(&columns, &[0, 1, 2, 3, 4, 5].map(Some), &schema) {
            part.put(&mut tile, schema.stride, RowsOf::Named(&[1, 0]));
        }
        let mut run = vec![0; 2 * schema.stride];
        for part in Part::of(&columns, &[0, 1, 2, 3, 4, 5].map(Some), &schema) {
            part.put(&mut run, schema.stride, RowsOf::From(0));
        }
        run.rotate_left(schema.stride);
        assert_eq!(run, tile, "the same rows in the other order");
        let mut expected = vec![0; 12];
        expected.extend([4u16, 5, 6].iter().flat_map(|v| v.to_le_bytes()));
        expected.extend([8, 10, 254]);
        expected.extend(f64::NAN.to_le_bytes());
        expected.extend([2i16, -2].iter().flat_map(|v| v.to_le_bytes()));
        assert_eq!(&tile[..schema.stride], expected);
        assert_eq!(&tile[schema.stride + 12..schema.stride + 14], 1u16.to_le_bytes());
    }
}
