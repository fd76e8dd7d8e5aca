//! A look at some rows, where names and types do not show what a column means.

use std::ops::ControlFlow;

use super::scan::{Decoder, RowScan, Storage};
use super::schema::{Field, Rule, Schema, Target};
use crate::{Attribute, AttributeType, Column, Piece, Scratch, Wanted};

/// Places in the file that are looked at, evenly spread.
const PLACES: usize = 16;
/// Rows at each.
const ROWS: u64 = 1024;
/// Bytes of text at each.
const BYTES: u64 = 256 << 10;

/// What the sampled values of a column have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ColumnRange {
    pub(crate) min: f64,
    pub(crate) max: f64,
    /// All are whole numbers.
    pub(crate) integers: bool,
}

impl ColumnRange {
    pub(crate) const EMPTY: Self = Self { min: f64::INFINITY, max: f64::NEG_INFINITY, integers: true };

    /// True if every sampled value is a whole number from `min` to `max`.
    pub(crate) fn is_integer_in(&self, min: f64, max: f64) -> bool {
        self.integers && self.is_in(min, max)
    }

    /// True if every sampled value is from `min` to `max`.
    pub(crate) fn is_in(&self, min: f64, max: f64) -> bool {
        self.min >= min && self.max <= max
    }

    pub(crate) fn add(&mut self, v: f64) {
        if v.is_nan() {
            return;
        }
        self.min = self.min.min(v);
        self.max = self.max.max(v);
        self.integers &= v.fract() == 0.0;
    }
}

/// The ranges of the fields `picks` (indices) in a sample of the rows. Rows that cannot be read are skipped here;
/// the decode reports them.
fn probe_fields(scan: &RowScan, picks: &[usize]) -> Vec<ColumnRange> {
    let mut ranges = vec![ColumnRange::EMPTY; picks.len()];
    probe_rows(scan, picks, |row| {
        ranges.iter_mut().zip(row).for_each(|(range, v)| range.add(*v));
    });
    ranges
}

/// Hands sampled rows of the fields `picks` to `visit`.
pub(crate) fn probe_rows(scan: &RowScan, picks: &[usize], mut visit: impl FnMut(&[f64])) {
    if picks.is_empty() {
        return;
    }
    let schema = probe_schema(&scan.schema, picks);
    let wanted = Wanted::from_iter([true]);
    let attributes = schema.attributes.clone().into();
    let decoder = Decoder {
        source: &scan.source,
        schema: &schema,
        attributes: &attributes,
        storage: &scan.storage,
        wanted: &wanted,
    };
    let mut scratch = Scratch::default();
    let step = scan.pieces.len().div_ceil(PLACES).max(1);
    let last = scan.pieces.len().checked_sub(1);
    for (_, piece) in scan.pieces.iter().enumerate().filter(|(i, _)| i % step == 0 || Some(*i) == last) {
        let part = if is_text(scan) { shortened(piece) } else { Piece { points: piece.points.min(ROWS), ..*piece } };
        // an error here is one in the decode, too, which reports it
        let _ = decoder.piece(&part, &mut scratch, &mut |batch| {
            if let [Column::Float64(values)] = batch.columns.as_slice() {
                values.chunks_exact(picks.len()).for_each(&mut visit);
            }
            ControlFlow::Continue(())
        });
    }
}

/// The fields `picks` as one column of doubles, everything else omitted.
fn probe_schema(schema: &Schema, picks: &[usize]) -> Schema {
    let field = |(i, f): (usize, &Field)| {
        let target = match (picks.iter().position(|p| *p == i), f.target) {
            (Some(element), _) => Target::Value { column: 0, element, rule: Rule::Convert },
            (None, Target::List) => Target::List,
            (None, _) => Target::Skip,
        };
        Field { target, ..*f }
    };
    Schema {
        attributes: vec![Attribute::new("probe", AttributeType::Float64, picks.len())],
        fields: schema.fields.iter().enumerate().map(field).collect(),
        flat: false,
    }
}

fn is_text(scan: &RowScan) -> bool {
    matches!(scan.storage, Storage::Lines(_) | Storage::Stream)
}

/// The first lines of a piece of text, few enough to lie inside the bytes for certain.
fn shortened(piece: &Piece) -> Piece {
    if piece.byte_len <= BYTES {
        return Piece { points: piece.points.min(ROWS), ..*piece };
    }
    // half of what lines of average length would allow
    let points = (u128::from(piece.points) * u128::from(BYTES) / u128::from(piece.byte_len) / 2) as u64;
    Piece { points: points.clamp(1, ROWS), byte_len: BYTES, ..*piece }
}

/// Colours that are floats: 0–1 unless a sample says 0–255 or 0–65535. Sets the rule of their fields.
pub(crate) fn settle_float_colours(scan: &mut RowScan) {
    let is_unit = |f: &Field| matches!(f.target, Target::Value { rule: Rule::Unit, .. });
    let picks: Vec<_> = scan.schema.fields.iter().enumerate().filter(|(_, f)| is_unit(f)).map(|(i, _)| i).collect();
    let ranges = probe_fields(scan, &picks);
    if ranges.iter().all(|r| r.max <= 1.001 || *r == ColumnRange::EMPTY) {
        return;
    }
    for i in picks {
        if let Target::Value { rule, .. } = &mut scan.schema.fields[i].target {
            *rule = Rule::Convert;
        }
    }
}
