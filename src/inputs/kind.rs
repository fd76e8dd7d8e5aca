//! Whether a file is a scan: by its content, else by its extension.

use std::ffi::OsStr;
use std::fs;
use std::io::{self, Read as _};
use std::path::Path;

use pointmill_format::scan::depth::is_described;
use pointmill_format::scan::text::{TextKind, is_other_text};
use pointmill_format::{ErrorKind, OtherKind, ScanKind};

/// Whether a file is a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A scan, or a file with the extension of one: its reader decides.
    Scan,
    /// Anything else.
    NoScan,
}

/// Says what a file is, by its first bytes, else by its ending.
pub(super) fn kind(path: &Path) -> io::Result<Kind> {
    match content(path)? {
        Some(_) => Ok(Kind::Scan),
        None if fs::metadata(path)?.is_file() => Ok(kind_by_ending(path)),
        None => Ok(Kind::NoScan), // a pipe, say
    }
}

/// [`kind`] of a file that a folder brought along. Lines of numbers are many things (matrices, tracks, logs): they count
/// as a scan if the ending says so too. So does a picture of 16-bit grey if a file beside it describes its camera.
pub(super) fn kind_in_folder(path: &Path) -> io::Result<Kind> {
    match content(path)? {
        Some(ScanKind::Text(TextKind::Xyz | TextKind::Pts)) if !ends_with(path, &TEXT_ENDINGS) => Ok(Kind::NoScan),
        Some(ScanKind::Depth) if !is_described(path) => Ok(Kind::NoScan),
        _ => kind(path),
    }
}

/// True for a file that is called like a scan, or has rows of numbers, and is something else: a raster, a well log, a
/// table (unless its columns are named), prose under the extension of a text scan.
pub(super) fn is_other(path: &Path, columns_named: bool) -> io::Result<bool> {
    let mut first = Vec::new();
    fs::File::open(path)?.take(OTHER_BYTES).read_to_end(&mut first)?;
    let is_text = matches!(ScanKind::of(&first), None | Some(ScanKind::Text(_))) && !ends_with(path, &BINARY_ENDINGS);
    Ok(OtherKind::of(&first).is_some() || is_text && !columns_named && is_other_text(&first))
}

fn content(path: &Path) -> io::Result<Option<ScanKind>> {
    ScanKind::of_file(path).map_err(|e| {
        let line = e.to_string();
        match e.into_kind() {
            ErrorKind::Io(error) => error,
            _ => io::Error::other(line),
        }
    })
}

/// Extensions of scans whose content may be too damaged to be recognised.
const SCAN_ENDINGS: [&str; 8] = ["las", "laz", "e57", "ply", "pcd", "pts", "ptx", "xyz"];

/// Those that are no text.
const BINARY_ENDINGS: [&str; 5] = ["las", "laz", "e57", "ply", "pcd"];

/// Bytes that show whether a text is a table.
const OTHER_BYTES: u64 = 4 << 10;

/// Extensions with which lines of numbers count as a scan. `txt` is not among them: name such files, or use a glob.
const TEXT_ENDINGS: [&str; 7] = ["xyz", "asc", "csv", "xyzi", "xyzrgb", "pts", "ptx"];

pub(super) fn kind_by_ending(path: &Path) -> Kind {
    // macOS leaves `._tile.laz` beside `tile.laz` on foreign disks: metadata of the Finder, no points.
    if path.file_name().and_then(OsStr::to_str).is_some_and(|name| name.starts_with("._")) {
        return Kind::NoScan;
    }
    if ends_with(path, &SCAN_ENDINGS) { Kind::Scan } else { Kind::NoScan }
}

fn ends_with(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
    ending.is_some_and(|e| endings.contains(&e.as_str()))
}
