//! The file: positioned reads that know its length, and little-endian words.

use std::fs::File;
use std::path::{Path, PathBuf};

use pointmill_format::bytes::{open_file, read_exact_at, try_resize};
use pointmill_format::{Advice, ReadError};

/// An open file of known length; threads share it without a cursor.
#[derive(Debug)]
pub(crate) struct Bytes {
    file: File,
    pub(crate) path: PathBuf,
    /// Bytes of the file when it was opened.
    pub(crate) len: u64,
}

impl Bytes {
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        let io = |e| ReadError::io(path, "opening", e);
        let file = open_file(path).map_err(io)?;
        let len = file.metadata().map_err(io)?.len();
        Ok(Self { file, path: path.to_path_buf(), len })
    }

    /// `len` bytes from `offset` into `out`, which takes that length. What lies beyond the end of the file is not
    /// read, and nothing is allocated for it: callers compare with [`Self::len`] first.
    pub(crate) fn read(&self, offset: u64, len: u64, out: &mut Vec<u8>) -> Result<(), ReadError> {
        let end = offset.checked_add(len).filter(|end| *end <= self.len);
        if end.is_none() {
            let what = format!("{len} bytes expected, the file ends at byte {}", self.len);
            return Err(ReadError::broken(&self.path, offset, what));
        }
        try_resize(out, len).map_err(|_| {
            let what = format!("{len} bytes do not fit memory");
            ReadError::unsupported(&self.path, what).at(offset).advise(Advice::MoreMemory)
        })?;
        read_exact_at(&self.file, out, offset).map_err(|e| ReadError::io(&self.path, "reading", e))
    }
}

/// The u32 at byte `at`; 0 beyond the end.
#[inline]
pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..).and_then(|b| b.first_chunk()).map_or(0, |b| u32::from_le_bytes(*b))
}

/// The u64 at byte `at`; 0 beyond the end.
pub(crate) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    bytes.get(at..).and_then(|b| b.first_chunk()).map_or(0, |b| u64::from_le_bytes(*b))
}

/// Three doubles from byte `at` on.
pub(crate) fn vector_at(bytes: &[u8], at: usize) -> [f64; 3] {
    std::array::from_fn(|axis| f64::from_bits(u64_at(bytes, at + 8 * axis)))
}
