//! Lengths that lie, and files that are larger than what is needed of them, cost no memory.

use std::fs::{File, OpenOptions as Create};
use std::io::{Seek, SeekFrom, Write};
use std::ops::ControlFlow;
use std::path::Path;

use pointmill_format::scan::text::{self, TextOptions};
use pointmill_format::{OpenOptions, ReadError, Scratch, Wanted, open_scan};
use pointmill_testkit::Random;
use pointmill_testkit::damage::{mutated, put, rounds, u32_at};
use pointmill_testkit::files;
use pointmill_testkit::las::Las;
use pointmill_testkit::scans::scan_fixtures;
use tempfile::TempPath;

use crate::counting::peak_of;

const MIB: u64 = 1 << 20;

/// Opens a scan and decodes all of it; the number of points, and the most memory that it took.
fn read(path: &Path) -> (Result<u64, ReadError>, u64) {
    peak_of(|| {
        let scan = open_scan(path, &OpenOptions::default())?;
        let (wanted, mut scratch, mut points) = (Wanted::all(scan.info()), Scratch::default(), 0);
        for piece in 0..scan.pieces().len() {
            scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
                points += batch.len() as u64;
                ControlFlow::Continue(())
            })?;
        }
        Ok(points)
    })
}

/// A file of these bytes with room behind them, which takes no disk.
fn sparse(ending: &str, bytes: &[u8], len: u64) -> (TempPath, File) {
    let path = tempfile::Builder::new().suffix(ending).tempfile().unwrap().into_temp_path();
    let mut file = Create::new().write(true).open(&path).unwrap();
    file.write_all(bytes).unwrap();
    file.set_len(len).unwrap();
    (path, file)
}

fn write_at(file: &mut File, at: u64, bytes: &[u8]) {
    file.seek(SeekFrom::Start(at)).unwrap();
    file.write_all(bytes).unwrap();
}

/// The head of a variable length record of LAS.
fn record_head(user_id: &str, record_id: u16, len: &[u8]) -> Vec<u8> {
    let mut head = vec![0; if len.len() == 2 { 54 } else { 60 }];
    put(&mut head, 2, user_id.as_bytes());
    put(&mut head, 18, &record_id.to_le_bytes());
    put(&mut head, 20, len);
    head
}

#[test]
fn records_of_las_are_held_up_to_a_limit_together() {
    let las = Las::terrain(100, 1).bytes();
    let (start, count, len) = (u32_at(&las, 96) as usize, 1000u64, u16::MAX);
    let new_start = start as u64 + count * (54 + u64::from(len));
    let mut head = las[..start].to_vec();
    put(&mut head, 96, &(new_start as u32).to_le_bytes());
    put(&mut head, 100, &(count as u32).to_le_bytes());
    let points = &las[start..];
    let (path, mut file) = sparse(".las", &head, new_start + points.len() as u64);
    for i in 0..count {
        let at = start as u64 + i * (54 + u64::from(len));
        write_at(&mut file, at, &record_head("LASF_Projection", 2112, &len.to_le_bytes()));
    }
    write_at(&mut file, new_start, points);
    let (points, taken) = read(&path);
    assert_eq!(points.unwrap(), 100);
    assert!(taken < 12 * MIB, "{taken} bytes");
    let warnings = open_scan(&path, &OpenOptions::default()).unwrap().info().warnings.clone();
    assert_eq!(warnings.iter().filter(|w| w.to_string().contains("is not read")).count(), 1, "{warnings:?}");
}

#[test]
fn a_record_of_4_gib_is_passed_over() {
    let mut head = Las { point_format: 6, ..Las::terrain(100, 1) }.bytes();
    let end = head.len() as u64;
    put(&mut head, 235, &end.to_le_bytes());
    put(&mut head, 243, &1u32.to_le_bytes());
    let (path, mut file) = sparse(".las", &head, end + 60 + (4 << 30));
    write_at(&mut file, end, &record_head("LASF_Projection", 2112, &(4u64 << 30).to_le_bytes()));
    let (points, taken) = read(&path);
    assert_eq!(points.unwrap(), 100);
    assert!(taken < MIB, "{taken} bytes");
}

