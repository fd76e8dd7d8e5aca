//! The reader under test, its fixtures, and where things stand in a file.

use std::io::Cursor;

use laz::{LasZipCompressor, LazVlr};
use pointmill_format::ReadError;
use pointmill_format::scan::las;
use pointmill_testkit::damage::{put, u32_at};
use pointmill_testkit::files;
use pointmill_testkit::reader::{Cloud, Reader};
use pointmill_testkit::scans::{ScanFixture, scan_fixtures};

/// 2048 points per byte is the bound of the densest compression; 512 records, which are shorter than 256 bytes in all
/// fixtures, are decompressed at a time.
pub(crate) const LAS: Reader =
    Reader { open: |path| las::open(path), max_points: |bytes| 2048 * bytes + 1, max_decoded: |_| 512 * 256 };

/// All fixtures but the large real scan.
pub(crate) fn small_fixtures() -> Vec<ScanFixture> {
    scan_fixtures("las").into_iter().filter(ScanFixture::is_small).collect()
}

/// Reads a fixture.
pub(crate) fn read(name: &str) -> Cloud {
    LAS.read(&files::fixture("las").join(name)).unwrap()
}

/// The bytes of a fixture.
pub(crate) fn fixture(name: &str) -> Vec<u8> {
    files::fixture_bytes(&format!("las/{name}"))
}

/// Reads a file with these bytes.
pub(crate) fn read_bytes(bytes: &[u8]) -> Result<Cloud, ReadError> {
    LAS.read_bytes(bytes)
}

/// First byte of the point data.
pub(crate) fn points_start(bytes: &[u8]) -> usize {
    u32_at(bytes, 96) as usize
}

/// A LAZ file of `points` points with the header of the fixture of that point format, which `compress` compresses.
pub(crate) fn laz_file(
    point_format: u8,
    vlr: LazVlr,
    points: usize,
    compress: impl FnOnce(&mut LasZipCompressor<'_, &mut Cursor<Vec<u8>>>),
) -> Vec<u8> {
    let mut bytes = fixture(&format!("format{point_format}.las"));
    bytes.truncate(points_start(&bytes));
    let mut data = Vec::new();
    vlr.write_to(&mut data).unwrap();
    bytes.extend([0, 0]);
    bytes.extend(b"laszip encoded\0\0");
    bytes.extend(22204u16.to_le_bytes());
    bytes.extend((data.len() as u16).to_le_bytes());
    bytes.extend([0; 32]);
    bytes.extend(data);
    let (start, vlrs) = (bytes.len() as u32, u32_at(&bytes, 100) + 1);
    put(&mut bytes, 96, &start.to_le_bytes());
    put(&mut bytes, 100, &vlrs.to_le_bytes());
    bytes[104] |= 0x80;
    put(&mut bytes, 107, &(points as u32).to_le_bytes());
    if point_format >= 6 {
        put(&mut bytes, 247, &(points as u64).to_le_bytes());
    }
    let mut out = Cursor::new(bytes);
    out.set_position(u64::from(start));
    let mut compressor = LasZipCompressor::new(&mut out, vlr).unwrap();
    compress(&mut compressor);
    compressor.done().unwrap();
    drop(compressor);
    out.into_inner()
}
