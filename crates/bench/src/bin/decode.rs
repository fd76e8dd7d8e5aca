//! Decodes a LAZ file once in one thread: by the `laz` crate to records, or by pointmill's reader to columns.
//!
//! ```sh
//! cargo run --release -p pointmill-bench --bin decode -- scan.laz laz
//! cargo run --release -p pointmill-bench --bin decode -- scan.laz pointmill
//! ```

use std::error::Error;
use std::fs::File;
use std::io::{BufReader, Seek, SeekFrom};
use std::ops::ControlFlow;
use std::path::Path;

use laz::{LasZipDecompressor, LazVlr};
use pointmill_format::scan::las;
use pointmill_format::{Scratch, Wanted, bytes};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Records that are decoded to the same memory, one after the other, so that they stay in the cache.
const RUN: u64 = 512;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let points = match &args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [file, "laz"] => by_laz(Path::new(file))?,
        [file, "pointmill"] => by_pointmill(Path::new(file))?,
        _ => return Err("arguments: FILE laz|pointmill".into()),
    };
    println!("{points} points");
    Ok(())
}

/// Points that were decoded.
fn by_pointmill(path: &Path) -> Result<u64> {
    let scan = las::open(path)?;
    let (wanted, mut scratch, mut points) = (Wanted::all(scan.info()), Scratch::default(), 0);
    for piece in 0..scan.pieces().len() {
        scratch.next_piece = Some(piece + 1);
        scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
            points += std::hint::black_box(batch).len() as u64;
            ControlFlow::Continue(())
        })?;
    }
    Ok(points)
}

/// Points that were decoded.
fn by_laz(path: &Path) -> Result<u64> {
    let mut file = File::open(path)?;
    let header = Header::read(&file)?;
    file.seek(SeekFrom::Start(header.points_start))?;
    let mut decompressor = LasZipDecompressor::new(BufReader::with_capacity(1 << 20, file), header.laz)?;
    let mut records = vec![0; RUN as usize * header.record_len];
    for first in (0..header.points).step_by(RUN as usize) {
        let points = RUN.min(header.points - first) as usize;
        decompressor.decompress_many(&mut records[..points * header.record_len])?;
        std::hint::black_box(&records);
    }
    Ok(header.points)
}

/// What decoding needs to know.
struct Header {
    points_start: u64,
    record_len: usize,
    points: u64,
    laz: LazVlr,
}

impl Header {
    fn read(file: &File) -> Result<Self> {
        let mut head = [0; 375]; // LAS 1.2 has less, but points follow
        bytes::read_exact_at(file, &mut head, 0)?;
        let u16_at = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
        let u32_at = |at: usize| u32::from(u16_at(at)) | u32::from(u16_at(at + 2)) << 16;
        let header_len = u64::from(u16_at(94));
        let modern = u64::from(u32_at(247)) | u64::from(u32_at(251)) << 32;
        let points = if header_len >= 375 { modern } else { u64::from(u32_at(107)) };
        let mut at = header_len;
        for _ in 0..u32_at(100) {
            let mut vlr = [0; 54];
            bytes::read_exact_at(file, &mut vlr, at)?;
            let mut record = vec![0; usize::from(u16::from_le_bytes([vlr[20], vlr[21]]))];
            bytes::read_exact_at(file, &mut record, at + 54)?;
            if vlr[2..18].starts_with(LazVlr::USER_ID.as_bytes()) {
                let (points_start, record_len) = (u64::from(u32_at(96)), usize::from(u16_at(105)));
                return Ok(Self { points_start, record_len, points, laz: LazVlr::from_buffer(record)? });
            }
            at += 54 + record.len() as u64;
        }
        Err("no LASzip record: not a LAZ file".into())
    }
}

#[cfg(test)]
mod tests {
    use pointmill_bench::las_file;
    use pointmill_bench::las_layout::LasLayout;
    use pointmill_bench::scene::Scene;

    use super::*;

    #[test]
    fn both_decode_every_point_of_every_layout() {
        let dir = tempfile::tempdir().unwrap();
        for layout in [LasLayout::COLOUR, LasLayout::EXTRA, LasLayout::MODERN, LasLayout::MODERN_COLOUR] {
            let path = dir.path().join("s.laz");
            las_file::write(Scene::Aerial, layout, 50_001, 7, &path).unwrap();
            assert_eq!((by_laz(&path).unwrap(), by_pointmill(&path).unwrap()), (50_001, 50_001), "{}", layout.name());
        }
        std::fs::write(dir.path().join("s.las"), [0; 400]).unwrap();
        assert!(by_laz(&dir.path().join("s.las")).is_err());
    }
}
