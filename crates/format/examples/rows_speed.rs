//! Decodes PLY, PCD and text files and prints a line each: points, a sum that depends on every position, million points
//! a second of one thread. `cargo run --release --features ply,pcd,text --example rows_speed -- FILE... [--positions]`

use std::io::Read;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use pointmill_format::scan::{pcd, ply, text};
use pointmill_format::{Positions, ReadError, Scan, Scratch, Wanted};

fn main() -> Result<(), ReadError> {
    let positions_only = std::env::args().any(|a| a == "--positions");
    for path in std::env::args().skip(1).filter(|a| !a.starts_with("--")) {
        let start = Instant::now();
        let scan = open(path.as_ref())?;
        let open_secs = start.elapsed().as_secs_f64();
        scan.info().warnings.iter().for_each(|line| eprintln!("{path}: {line}"));
        let wanted = if positions_only { Wanted::positions(scan.info()) } else { Wanted::all(scan.info()) };
        let (mut scratch, mut points, mut sum) = (Scratch::default(), 0, 0.0);
        for piece in 0..scan.pieces().len() {
            let result = scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
                points += batch.len();
                if let Positions::World(xyz) = &batch.positions {
                    sum += xyz.iter().flatten().sum::<f64>();
                }
                ControlFlow::Continue(())
            });
            if let Err(e) = result {
                eprintln!("{e}");
            }
        }
        let secs = start.elapsed().as_secs_f64();
        let rate = points as f64 / secs / 1e6;
        let format = &scan.info().format;
        println!(
            "{path} ({format}): {points} points, sum {sum:.3}, opened in {open_secs:.2} s, {rate:.1} M/s with that"
        );
    }
    Ok(())
}

/// By content, as a converter does it.
fn open(path: &Path) -> Result<Box<dyn Scan>, ReadError> {
    let mut first = [0; 4096];
    let read = std::fs::File::open(path)
        .and_then(|mut f| f.read(&mut first))
        .map_err(|e| ReadError::io(path, "opening", e))?;
    match &first[..read] {
        bytes if ply::is_ply(bytes) => ply::open(path),
        bytes if pcd::is_pcd(bytes) => pcd::open(path),
        _ => text::open(path, &text::TextOptions::default()),
    }
}
