//! The promises of a [`Scan`], one check each.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::ops::ControlFlow;

use pointmill_format::{Column, MAX_BATCH_POINTS, PointBatch, Positions, ReadError, Scan, ScanInfo, Scratch, Wanted};

use super::{Cloud, check_scan_error, integers, read};

/// Warnings of a file at most: a list of thousands helps nobody.
const MAX_WARNINGS: usize = 50;

/// Checks everything that a [`Scan`] promises of the columns in `wanted`: what [`read`] checks, and that
///
/// * a second decode gives the same, in another order of the pieces and with memory that other pieces have used,
/// * positions do not depend on the columns that come with them,
/// * a sink that stops ends the decode at once and without an error,
/// * a piece that does not exist is an error.
///
/// Pieces after the first `max_points` points are not decoded.
///
/// # Panics
/// If a promise is broken.
pub fn keeps_promises(scan: &dyn Scan, wanted: &Wanted, max_points: u64) {
    check_description(scan);
    let pieces = scan.pieces();
    let count = pieces.iter().take_while(|p| p.first_point <= max_points).count();
    let scratch = &mut Scratch::default();
    let forth: Vec<Outcome> = (0..count).map(|i| outcome(scan, i, wanted, scratch)).collect();
    let alone = Wanted::positions(scan.info());
    for (i, forth) in forth.iter().enumerate().rev() {
        let back = outcome(scan, i, wanted, scratch);
        assert_eq!(&back, forth, "piece {i} differs when decoded again");
        let positions = outcome(scan, i, &alone, scratch);
        if back.error.is_none() && positions.error.is_none() {
            assert_eq!(positions.positions, back.positions, "positions of piece {i} depend on what else is wanted");
        }
        if back.batches > 0 {
            check_stop(scan, i, wanted, scratch);
        }
    }
    let outside = scan.decode(pieces.len(), wanted, scratch, &mut |_| ControlFlow::Continue(()));
    assert!(outside.is_err(), "a piece that does not exist is decoded");
}

/// Checks that each column alone has the values that it has among all, and that positions do not change.
///
/// # Panics
/// If a promise is broken.
pub fn columns_are_independent(scan: &dyn Scan) {
    let all = read(scan, &Wanted::all(scan.info()));
    for (i, attribute) in all.info.attributes.iter().enumerate() {
        let mut wanted = Wanted::positions(scan.info());
        wanted.set(i, true);
        let one = read(scan, &wanted);
        let bits = |c: &Cloud| c.xyz.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(bits(&one) == bits(&all), "positions change when {} alone is wanted", attribute.name);
        let same = integers(&one.columns[i]) == integers(&all.columns[i]);
        assert!(same, "{} differs when it alone is wanted", attribute.name);
    }
}

/// What a decode gave: hashes of the bits.
#[derive(Debug, PartialEq)]
struct Outcome {
    batches: usize,
    positions: u64,
    columns: u64,
    error: Option<String>,
}

fn outcome(scan: &dyn Scan, index: usize, wanted: &Wanted, scratch: &mut Scratch) -> Outcome {
    let (mut positions, mut columns, mut batches) = (DefaultHasher::new(), DefaultHasher::new(), 0);
    let result = decode(scan, index, wanted, scratch, &mut |batch| {
        batches += 1;
        match &batch.positions {
            Positions::Quantized(axes) => axes.hash(&mut positions),
            // which NaN it is does not matter
            Positions::World(axes) => axes.iter().flatten().for_each(|v| {
                positions.write_u64(if v.is_nan() { 1 } else { v.to_bits() });
            }),
        }
        for column in &batch.columns {
            match column {
                Column::Float32(v) => v.iter().for_each(|v| columns.write_u32(v.to_bits())),
                Column::Float64(v) => v.iter().for_each(|v| columns.write_u64(v.to_bits())),
                column => integers(column).hash(&mut columns),
            }
        }
    });
    let error = result.err().map(|e| e.to_string());
    Outcome { batches, positions: positions.finish(), columns: columns.finish(), error }
}

/// Decodes a piece and checks what every decode promises.
pub(super) fn decode(
    scan: &dyn Scan,
    index: usize,
    wanted: &Wanted,
    scratch: &mut Scratch,
    each: &mut dyn FnMut(&PointBatch),
) -> Result<(), ReadError> {
    let piece = &scan.pieces()[index];
    let (mut next, end) = (piece.first_point, piece.first_point + piece.points);
    let result = scan.decode(index, wanted, scratch, &mut |batch| {
        assert_eq!(batch.first_point, next, "batches are consecutive");
        assert!((1..=MAX_BATCH_POINTS).contains(&batch.len()), "a batch of {} points", batch.len());
        next += batch.len() as u64;
        assert!(next <= end, "more points than piece {index} has");
        check_batch(scan.info(), wanted, batch);
        each(batch);
        ControlFlow::Continue(())
    });
    match &result {
        Ok(()) => assert_eq!(next, end, "points are missing in piece {index} without an error"),
        Err(error) => check_scan_error(error),
    }
    let (raw, file_bytes) = (scratch.raw.len() as u64, scan.info().file_bytes);
    assert!(raw <= file_bytes, "{raw} bytes are read from a file of {file_bytes}");
    result
}

fn check_stop(scan: &dyn Scan, index: usize, wanted: &Wanted, scratch: &mut Scratch) {
    let mut calls = 0;
    let result = scan.decode(index, wanted, scratch, &mut |_| {
        calls += 1;
        ControlFlow::Break(())
    });
    assert!(result.is_ok(), "a sink that stops is an error: {result:?}");
    assert_eq!(calls, 1, "a sink that stopped is called again");
}

fn check_batch(info: &ScanInfo, wanted: &Wanted, batch: &PointBatch) {
    let (lengths, is_lattice) = match &batch.positions {
        Positions::Quantized(axes) => (axes.each_ref().map(Vec::len), true),
        Positions::World(axes) => (axes.each_ref().map(Vec::len), false),
    };
    assert_eq!(is_lattice, info.lattice.is_some(), "positions are on a lattice, or the scan has none");
    assert_eq!(lengths, [batch.len(); 3], "the axes have the same length");
    assert_eq!(batch.columns.len(), info.attributes.len(), "one column for each attribute");
    for ((column, attribute), wanted) in batch.columns.iter().zip(info.attributes.iter()).zip(wanted.flags()) {
        let name = &attribute.name;
        assert_eq!(column.ty(), attribute.ty, "the type of {name}");
        let expected = if *wanted { batch.len() * attribute.elements } else { 0 };
        assert_eq!(column.len(), expected, "values of {name}, which is {}wanted", if *wanted { "" } else { "not " });
    }
}

/// Checks info and pieces; the sum of the pieces' points.
pub(super) fn check_description(scan: &dyn Scan) -> u64 {
    let info = scan.info();
    let mut next = 0u64;
    for (i, piece) in scan.pieces().iter().enumerate() {
        assert_eq!(piece.first_point, next, "pieces are consecutive");
        assert!(piece.points > 0, "piece {i} is empty");
        next = piece.first_point.checked_add(piece.points).expect("the number of points overflows");
        let end = piece.byte_offset.checked_add(piece.byte_len);
        assert!(end.is_some_and(|end| end <= info.file_bytes), "piece {i} ends outside the file");
    }
    let warnings = &info.warnings;
    assert!(warnings.len() < MAX_WARNINGS, "{} warnings", warnings.len());
    warnings
        .iter()
        .for_each(|w| assert!(!w.to_string().contains(char::is_control), "a warning is not one line: {w:?}"));
    next
}
