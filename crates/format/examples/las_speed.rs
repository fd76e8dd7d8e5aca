//! Decodes LAS and LAZ files and prints a line per file: points, sums of all values, million points per second
//! of one thread. `cargo run --release --features las --example las_speed -- FILE... [--positions]`

use std::ops::ControlFlow;
use std::time::Instant;

use pointmill_format::scan::las;
use pointmill_format::{Positions, ReadError, Scratch, Wanted};

fn main() -> Result<(), ReadError> {
    let positions_only = std::env::args().any(|a| a == "--positions");
    for path in std::env::args().skip(1).filter(|a| !a.starts_with("--")) {
        let scan = las::open(&path)?;
        scan.info().warnings.iter().for_each(|line| eprintln!("{path}: {line}"));
        let wanted = if positions_only { Wanted::positions(scan.info()) } else { Wanted::all(scan.info()) };
        let (mut scratch, mut points, mut sum) = (Scratch::default(), 0, [0i64; 3]);
        let start = Instant::now();
        for piece in 0..scan.pieces().len() {
            scratch.next_piece = Some(piece + 1);
            let result = scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
                points += batch.len();
                if let Positions::Quantized(xyz) = &batch.positions {
                    for (sum, axis) in sum.iter_mut().zip(xyz) {
                        *sum += axis.iter().map(|v| i64::from(*v)).sum::<i64>();
                    }
                }
                ControlFlow::Continue(())
            });
            if let Err(e) = result {
                eprintln!("{e}");
            }
        }
        let secs = start.elapsed().as_secs_f64();
        println!("{path} ({}): {points} points, {sum:?}, {:.1} M/s", scan.info().format, points as f64 / secs / 1e6);
    }
    Ok(())
}
