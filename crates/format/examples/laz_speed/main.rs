//! Decodes LAZ files with this crate and with the crate `laz` in turn, one thread, all attributes, and prints their
//! times and the ratio:
//! `cargo run --release -p pointmill-format --features las --example laz_speed -- FILE... [--as FORMATS] [--runs N]`
//!
//! `--as 3,3+4,6,7+4` encodes the points of the files anew, with `laz`, in these point formats with so many extra
//! bytes; the files must be of format 3 then, LAS or LAZ. `--ours` decodes with this crate alone, for a profile.

mod encode;

use std::error::Error;
use std::io::{Cursor, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use laz::{LasZipDecompressor, LazVlr};
use pointmill_format::scan::las;
use pointmill_format::{Positions, Scratch, Wanted};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Records that `laz` decodes at once, as this crate does: they stay in the cache.
const BLOCK: usize = 512;

/// What must be equal.
#[derive(Debug, Default, PartialEq)]
struct Sums {
    points: u64,
    xyz: [i64; 3],
}

fn main() -> Result<()> {
    let (mut files, mut formats, mut runs, mut only_ours) = (Vec::new(), Vec::new(), 5, false);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--as" => formats = encode::formats(&args.next().unwrap_or_default())?,
            "--runs" => runs = args.next().unwrap_or_default().parse()?,
            "--ours" => only_ours = true,
            _ => files.push(PathBuf::from(arg)),
        }
    }
    println!(
        "| points of | format | points | bytes/point | here ns/point | `laz` ns/point | ratio |\n|---|---|---|---|---|---|---|"
    );
    for path in &files {
        if formats.is_empty() {
            measure(path, path, runs, only_ours)?;
        }
        for format in &formats {
            let mut file = tempfile::Builder::new().suffix(".laz").tempfile()?;
            file.write_all(&encode::file(&std::fs::read(path)?, *format)?)?;
            measure(path, file.path(), runs, only_ours)?;
        }
    }
    Ok(())
}

/// A line of the table: the least times (others were disturbed), and the median of the ratios of the pairs.
fn measure(name: &Path, path: &Path, runs: usize, only_ours: bool) -> Result<()> {
    let file = std::fs::read(path)?;
    let (mut ours, mut theirs, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let mut points = 1;
    for _ in 0..runs.max(1) {
        let (sums, time) = timed(|| decode(path))?;
        points = sums.points;
        ours.push(time);
        if !only_ours {
            let (right, time) = timed(|| decode_by_laz(&file))?;
            assert_eq!(sums, right);
            theirs.push(time);
            ratios.push(ours[ours.len() - 1] / time);
        }
    }
    let (head, start) = (encode::Head::read(&file)?, name.file_stem().unwrap_or_default().display());
    let extra = head.record_len - encode::RECORD_LEN[usize::from(head.format)];
    let format = if extra > 0 { format!("{} + {extra} bytes", head.format) } else { head.format.to_string() };
    let [ours, theirs] = [ours, theirs].map(|times| times.into_iter().fold(f64::NAN, f64::min) * 1e9 / points as f64);
    let (bytes, ratio) = (file.len() as f64 / points as f64, median(ratios));
    println!("| {start} | {format} | {points} | {bytes:.1} | {ours:.0} | {theirs:.0} | {ratio:.2} |");
    Ok(())
}

fn timed(decode: impl FnOnce() -> Result<Sums>) -> Result<(Sums, f64)> {
    let start = Instant::now();
    let sums = decode()?;
    Ok((sums, start.elapsed().as_secs_f64()))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Opens the file, and decodes it to columns.
fn decode(path: &Path) -> Result<Sums> {
    let scan = las::open(path)?;
    let (wanted, mut scratch, mut sums) = (Wanted::all(scan.info()), Scratch::default(), Sums::default());
    for piece in 0..scan.pieces().len() {
        scratch.next_piece = Some(piece + 1);
        scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
            sums.points += batch.len() as u64;
            if let Positions::Quantized(xyz) = &batch.positions {
                for (sum, axis) in sums.xyz.iter_mut().zip(xyz) {
                    *sum += axis.iter().map(|v| i64::from(*v)).sum::<i64>();
                }
            }
            ControlFlow::Continue(())
        })?;
    }
    Ok(sums)
}

/// Decodes a file in memory to records.
fn decode_by_laz(file: &[u8]) -> Result<Sums> {
    let head = encode::Head::read(file)?;
    let vlr = LazVlr::from_buffer(head.laszip(file)?)?;
    let mut source = Cursor::new(file);
    source.set_position(head.points_start as u64);
    let mut decoder = LasZipDecompressor::new(source, vlr)?;
    let mut sums = Sums { points: head.points as u64, ..Sums::default() };
    let mut records = vec![0; BLOCK * head.record_len];
    let mut left = head.points;
    while left > 0 {
        let block = &mut records[..left.min(BLOCK) * head.record_len];
        decoder.decompress_many(block)?;
        for record in block.chunks_exact(head.record_len) {
            for (sum, bytes) in sums.xyz.iter_mut().zip(record.as_chunks::<4>().0) {
                *sum += i64::from(i32::from_le_bytes(*bytes));
            }
        }
        left -= left.min(BLOCK);
    }
    Ok(sums)
}
