//! Records to columns: the hot loop of reading LAS.
//!
//! A loop a column, over blocks of records that stay in the first-level cache, with the record length known to the
//! compiler for the common formats. `examples/las_speed.rs` measures it.

use super::compatible::Recovered;
use super::schema::{Field, FieldKind};
use crate::scan::decode;
use crate::{Column, PointBatch, Positions, Wanted, with_column};

/// Records whose columns are filled before the next ones are touched: 34-byte records × 512 = 17 kB, half of a
/// first-level cache.
pub(super) const BLOCK: usize = 512;

/// Makes room for `points` points in the positions and the wanted columns of `batch`; the others are emptied.
///
/// `resize`, not `clear`: a column that was as long before is not zeroed again.
pub(super) fn resize(points: usize, fields: &[Field], wanted: &Wanted, batch: &mut PointBatch) {
    let Positions::Quantized(xyz) = &mut batch.positions else { return };
    xyz.iter_mut().for_each(|axis| decode::resize(axis, points));
    for (i, (field, column)) in fields.iter().zip(&mut batch.columns).enumerate() {
        let len = if is_wanted(wanted, i) { points * field.elements } else { 0 };
        with_column!(column, v => decode::resize(v, len));
    }
}

/// Writes the whole records in `raw`, `record_len` (> 0) bytes each, to `batch` from point `first` on.
///
/// `batch` was made ready by [`resize`], for at least `first` and these records; its columns fit `fields` in type.
pub(super) fn fill(
    raw: &[u8],
    record_len: usize,
    first: usize,
    fields: &[Field],
    wanted: &Wanted,
    batch: &mut PointBatch,
) {
    let Positions::Quantized(xyz) = &mut batch.positions else { return };
    let columns = fields.iter().zip(&mut batch.columns).enumerate();
    let mut columns: Vec<(Field, &mut Column)> =
        columns.filter(|(i, _)| is_wanted(wanted, *i)).map(|(_, (field, column))| (*field, column)).collect();
    let fill_blocks = match record_len {
        20 => fill_blocks::<20>,
        26 => fill_blocks::<26>,
        28 => fill_blocks::<28>,
        30 => fill_blocks::<30>,
        34 => fill_blocks::<34>,
        36 => fill_blocks::<36>,
        38 => fill_blocks::<38>,
        _ => fill_blocks::<0>,
    };
    fill_blocks(raw, record_len, first, xyz, &mut columns);
}

fn is_wanted(wanted: &Wanted, index: usize) -> bool {
    wanted.is_wanted(index)
}

/// `LEN`: the record length, or 0 for any (`record_len`).
fn fill_blocks<const LEN: usize>(
    raw: &[u8],
    record_len: usize,
    first: usize,
    xyz: &mut [Vec<i32>; 3],
    columns: &mut [(Field, &mut Column)],
) {
    let record_len = if LEN == 0 { record_len } else { LEN };
    for (b, block) in raw.chunks(BLOCK * record_len).enumerate() {
        let first = first + b * BLOCK;
        let points = block.len() / record_len;
        for (axis, out) in xyz.iter_mut().enumerate() {
            gather::<LEN, 4, _>(block, record_len, 4 * axis, &mut out[first..first + points], i32::from_le_bytes);
        }
        for (field, column) in &mut *columns {
            fill_column::<LEN>(block, record_len, *field, column, first, points);
        }
    }
}

fn fill_column<const LEN: usize>(
    block: &[u8],
    len: usize,
    field: Field,
    column: &mut Column,
    first: usize,
    points: usize,
) {
    let Field { at, elements, kind, .. } = field;
    let range = first * elements..(first + points) * elements;
    if let (FieldKind::Bits { shift, mask }, Column::UInt8(out)) = (kind, &mut *column) {
        return gather::<LEN, 1, _>(block, len, at, &mut out[range], |[b]| b >> shift & mask);
    }
    if let FieldKind::Recovered(from) = kind {
        return match column {
            Column::UInt8(out) => from.fill_bytes(block, len, at, &mut out[range]),
            Column::Int16(out) => Recovered::fill_angles(block, len, at, &mut out[range]),
            _ => {}
        };
    }
    macro_rules! values {
        ($out:ident, $size:literal, $from:expr) => {
            match elements {
                1 => gather::<LEN, $size, _>(block, len, at, &mut $out[range], $from),
                2 => gather_many::<LEN, $size, 2, _>(block, len, at, &mut $out[range], $from),
                _ => gather_many::<LEN, $size, 3, _>(block, len, at, &mut $out[range], $from),
            }
        };
    }
    match column {
        Column::Int8(out) => values!(out, 1, i8::from_le_bytes),
        Column::UInt8(out) => values!(out, 1, u8::from_le_bytes),
        Column::Int16(out) => values!(out, 2, i16::from_le_bytes),
        Column::UInt16(out) => values!(out, 2, u16::from_le_bytes),
        Column::Int32(out) => values!(out, 4, i32::from_le_bytes),
        Column::UInt32(out) => values!(out, 4, u32::from_le_bytes),
        Column::Int64(out) => values!(out, 8, i64::from_le_bytes),
        Column::UInt64(out) => values!(out, 8, u64::from_le_bytes),
        Column::Float32(out) => values!(out, 4, f32::from_le_bytes),
        Column::Float64(out) => values!(out, 8, f64::from_le_bytes),
    }
}

