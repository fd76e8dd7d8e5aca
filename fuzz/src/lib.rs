//! One input of a fuzzer as a file, and the promises of its reader (`pointmill_testkit::reader`).

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use pointmill_format::{ReadError, Scan, ScanKind, Wanted};
pub use pointmill_testkit::reader::check_error;
use pointmill_testkit::reader::{check_scan_error, keeps_promises};

/// Points that are decoded of one input: a few bytes may honestly stand for many points.
pub const MAX_POINTS: u64 = 1 << 20;

/// The files of depth maps that are fuzzed, by the first byte of an input: of a single one, and of a folder with a trajectory.
pub const DEPTH_FILES: [&str; 8] = [
    "single.png",
    "single.json",
    "single_colour.png",
    "tum/depth.txt",
    "tum/rgb.txt",
    "tum/groundtruth.txt",
    "tum/depth/1305031102.194330.png",
    "tum/rgb/1305031102.209430.png",
];

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

/// The bytes as a file: readers open paths.
///
/// # Panics
/// If the file cannot be written.
pub fn write(bytes: &[u8]) -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    let path = PATH.get_or_init(|| folder().join("input"));
    fs::write(path, bytes).expect("the input can be written");
    path
}

/// The folder for files of this process, in memory where the system has a place for that.
///
/// # Panics
/// If it cannot be made.
pub fn folder() -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let make = || {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let folder = folder.join(format!("pointmill-fuzz-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder can be made");
        folder
    };
    FOLDER.get_or_init(make).clone()
}

/// Bytes of a page of an E57 file.
const PAGE: usize = 1024;

/// An E57 file whose pages have the right checksums: no mutation would get past these. What is no whole page is cut off.
pub fn repaired(bytes: &[u8]) -> Vec<u8> {
    let repair = |page: &[u8]| {
        let data = &page[..PAGE - 4];
        [data, &crc32c::crc32c(data).to_be_bytes()].concat()
    };
    bytes.chunks_exact(PAGE).flat_map(repair).collect()
}
