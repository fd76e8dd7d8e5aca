//! The reader under test, its fixtures, and where things stand in a file.

use pointmill_format::scan::las;
use pointmill_format::{MAX_BATCH_POINTS, ReadError};
use pointmill_testkit::damage::u32_at;
use pointmill_testkit::files;
use pointmill_testkit::reader::{Cloud, Reader};
use pointmill_testkit::scans::{ScanFixture, scan_fixtures};

/// 2048 points per byte is the bound of the densest compression; one batch of records, which are
/// shorter than 256 bytes in all fixtures, is decompressed at a time.
pub(crate) const LAS: Reader = Reader {
    open: |path| las::open(path),
    max_points: |bytes| 2048 * bytes + 1,
    max_decoded: |_| (MAX_BATCH_POINTS * 256) as u64,
};

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
