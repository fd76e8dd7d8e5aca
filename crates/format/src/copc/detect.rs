//! Whether a file is COPC.

use std::io::Read as _;
use std::path::Path;

use crate::bytes::open_file;

/// Bytes from the start of a file that tell whether it is COPC.
pub const FIRST_BYTES: usize = 395;

/// User id and number of the record at byte 375.
const USER_ID: usize = 377;
const RECORD_ID: usize = 393;

/// True if the first bytes of a file, [`FIRST_BYTES`] or more, say that it is COPC: LAS, and its first record is the COPC info.
#[must_use]
pub fn is_copc(first_bytes: &[u8]) -> bool {
    let id = first_bytes.get(RECORD_ID..FIRST_BYTES);
    first_bytes.starts_with(b"LASF")
        && first_bytes[USER_ID.min(first_bytes.len())..].starts_with(b"copc\0")
        && id == Some(&[1, 0])
}

/// [`is_copc`] of a file; false for what cannot be read.
#[must_use]
pub fn detect(path: impl AsRef<Path>) -> bool {
    let mut start = Vec::new();
    let read = open_file(path).and_then(|file| file.take(FIRST_BYTES as u64).read_to_end(&mut start));
    read.is_ok() && is_copc(&start)
}