/// One value of each record, from its byte `at` on.
#[inline(always)]
fn gather<const LEN: usize, const SIZE: usize, T>(
    block: &[u8],
    len: usize,
    at: usize,
    out: &mut [T],
    from: impl Fn([u8; SIZE]) -> T,
) {
    let len = if LEN == 0 { len } else { LEN };
    let end = at + SIZE;
    assert!(end <= len, "the schema keeps fields inside the record");
    for (value, record) in out.iter_mut().zip(block.chunks_exact(len)) {
        if let Some(bytes) = record[at..end].first_chunk() {
            *value = from(*bytes);
        }
    }
}

/// `N` values of each record, side by side from its byte `at` on.
#[inline(always)]
fn gather_many<const LEN: usize, const SIZE: usize, const N: usize, T>(
    block: &[u8],
    len: usize,
    at: usize,
    out: &mut [T],
    from: impl Fn([u8; SIZE]) -> T,
) {
    let len = if LEN == 0 { len } else { LEN };
    let end = at + SIZE * N;
    assert!(end <= len, "the schema keeps fields inside the record");
    for (values, record) in out.chunks_exact_mut(N).zip(block.chunks_exact(len)) {
        let (elements, _) = record[at..end].as_chunks::<SIZE>();
        for (value, bytes) in values.iter_mut().zip(elements) {
            *value = from(*bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::schema::Layer;
    use super::*;
    use crate::AttributeType;

    /// Records of `len` bytes whose byte `i` of record `r` is a hash of both.
    fn records(len: usize, points: usize) -> Vec<u8> {
        (0..len * points).map(|i| (i.wrapping_mul(0x9e37_79b1) >> 11) as u8).collect()
    }

    /// Every specialised length and the general one give what a naive loop gives, over block borders.
    #[test]
    fn columns_equal_a_naive_read_for_every_record_length() {
        let points = 2 * BLOCK + 17;
        for len in [20, 26, 28, 30, 34, 36, 38, 41] {
            let raw = records(len, points);
            let field = |at, elements, kind| Field { at, elements, kind, layer: Layer::Base };
            let fields = [
                field(14, 1, FieldKind::Bits { shift: 3, mask: 7 }),
                field(len - 6, 3, FieldKind::Plain),
                field(len - 8, 1, FieldKind::Plain),
                field(0, 1, FieldKind::Plain),
            ];
            let types = [AttributeType::UInt8, AttributeType::UInt16, AttributeType::Float64, AttributeType::Int8];
            let mut batch = PointBatch::new(0, Positions::Quantized(Default::default()), []);
            batch.columns = types.map(Column::new).into();
            let wanted = Wanted::from_iter([true, true, true, false]);
            resize(points, &fields, &wanted, &mut batch);
            let (head, tail) = raw.split_at(700 * len);
            fill(tail, len, 700, &fields, &wanted, &mut batch);
            fill(head, len, 0, &fields, &wanted, &mut batch);
            let Positions::Quantized([x, _, z]) = &batch.positions else { panic!() };
            let [Column::UInt8(bits), Column::UInt16(rgb), Column::Float64(time), Column::Int8(none)] =
                &batch.columns[..]
            else {
                panic!()
            };
            assert!(none.is_empty());
            assert_eq!((x.len(), bits.len(), rgb.len(), time.len()), (points, points, 3 * points, points));
            for (i, r) in raw.chunks_exact(len).enumerate() {
                assert_eq!(x[i].to_le_bytes(), r[0..4]);
                assert_eq!(z[i].to_le_bytes(), r[8..12]);
                assert_eq!(bits[i], r[14] >> 3 & 7);
                assert_eq!(rgb[3 * i + 1].to_le_bytes(), r[len - 4..len - 2]);
                assert_eq!(time[i].to_le_bytes(), r[len - 8..], "NaN patterns survive too");
            }
        }
    }
}
