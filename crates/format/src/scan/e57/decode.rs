//! A piece to batches.

use super::fields::Field;
use super::file::{E57Scan, ScanPlan};
use super::pose::{Pose, spherical_to_cartesian};
use super::scaling::{Scaled, Scaling};
use super::schema::{Fill, PositionFields, Roles, Triple};
use super::streams::Streams;
use super::unpack::{each, each_integer, fill};
use crate::scan::decode::{batch_bytes, batch_points, fitting_batch, point_bytes, resize};
use crate::{Changes, Column, Fault, PointBatch, Positions, ReadError, Scratch, Sink, Wanted, with_column};

/// [`crate::Scan::decode`].
pub(super) fn piece(
    scan: &E57Scan,
    index: usize,
    wanted: &Wanted,
    scratch: &mut Scratch,
    sink: &mut Sink<'_>,
) -> Result<(), ReadError> {
    let (Some(piece), Some(cut)) = (scan.pieces.get(index), scan.cuts.get(index)) else {
        let fault = Fault::NoSuchPiece { piece: index, pieces: scan.pieces.len() };
        return Err(ReadError::unsupported(scan.source.path(), fault));
    };
    let plan = &scan.scans[cut.scan];
    if let Some(fault) = &cut.lost {
        let what = format!("{}; {} points of scan {} are lost", fault.what, cut.records, plan.index + 1);
        return Err(ReadError::broken(scan.source.path(), fault.byte, what).advise(fault.advice.clone()));
    }
    let needed = needed(plan, wanted);
    let Scratch { raw, decoded, batch, .. } = scratch;
    let streams = Streams::gather(&scan.source, cut, &plan.fields, &needed, raw, decoded)?;
    let records = cut.records as usize;
    let step = step(scan);
    let batch = fitting_batch(batch, &scan.info.attributes, false);
    for first in (0..records).step_by(step) {
        let values = Values { fields: &plan.fields, streams: &streams, first, n: (records - first).min(step) };
        batch.first_point = piece.first_point + first as u64;
        batch.clear_changes();
        values.to_batch(plan, wanted, batch);
        if sink(batch).is_break() {
            break;
        }
    }
    Ok(())
}

/// Records of a batch: whole bytes of every stream, so that it starts at a byte border.
fn step(scan: &E57Scan) -> usize {
    (batch_points(point_bytes(&scan.info.attributes, false)) / 8 * 8).max(8)
}

/// The fields that positions and wanted columns are made of.
fn needed(plan: &ScanPlan, wanted: &Wanted) -> Vec<bool> {
    let mut needed = vec![false; plan.fields.len()];
    plan.positions.mark(&mut needed);
    for (_, fill) in plan.fills.iter().enumerate().filter(|(column, _)| wanted.is_wanted(*column)) {
        Roles::mark(*fill, &mut needed);
    }
    needed
}

/// [`crate::Scan::decode_bytes`].
pub(super) fn bytes(scan: &E57Scan, wanted: &Wanted) -> u64 {
    let mut records = vec![0; scan.scans.len()];
    scan.cuts.iter().for_each(|cut| records[cut.scan] = cut.records.max(records[cut.scan]));
    let streams = scan.scans.iter().zip(&records);
    let streams = streams.map(|(plan, records)| Streams::bytes(&plan.fields, &needed(plan, wanted), *records));
    let points = records.iter().copied().max().unwrap_or(0).min(step(scan) as u64);
    // directions, or the other form of positions, and which of them are valid
    let others = 3 * size_of::<f64>() as u64 + 1;
    let batch = batch_bytes(&scan.info.attributes, false, wanted, points);
    streams.max().unwrap_or(0) + batch + points * others
}

/// Counts what becomes of the values of a column. Points without a position do not count: they are none.
struct Tally<'a> {
    /// Of all points; NaN where a position is invalid.
    xs: &'a [f64],
    changes: Changes,
}

impl Tally<'_> {
    fn is_point(&self, i: usize) -> bool {
        self.xs.get(i).is_none_or(|x| !x.is_nan())
    }

    /// A value outside of its range.
    #[cold]
    fn outside(&mut self, i: usize, value: f64) {
        if !self.is_point(i) {
        } else if value.is_finite() {
            self.changes.clamp(value);
        } else {
            self.changes.not_finite += 1;
        }
    }

    /// A value that is not there.
    fn missing(&mut self, i: usize) {
        self.changes.missing += u64::from(self.is_point(i));
    }
}