#[test]
fn a_chunk_table_of_millions_of_entries_is_not_read() {
    let laz = files::fixture_bytes("las/format3.laz");
    let start = u64::from(u32_at(&laz, 96));
    let table = start + 8 + (300 << 20);
    let (path, mut file) = sparse(".laz", &laz, table + (100 << 20));
    write_at(&mut file, start, &table.to_le_bytes());
    write_at(&mut file, table, &[0u32, 3_000_000].map(u32::to_le_bytes).concat());
    let (scan, taken) = peak_of(|| open_scan(&path, &OpenOptions::default()));
    let warnings = scan.unwrap().info().warnings.clone();
    assert!(warnings.iter().any(|w| w.to_string().contains("3000000 chunks, more than the 2097152")), "{warnings:?}");
    assert!(taken < 4 * MIB, "{taken} bytes");
}

#[test]
fn lists_are_passed_over_unread() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
                  property float z\nproperty list uint uchar l\nend_header\n";
    let list = 60 * MIB;
    let row = [vec![0; 12], (list as u32).to_le_bytes().to_vec()].concat();
    let start = header.len() as u64;
    let (path, mut file) = sparse(".ply", header.as_bytes(), start + 2 * (16 + list));
    (0..2).for_each(|i| write_at(&mut file, start + i * (16 + list), &row));
    let (points, taken) = read(&path);
    assert_eq!(points.unwrap(), 2);
    assert!(taken < 3 * MIB, "{taken} bytes");
    // and one that is longer than the file has no points
    write_at(&mut file, start + 12, &u32::MAX.to_le_bytes());
    let (points, taken) = read(&path);
    assert_eq!(points.unwrap(), 0);
    assert!(taken < 3 * MIB, "{taken} bytes");
}

#[test]
fn lines_of_any_length_are_not_held() {
    let long = "1 ".repeat(450_000) + "\n";
    let cases: [(&str, Vec<u8>); 4] = [
        (".xyz", vec![b'1'; 32 << 20]),
        (".xyz", [b"1 2 3\n".repeat(2000), vec![b'1'; 32 << 20]].concat()),
        (".xyz", long.repeat(40).into()),
        (".ptx", ["1\n1\n0 0 0\n", &long.repeat(40)].concat().into()),
    ];
    for (ending, text) in cases {
        let (path, _) = sparse(ending, &text, text.len() as u64);
        let (points, taken) = read(&path);
        let error = points.unwrap_err();
        assert!(taken < 48 * MIB, "{taken} bytes: {error}");
        assert!(error.offset().is_some() && error.advice().is_some(), "{error}");
    }
}

#[test]
fn very_many_scans_in_a_ptx_are_refused() {
    let scan = "0\n0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let (path, _) = sparse(".ptx", scan.repeat(100_001).as_bytes(), 100_001 * scan.len() as u64);
    let (points, taken) = read(&path);
    assert!(points.unwrap_err().what().contains("more than 100000 scans"));
    assert!(taken < 32 * MIB, "{taken} bytes");
}

#[test]
fn no_damage_to_a_small_file_costs_much_memory() {
    let mut random = Random::new(11);
    for fixture in ["las", "e57", "rows"].into_iter().flat_map(scan_fixtures).filter(|f| f.is_small()) {
        let bytes = fixture.bytes();
        let head = bytes.len().min(2000);
        for round in 0..rounds(20) {
            let ranges = [0..head, bytes.len() - head / 4..bytes.len()];
            let bytes = if round == 0 { bytes.clone() } else { mutated(&bytes, &ranges, &mut random) };
            let ending = fixture.path.extension().map_or(String::new(), |e| format!(".{}", e.to_string_lossy()));
            let (path, _) = sparse(&ending, &bytes, bytes.len() as u64);
            let (_, taken) = read(&path);
            assert!(taken < 32 * MIB, "{}: {taken} bytes", fixture.name);
        }
    }
}

#[test]
#[cfg(unix)]
fn a_pipe_is_refused_without_waiting() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("scan.xyz");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    if !made.is_ok_and(|status| status.success()) {
        return eprintln!("there is no mkfifo: not tested");
    }
    // by its name, and by the reader itself
    assert!(open_scan(&pipe, &OpenOptions::default()).is_err());
    let error = text::open(&pipe, &TextOptions::default()).err().unwrap();
    assert!(error.to_string().contains("pipe"), "{error}");
}
