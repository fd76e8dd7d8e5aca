//! The one place of this crate with `unsafe`: a file as a slice, without reading it.
#![allow(unsafe_code)]

use std::path::Path;

use memmap2::Mmap;

use crate::ReadError;
use crate::bytes::open_file;

use super::Batches;
use super::read::file_at;

/// A file that is mapped into memory, read-only.
#[derive(Debug)]
pub struct MappedFile(Mmap);

impl AsRef<[u8]> for MappedFile {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl Batches<MappedFile> {
    /// Maps the file `path`, or `points.qbatch` in the folder `path`: nothing is read but the header, the batch records and the description, the rest comes as it is used.
    ///
    /// A file that another program **cuts short** while it is mapped ends this one with a signal (SIGBUS) when a lost
    /// page is touched, as for every mapped file: write datasets beside their final name and rename them, as pointmill
    /// does. Where that cannot be relied upon, use [`Batches::open`].
    ///
    /// # Errors
    /// The file cannot be opened or mapped, or those of [`Batches::from_bytes`].
    pub fn map(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = &file_at(path.as_ref());
        let file = open_file(path).map_err(|e| ReadError::io(path, "opening", e))?;
        // SAFETY: the map is only read, and only as integers and floats, of which every bit pattern is one. What the
        // type system cannot exclude is another process that changes the file meanwhile; lengths and offsets were
        // checked at the start and are kept outside the map, so that changed bytes give wrong points, not wrong
        // addresses. A file cut short is the signal described above.
        let map = unsafe { Mmap::map(&file) }.map_err(|e| ReadError::io(path, "mapping", e))?;
        Self::from_bytes(MappedFile(map), path)
    }
}