/// The packed values of a run of records.
pub(super) struct Values<'a> {
    pub(super) fields: &'a [Field],
    pub(super) streams: &'a Streams<'a>,
    /// The first of the records within the streams, a multiple of 8.
    pub(super) first: usize,
    /// Records.
    pub(super) n: usize,
}

impl Values<'_> {
    /// Positions and wanted columns of the records.
    fn to_batch(&self, plan: &ScanPlan, wanted: &Wanted, batch: &mut PointBatch) {
        if let Positions::World(xyz) = &mut batch.positions {
            xyz.iter_mut().for_each(|axis| resize(axis, self.n));
            self.positions(&plan.positions, &plan.pose, xyz.each_mut().map(Vec::as_mut_slice));
        }
        let xs: &[f64] = match &batch.positions {
            Positions::World([x, ..]) => x,
            Positions::Quantized(_) => &[],
        };
        let elements: Vec<_> = batch.attributes().iter().map(|attribute| attribute.elements).collect();
        let mut counted = Vec::new();
        for (i, (column, elements)) in batch.columns.iter_mut().zip(elements).enumerate() {
            let len = if wanted.is_wanted(i) { self.n * elements } else { 0 };
            with_column!(&mut *column, v => resize(v, len));
            if len > 0 {
                let mut tally = Tally { xs, changes: Changes::default() };
                self.column(plan, plan.fills[i], column, &mut tally);
                counted.push((i, tally.changes));
            }
        }
        counted.iter().for_each(|(column, changes)| batch.count_changes(*column, changes));
    }

    /// The packed values of a field.
    fn stream(&self, field: usize) -> &[u8] {
        self.streams.field(field, self.first / 8 * self.fields[field].encoding.bits() as usize)
    }

    /// Calls `put` with the number and meant value of a field of each record.
    #[inline(always)]
    pub(super) fn each(&self, field: usize, put: impl FnMut(usize, f64)) {
        each(self.fields[field].encoding, self.stream(field), self.n, put);
    }

    /// Calls `hit` with the number of each record whose state is not 0 ("valid").
    fn each_invalid(&self, state: Option<usize>, mut hit: impl FnMut(usize)) {
        if let Some(state) = state {
            self.each(state, |i, v| {
                if v != 0.0 {
                    hit(i);
                }
            });
        }
    }

    fn triple(&self, triple: Triple, xyz: [&mut [f64]; 3]) {
        for (field, out) in triple.into_iter().zip(xyz) {
            match field {
                Some(field) => fill(self.fields[field].encoding, self.stream(field), out),
                None => out.fill(0.0),
            }
        }
    }

    /// World coordinates; NaN where they are invalid. Where cartesian ones are, the spherical ones count.
    fn positions(&self, fields: &PositionFields, pose: &Pose, xyz: [&mut [f64]; 3]) {
        let [x, y, z] = xyz;
        let spherical = |triple: Triple, [x, y, z]: [&mut [f64]; 3]| {
            self.triple(triple, [&mut *x, &mut *y, &mut *z]);
            spherical_to_cartesian([&mut *x, &mut *y, &mut *z]);
            self.each_invalid(fields.spherical_invalid, |i| [x[i], y[i], z[i]] = [f64::NAN; 3]);
        };
        match (fields.cartesian, fields.spherical) {
            (Some(cartesian), None) => {
                self.triple(cartesian, [&mut *x, &mut *y, &mut *z]);
                self.each_invalid(fields.cartesian_invalid, |i| [x[i], y[i], z[i]] = [f64::NAN; 3]);
            }
            (Some(cartesian), Some(triple)) => {
                self.triple(cartesian, [&mut *x, &mut *y, &mut *z]);
                if fields.cartesian_invalid.is_some() {
                    let mut other: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; self.n]);
                    spherical(triple, other.each_mut().map(Vec::as_mut_slice));
                    let [sx, sy, sz] = &other;
                    self.each_invalid(fields.cartesian_invalid, |i| [x[i], y[i], z[i]] = [sx[i], sy[i], sz[i]]);
                }
            }
            (None, Some(triple)) => spherical(triple, [&mut *x, &mut *y, &mut *z]),
            (None, None) => {}
        }
        pose.apply([x, y, z]);
    }

    fn column(&self, plan: &ScanPlan, fill: Fill, column: &mut Column, tally: &mut Tally<'_>) {
        match (fill, column) {
            (Fill::ScanIndex(index), Column::UInt16(out)) => out.fill(index),
            (Fill::Colour { fields, scaling, invalid }, Column::UInt16(out)) => {
                let is_invalid = self.invalid(invalid);
                let out = out.as_chunks_mut::<3>().0;
                for (element, (field, scaling)) in fields.into_iter().zip(scaling).enumerate() {
                    self.scaled(field, scaling, &is_invalid, tally, |i, v| {
                        if let Some(rgb) = out.get_mut(i) {
                            rgb[element] = v;
                        }
                    });
                }
                self.each_invalid(invalid, |i| {
                    out[i] = [0; 3];
                    tally.missing(i);
                });
            }
            (Fill::Intensity { field, scaling, invalid }, Column::UInt16(out)) => {
                self.scaled(field, scaling, &self.invalid(invalid), tally, |i, v| {
                    if let Some(out) = out.get_mut(i) {
                        *out = v;
                    }
                });
                self.each_invalid(invalid, |i| {
                    out[i] = 0;
                    tally.missing(i);
                });
            }
            (Fill::Normal { fields, axis }, Column::Float32(out)) => {
                let mut normal: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; self.n]);
                self.triple(fields.map(Some), normal.each_mut().map(Vec::as_mut_slice));
                plan.pose.rotate(normal.each_mut().map(Vec::as_mut_slice));
                out.iter_mut().zip(&normal[axis]).for_each(|(out, v)| *out = *v as f32);
            }
            (Fill::Plain { field, invalid, add }, column) => self.plain(field, invalid, add, column, tally),
            (_, column) => {
                with_column!(column, v => v.fill(Default::default()));
                (0..self.n).for_each(|i| tally.missing(i));
            }
        }
    }

    /// For each record whether its state is not 0 ("valid"); empty without such a field.
    fn invalid(&self, state: Option<usize>) -> Vec<bool> {
        let mut is_invalid = vec![false; if state.is_some() { self.n } else { 0 }];
        self.each_invalid(state, |i| is_invalid[i] = true);
        is_invalid
    }

    /// A field scaled to 16 bits; what is outside the range counts, but where it is invalid.
    #[inline(always)]
    fn scaled(
        &self,
        field: usize,
        scaling: Scaling,
        is_invalid: &[bool],
        tally: &mut Tally<'_>,
        mut put: impl FnMut(usize, u16),
    ) {
        self.each(field, |i, v| match scaling.apply(v) {
            Scaled::Within(v) => put(i, v),
            Scaled::Outside(nearest) => {
                if !is_invalid.get(i).copied().unwrap_or(false) {
                    tally.outside(i, v);
                }
                put(i, nearest);
            }
        });
    }

    /// A field as it is. Integers that lie outside their declared range (a fault of the file) stay within their type.
    fn plain(&self, field: usize, invalid: Option<usize>, add: i64, column: &mut Column, tally: &mut Tally<'_>) {
        let (encoding, bytes) = (self.fields[field].encoding, self.stream(field));
        macro_rules! integers {
            ($out:ident, $ty:ty) => {{
                each_integer(encoding, bytes, self.n, |i, v| {
                    if let Some(out) = $out.get_mut(i) {
                        // `min` and `max` of the type fit: the schema does not use uint64
                        let v = v.saturating_add(add);
                        *out = v.clamp(<$ty>::MIN as i64, <$ty>::MAX as i64) as $ty;
                        if i128::from(*out) != i128::from(v) {
                            tally.outside(i, v as f64);
                        }
                    }
                });
                self.each_invalid(invalid, |i| {
                    $out[i] = 0;
                    tally.missing(i);
                });
            }};
        }
        macro_rules! floats {
            ($out:ident, $ty:ty) => {{
                each(encoding, bytes, self.n, |i, v| {
                    if let Some(out) = $out.get_mut(i) {
                        *out = (v + add as f64) as $ty;
                    }
                });
                self.each_invalid(invalid, |i| $out[i] = <$ty>::NAN);
            }};
        }
        match column {
            Column::Int8(out) => integers!(out, i8),
            Column::UInt8(out) => integers!(out, u8),
            Column::Int16(out) => integers!(out, i16),
            Column::UInt16(out) => integers!(out, u16),
            Column::Int32(out) => integers!(out, i32),
            Column::UInt32(out) => integers!(out, u32),
            Column::Int64(out) => integers!(out, i64),
            Column::UInt64(out) => out.fill(0),
            Column::Float32(out) => floats!(out, f32),
            Column::Float64(out) => floats!(out, f64),
        }
    }
}
