//! The reader under test, its fixtures, and pages with right checksums.

use pointmill_format::ReadError;
use pointmill_format::scan::e57::{self, E57Options};
use pointmill_testkit::damage::{put, u64_at};
use pointmill_testkit::files;
use pointmill_testkit::reader::{Cloud, Reader};
use pointmill_testkit::scans::{ScanFixture, scan_fixtures};

pub(crate) const E57: Reader = Reader {
    open: |path| e57::open_with(path, E57Options::default().keep_row_column(true)),
    // a bit per record, and scans of constants
    max_points: |bytes| 8 * bytes + 65_536 * 16,
    // text and padding aside, streams are copies of the file's bytes
    max_decoded: |bytes| 2 * bytes + 64 * 1024,
};

pub(crate) fn fixtures() -> Vec<ScanFixture> {
    scan_fixtures("e57")
}

/// Reads a fixture.
pub(crate) fn read(name: &str) -> Cloud {
    E57.read(&files::fixture("e57").join(name)).unwrap()
}

/// The bytes of a fixture.
pub(crate) fn fixture(name: &str) -> Vec<u8> {
    files::fixture_bytes(&format!("e57/{name}"))
}

/// Reads a file with these bytes.
pub(crate) fn read_bytes(bytes: &[u8]) -> Result<Cloud, ReadError> {
    E57.read_bytes(bytes)
}

/// Makes the checksums of all pages right.
pub(crate) fn repair(bytes: &mut [u8]) {
    for page in bytes.chunks_exact_mut(1024) {
        let crc = crc32c::crc32c(&page[..1020]).to_be_bytes();
        page[1020..].copy_from_slice(&crc);
    }
}

/// Replaces text of the XML section, which must end the file, once; header and checksums follow.
pub(crate) fn replace(bytes: &mut Vec<u8>, old: &str, new: &str) {
    let (offset, len) = (u64_at(bytes, 24) as usize, u64_at(bytes, 32) as usize);
    let start = offset - offset / 1024 * 4;
    let mut logical: Vec<u8> = bytes.chunks_exact(1024).flat_map(|page| &page[..1020]).copied().collect();
    let xml = String::from_utf8(logical[start..start + len].to_vec()).unwrap();
    assert!(xml.contains(old), "no {old}");
    let xml = xml.replacen(old, new, 1);
    logical.truncate(start);
    logical.extend_from_slice(xml.as_bytes());
    logical.resize(logical.len().div_ceil(1020) * 1020, b' ');
    let file_len = logical.len() as u64 / 1020 * 1024;
    put(&mut logical, 16, &file_len.to_le_bytes());
    put(&mut logical, 32, &(xml.len() as u64).to_le_bytes());
    *bytes = logical.chunks_exact(1020).flat_map(|page| [page, &[0; 4]].concat()).collect();
    repair(bytes);
}

pub(crate) fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * (1.0 + a.abs().max(b.abs())) || a.is_nan() && b.is_nan()
}
