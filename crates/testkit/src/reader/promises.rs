//! The promises of a [`Scan`], one check each.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::ops::ControlFlow;

use pointmill_format::{Column, Positions, Scan, Scratch, Wanted};

use super::cloud::{Cloud, integers, read};
use super::decode::{check_description, decode};

/// Checks everything that a [`Scan`] promises of the columns in `wanted`: what [`read`] checks, and that
///
/// * a second decode gives the same, in another order of the pieces, which is not told before, and with memory that
///   other pieces have used,
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
    let in_order = |i| {
        scratch.next_piece = Some(i + 1);
        outcome(scan, i, wanted, scratch)
    };
    let forth: Vec<Outcome> = (0..count).map(in_order).collect();
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

fn check_stop(scan: &dyn Scan, index: usize, wanted: &Wanted, scratch: &mut Scratch) {
    let mut calls = 0;
    let result = scan.decode(index, wanted, scratch, &mut |_| {
        calls += 1;
        ControlFlow::Break(())
    });
    assert!(result.is_ok(), "a sink that stops is an error: {result:?}");
    assert_eq!(calls, 1, "a sink that stopped is called again");
}
