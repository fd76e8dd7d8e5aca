//! The readers under test and their fixtures.

use std::path::Path;

use pointmill_format::scan::text::{self, TextOptions};
use pointmill_format::scan::{pcd, ply};
use pointmill_format::{ReadError, Scan, ScanKind};
use pointmill_testkit::files;
use pointmill_testkit::reader::{Cloud, Reader};
use pointmill_testkit::scans::{ScanFixture, scan_fixtures};

/// By content; what is neither PLY nor PCD should be text.
fn open(path: &Path) -> Result<Box<dyn Scan>, ReadError> {
    match ScanKind::of_file(path)? {
        Some(ScanKind::Ply) => ply::open(path),
        Some(ScanKind::Pcd) => pcd::open(path),
        _ => text::open(path, &TextOptions::default()),
    }
}

pub(crate) const ROWS: Reader = Reader {
    open,
    // a compressed block repeats a byte 264 times at most; other points have bytes of theirs
    max_points: |bytes| 264 * bytes + 1,
    max_decoded: |bytes| 128 * bytes + 4096,
};

pub(crate) fn fixtures() -> Vec<ScanFixture> {
    scan_fixtures("rows")
}

/// Reads a fixture.
pub(crate) fn read(name: &str) -> Cloud {
    ROWS.read(&files::fixture("rows").join(name)).unwrap()
}

/// Reads a file with these bytes.
pub(crate) fn read_bytes(bytes: impl AsRef<[u8]>) -> Result<Cloud, ReadError> {
    ROWS.read_bytes(bytes)
}
