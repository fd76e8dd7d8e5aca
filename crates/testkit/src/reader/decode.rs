//! One decode, and what each promises.

use std::ops::ControlFlow;

use pointmill_format::{
    MAX_BATCH_BYTES, MAX_BATCH_POINTS, PointBatch, Positions, ReadError, Scan, ScanInfo, Scratch, Wanted, with_column,
};

use super::errors::check_scan_error;

/// Warnings of a file at most: a list of thousands helps nobody.
const MAX_WARNINGS: usize = 50;

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
        let bytes = column_bytes(batch);
        assert!(bytes <= MAX_BATCH_BYTES || batch.len() == 1, "a batch of {} points takes {bytes} bytes", batch.len());
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
    let (taken, said) =
        (scratch.raw.capacity() + scratch.decoded.capacity(), scan.decode_bytes(&Wanted::all(scan.info())));
    assert!(taken as u64 <= said, "{taken} bytes are taken, {said} should be enough");
    result
}

/// Bytes of positions and columns.
fn column_bytes(batch: &PointBatch) -> usize {
    let positions = match &batch.positions {
        Positions::Quantized(axes) => axes.iter().map(|v| size_of_val(v.as_slice())).sum::<usize>(),
        Positions::World(axes) => axes.iter().map(|v| size_of_val(v.as_slice())).sum(),
    };
    positions + batch.columns.iter().map(|c| with_column!(c, v => size_of_val(v.as_slice()))).sum::<usize>()
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
    check_parts(scan, next);
    let warnings = &info.warnings;
    assert!(warnings.len() < MAX_WARNINGS, "{} warnings", warnings.len());
    warnings
        .iter()
        .for_each(|w| assert!(!w.to_string().contains(char::is_control), "a warning is not one line: {w:?}"));
    next
}

/// The parts share all points, in order; no piece has points of two.
fn check_parts(scan: &dyn Scan, points: u64) {
    let (parts, pieces) = (&scan.info().parts, scan.pieces());
    let mut next = 0;
    for part in parts {
        assert_eq!(part.range.start, next, "parts are consecutive");
        next = part.range.end;
        let inside = |at: u64| part.range.contains(&at);
        let is_split = |first: u64, last: u64| inside(first) != inside(last);
        assert!(
            !pieces.iter().any(|p| is_split(p.first_point, p.first_point + p.points - 1)),
            "a piece is split by part {}",
            part.number
        );
    }
    assert!(parts.is_empty() || next == points, "the parts have {next} points, the pieces {points}");
    assert!(parts.windows(2).all(|two| two[0].number < two[1].number), "the numbers of parts rise");
}
