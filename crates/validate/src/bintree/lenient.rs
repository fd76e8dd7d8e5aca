//! A folder in which no range of `leaves.bin` is too long.

use std::io;
use std::path::{Path, PathBuf};

use pointmill_format::bintree::PACKED_FILE;
use pointmill_format::bytes::{ByteSource, Folder};

/// The reader opens no tree with a range that leaves `leaves.bin`. Here it is given no end, so that a file
/// that was cut short is a finding about the leaves that lie behind the cut, and the others are looked at.
#[derive(Debug)]
pub(super) struct Lenient(Folder);

impl Lenient {
    pub(super) fn new(folder: &Path) -> Self {
        Self(Folder::new(folder))
    }
}

impl ByteSource for Lenient {
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        self.0.read_at(file, offset, buf)
    }

    fn size(&self, file: &str) -> io::Result<u64> {
        if file == PACKED_FILE { Ok(u64::MAX) } else { self.0.size(file) }
    }

    fn locate(&self, file: &str) -> PathBuf {
        self.0.locate(file)
    }
}
