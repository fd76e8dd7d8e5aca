//! Columns to records: the hot loop of writing LAS. A loop a column, over tiles of records that stay in the first-level
//! cache.

use super::strided::StridedColumn;
use crate::scan::las::compatible::angle_of_rank;
use crate::{AttributeType, Changes};

/// Records to which one column after the other is written: 34 bytes × 512 = 17 kB, half of a first-level cache.
const TILE: usize = 512;

/// Degrees of a step of the scan angle of formats 6 and above.
const FINE: f64 = 0.006;

/// How an attribute gets into records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Move {
    /// Index of its column; none for what has no column.
    pub(super) attribute: usize,
    pub(super) target: Target,
}

/// Where in a record values go, and how.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    /// `bytes` bytes as they are.
    Copy { at: usize, bytes: usize },
    /// A byte, in some bits of a byte.
    Bits { at: usize, shift: u8, mask: u8, change: Change },
    /// A number of any type in an unsigned field: in some bits of a byte, or (`most` > 255) in two bytes.
    Whole { at: usize, shift: u8, most: u16, change: Change },
    /// Whole degrees in steps of 0.006°.
    Angle { at: usize },
    /// Degrees as doubles in steps of 0.006°.
    Degrees { at: usize },
    /// No column: 1 for what is missing, or as many returns as the number of the point's own.
    OnlyReturn { is_wide: bool, number: bool, of: bool },
}

/// What becomes of a value that is too large.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Change {
    /// The nearest end.
    Clamp,
    /// 0, as another value would mean something else.
    LeaveOut,
}

impl Change {
    /// The value instead of one outside of 0 to `most`.
    fn take(self, value: f64, most: u16, changes: &mut Changes) -> u16 {
        match self {
            Self::Clamp => {
                changes.clamp(value);
                if value > 0.0 { most } else { 0 }
            }
            Self::LeaveOut => {
                changes.leave_out(value);
                0
            }
        }
    }
}

