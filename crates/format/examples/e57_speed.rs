//! Decodes E57 files and prints a line per file: points, sums of all values, million points per second of one
//! thread. `cargo run --release --features e57 --example e57_speed -- FILE... [--positions]`

use std::ops::ControlFlow;
use std::time::Instant;

use pointmill_format::scan::e57;
use pointmill_format::{Column, Positions, ReadError, Scratch, Wanted};

fn main() -> Result<(), ReadError> {
    let positions_only = std::env::args().any(|a| a == "--positions");
    for path in std::env::args().skip(1).filter(|a| !a.starts_with("--")) {
        let start = Instant::now();
        let scan = e57::open(&path)?;
        let opened = start.elapsed().as_secs_f64();
        scan.info().warnings.iter().for_each(|line| eprintln!("{path}: {line}"));
        let wanted = if positions_only { Wanted::positions(scan.info()) } else { Wanted::all(scan.info()) };
        let (mut scratch, mut points, mut sum, mut sum16) = (Scratch::default(), 0, [0.0; 3], 0u64);
        for piece in 0..scan.pieces().len() {
            let result = scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
                points += batch.len();
                if let Positions::World(xyz) = &batch.positions {
                    for (sum, axis) in sum.iter_mut().zip(xyz) {
                        // four sums: one would wait for itself
                        *sum += axis
                            .chunks(4)
                            .fold([0.0; 4], |mut s, c| {
                                s.iter_mut().zip(c).for_each(|(s, v)| *s += v);
                                s
                            })
                            .iter()
                            .sum::<f64>();
                    }
                }
                for column in &batch.columns {
                    if let Column::UInt16(v) = column {
                        sum16 += v.iter().map(|v| u64::from(*v)).sum::<u64>();
                    }
                }
                ControlFlow::Continue(())
            });
            if let Err(e) = result {
                eprintln!("{e}");
            }
        }
        let secs = start.elapsed().as_secs_f64();
        let speed = points as f64 / secs / 1e6;
        println!(
            "{path} ({}): {points} points, {sum:?}, {sum16}, {speed:.1} M/s ({opened:.3} s to open)",
            scan.info().format
        );
    }
    Ok(())
}
