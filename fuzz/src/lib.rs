//! One input of a fuzzer as a file, and the promises of its reader (`pointmill_testkit::reader`).

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use pointmill_format::{ReadError, Scan, ScanKind, Wanted};
pub use pointmill_testkit::reader::check_error;
use pointmill_testkit::reader::{check_scan_error, keeps_promises};

/// Points that are decoded of one input: a few bytes may honestly stand for many points.
const MAX_POINTS: u64 = 1 << 20;

/// How a file is opened.
pub type Open = fn(&Path) -> Result<Box<dyn Scan>, ReadError>;

/// Opens `bytes` as a file and decodes all of it.
///
/// # Panics
/// If a promise of [`Scan`] is broken.
pub fn read(bytes: &[u8], open: Open) {
    let path = write(bytes);
    let _ = ScanKind::of(&bytes[..bytes.len().min(4096)]);
    match open(path) {
        Ok(scan) => keeps_promises(&*scan, &Wanted::all(scan.info()), MAX_POINTS),
        Err(error) => check_scan_error(&error),
    }
}

/// The bytes as a file: readers open paths. One file for the process, in memory where the system has a place for that.
///
/// # Panics
/// If the file cannot be written.
pub fn write(bytes: &[u8]) -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    let path = PATH.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        folder.join(format!("pointmill-fuzz-{}", std::process::id()))
    });
    fs::write(path, bytes).expect("the input can be written");
    path
}