/// [`super::RecordLayout::put`].
pub(super) fn put(
    moves: &[Move],
    record_len: usize,
    positions: &[StridedColumn<'_>; 3],
    columns: &[Option<StridedColumn<'_>>],
    out: &mut [u8],
    changes: &mut [Changes],
) {
    let count = out.len() / record_len;
    let there = positions.iter().chain(columns.iter().flatten());
    assert!(there.map(StridedColumn::len).all(|len| len >= count), "columns are as long as the records are many");
    let put_tile = match record_len {
        20 => put_tile::<20>,
        26 => put_tile::<26>,
        28 => put_tile::<28>,
        30 => put_tile::<30>,
        34 => put_tile::<34>,
        36 => put_tile::<36>,
        38 => put_tile::<38>,
        _ => put_tile::<0>,
    };
    for (i, tile) in out.chunks_mut(TILE * record_len).enumerate() {
        tile.fill(0);
        put_tile(moves, record_len, positions, columns, i * TILE, tile, changes);
    }
}

/// `LEN`: the record length, or 0 for any (`record_len`).
fn put_tile<const LEN: usize>(
    moves: &[Move],
    record_len: usize,
    positions: &[StridedColumn<'_>; 3],
    columns: &[Option<StridedColumn<'_>>],
    first: usize,
    tile: &mut [u8],
    changes: &mut [Changes],
) {
    let len = if LEN == 0 { record_len } else { LEN };
    for (axis, position) in positions.iter().enumerate() {
        scatter::<LEN, 4>(position.from(first), tile, len, 4 * axis);
    }
    for Move { attribute, target } in moves {
        if let Target::OnlyReturn { is_wide, number, of } = target {
            let (mask, shift) = if *is_wide { (0b1111, 4) } else { (0b111, 3) };
            for record in tile.chunks_exact_mut(len) {
                record[14] |= u8::from(*number);
                record[14] |= if *of { (record[14] & mask) << shift } else { 0 };
            }
            continue;
        }
        let Some(column) = columns.get(*attribute).and_then(Option::as_ref) else { continue };
        let mut own = Changes::default();
        put_column::<LEN>(column, first, *target, tile, len, &mut own);
        if let Some(changes) = changes.get_mut(*attribute) {
            changes.merge(&own);
        }
    }
}

fn put_column<const LEN: usize>(
    column: &StridedColumn<'_>,
    first: usize,
    target: Target,
    tile: &mut [u8],
    len: usize,
    changes: &mut Changes,
) {
    let values = column.from(first);
    match target {
        Target::Copy { at, bytes } => match bytes {
            1 => scatter::<LEN, 1>(values, tile, len, at),
            2 => scatter::<LEN, 2>(values, tile, len, at),
            3 => scatter::<LEN, 3>(values, tile, len, at),
            4 => scatter::<LEN, 4>(values, tile, len, at),
            6 => scatter::<LEN, 6>(values, tile, len, at),
            8 => scatter::<LEN, 8>(values, tile, len, at),
            12 => scatter::<LEN, 12>(values, tile, len, at),
            24 => scatter::<LEN, 24>(values, tile, len, at),
            _ => scatter_any(values, tile, len, at, bytes),
        },
        Target::Bits { at, shift, mask, change } => {
            if put_bits::<LEN>(values, tile, len, at, shift, mask) & !mask != 0 {
                mend_bits(values, tile, len, target, change, changes);
            }
        }
        Target::Whole { at, shift, most, change } => {
            for (record, value) in tile.chunks_exact_mut(len).zip(numbers(values, column.ty())) {
                let whole = whole(value, most, change, changes);
                if most > 255 {
                    record[at..at + 2].copy_from_slice(&whole.to_le_bytes());
                } else {
                    record[at] |= (whole as u8) << shift;
                }
            }
        }
        Target::Angle { at } => {
            for (record, rank) in tile.chunks_exact_mut(len).zip(values.0.iter().step_by(values.1)) {
                record[at..at + 2].copy_from_slice(&angle_of_rank(rank.cast_signed()).to_le_bytes());
            }
        }
        Target::Degrees { at } => {
            for (record, degrees) in tile.chunks_exact_mut(len).zip(numbers(values, column.ty())) {
                record[at..at + 2].copy_from_slice(&angle(degrees, changes).to_le_bytes());
            }
        }
        Target::OnlyReturn { .. } => {}
    }
}

/// The nearest step of 0.006°; what is neither that step nor a whole degree is counted.
fn angle(degrees: f64, changes: &mut Changes) -> i16 {
    let steps = (degrees / FINE).round();
    let nearest = steps as i16; // the ends are clamped, NaN is 0
    if degrees.is_nan() {
        changes.leave_out(degrees);
    } else if f64::from(nearest) != steps {
        changes.clamp(degrees);
    } else if (steps * FINE - degrees).abs() > 1e-9 && degrees.fract() != 0.0 {
        changes.round(degrees);
    }
    nearest
}

/// `SIZE` bytes to each record, to its byte `at`.
#[inline(always)]
fn scatter<const LEN: usize, const SIZE: usize>(
    (values, stride): (&[u8], usize),
    tile: &mut [u8],
    len: usize,
    at: usize,
) {
    let len = if LEN == 0 { len } else { LEN };
    assert!(at + SIZE <= len, "the layout keeps fields inside the record");
    let records = tile.chunks_exact_mut(len);
    if stride == SIZE {
        for (record, value) in records.zip(values.as_chunks::<SIZE>().0) {
            record[at..at + SIZE].copy_from_slice(value);
        }
    } else {
        for (i, record) in records.enumerate() {
            record[at..at + SIZE].copy_from_slice(&values[i * stride..][..SIZE]);
        }
    }
}

fn scatter_any((values, stride): (&[u8], usize), tile: &mut [u8], len: usize, at: usize, bytes: usize) {
    for (i, record) in tile.chunks_exact_mut(len).enumerate() {
        record[at..at + bytes].copy_from_slice(&values[i * stride..][..bytes]);
    }
}

/// Puts the lower bits of bytes where they belong; all bytes together are returned, or one is too large.
#[inline(always)]
fn put_bits<const LEN: usize>(
    (values, stride): (&[u8], usize),
    tile: &mut [u8],
    len: usize,
    at: usize,
    shift: u8,
    mask: u8,
) -> u8 {
    let len = if LEN == 0 { len } else { LEN };
    assert!(at < len, "the layout keeps fields inside the record");
    let mut all = 0;
    if stride == 1 {
        for (record, value) in tile.chunks_exact_mut(len).zip(values) {
            all |= value;
            record[at] |= (value & mask) << shift;
        }
    } else {
        for (record, value) in tile.chunks_exact_mut(len).zip(values.iter().step_by(stride)) {
            all |= value;
            record[at] |= (value & mask) << shift;
        }
    }
    all
}

/// Replaces the values that [`put_bits`] had to cut.
#[cold]
fn mend_bits(
    (values, stride): (&[u8], usize),
    tile: &mut [u8],
    len: usize,
    target: Target,
    change: Change,
    changes: &mut Changes,
) {
    let Target::Bits { at, shift, mask, .. } = target else { return };
    for (record, value) in tile.chunks_exact_mut(len).zip(values.iter().step_by(stride)) {
        if *value > mask {
            let taken = change.take(f64::from(*value), u16::from(mask), changes) as u8;
            record[at] = record[at] & !(mask << shift) | taken << shift;
        }
    }
}

/// A whole number from 0 to `most`.
fn whole(value: f64, most: u16, change: Change, changes: &mut Changes) -> u16 {
    if !value.is_finite() {
        changes.not_finite += 1;
        return 0;
    }
    let rounded = value.round();
    if !(0.0..=f64::from(most)).contains(&rounded) {
        return change.take(value, most, changes);
    }
    if rounded != value {
        changes.round(value);
    }
    rounded as u16
}

/// The first element of each value as a double.
fn numbers<'a>((values, stride): (&'a [u8], usize), ty: AttributeType) -> impl Iterator<Item = f64> + 'a {
    values.chunks(stride).map(move |bytes| number(bytes, ty))
}

/// The number at the start of `bytes`.
pub(super) fn number(bytes: &[u8], ty: AttributeType) -> f64 {
    macro_rules! number {
        ($t:ty) => {
            bytes.first_chunk().map_or(0.0, |b| <$t>::from_le_bytes(*b) as f64)
        };
    }
    match ty {
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
}
