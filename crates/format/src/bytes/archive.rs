//! Files in a ZIP archive.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use rawzip::{CompressionMethod, FileReader, RECOMMENDED_BUFFER_SIZE, ReaderAt, ZipArchive, ZipArchiveEntryWayfinder};

use super::{ByteSource, open_file};

/// A dataset in an uncompressed ZIP archive, read in place: a way to copy millions of small files
/// as one. Threads share it without a lock.
///
/// Names are those in the archive, without the folder that all of them are in, if there is one. Memory: about 150 bytes a file.
pub struct Archive {
    path: PathBuf,
    archive: ZipArchive<FileReader>,
    entries: HashMap<Box<str>, Entry>,
}

/// A file in the archive.
#[derive(Clone, Copy)]
struct Entry {
    place: ZipArchiveEntryWayfinder,
    bytes: u64,
    is_stored: bool,
}

impl Archive {
    /// Reads the directory of the archive `path`. `marker`: a file of the dataset; the folder that it is in becomes that of
    /// all names.
    ///
    /// # Errors
    /// Those of the operating system; `InvalidData` for what is no archive, or a damaged one; `NotFound` if no file in it is
    /// called `marker`.
    pub fn open(path: impl Into<PathBuf>, marker: &str) -> io::Result<Self> {
        let path = path.into();
        let mut buffer = vec![0; RECOMMENDED_BUFFER_SIZE];
        let archive = ZipArchive::from_file(open_file(&path)?, &mut buffer).map_err(reason)?;
        let mut entries = HashMap::new();
        let mut listed = archive.entries(&mut buffer);
        while let Some(entry) = listed.next_entry().map_err(reason)? {
            let name = entry.file_path();
            let Ok(name) = std::str::from_utf8(name.as_ref()) else { continue };
            if !entry.is_dir() {
                let is_stored = entry.compression_method() == CompressionMethod::STORE;
                let (place, bytes) = (entry.wayfinder(), entry.uncompressed_size_hint());
                entries.try_reserve(1).map_err(|_| io::ErrorKind::OutOfMemory)?;
                entries.insert(Box::from(name), Entry { place, bytes, is_stored });
            }
        }
        let entries = without_folder(entries, marker).ok_or(io::ErrorKind::NotFound)?;
        Ok(Self { path, archive, entries })
    }

    /// True if the file begins like an archive.
    #[must_use]
    pub fn is_one(path: &Path) -> bool {
        let mut start = [0; 4];
        let read = open_file(path).and_then(|file| super::read_exact_at(&file, &mut start, 0));
        read.is_ok() && &start == b"PK\x03\x04"
    }

    /// Names and bytes of all files, in any order.
    pub fn files(&self) -> impl Iterator<Item = (&str, u64)> + '_ {
        self.entries.iter().map(|(name, entry)| (&**name, entry.bytes))
    }

    fn entry(&self, file: &str) -> io::Result<Entry> {
        let entry = *self.entries.get(file).ok_or(io::ErrorKind::NotFound)?;
        if entry.is_stored {
            return Ok(entry);
        }
        Err(io::Error::new(
            io::ErrorKind::Unsupported,
            "it is compressed in the archive; unpack the archive, or store it",
        ))
    }
}

/// Names without the folder in which the file `marker` is, the one with the shortest name of several.
fn without_folder(mut entries: HashMap<Box<str>, Entry>, marker: &str) -> Option<HashMap<Box<str>, Entry>> {
    let markers = entries.keys().filter_map(|name| name.strip_suffix(marker));
    let folder = markers.filter(|folder| folder.is_empty() || folder.ends_with('/'));
    let folder = folder.min_by_key(|folder| (folder.len(), *folder))?.to_owned();
    if folder.is_empty() {
        return Some(entries);
    }
    let inside = entries.drain().filter_map(|(name, entry)| Some((Box::from(name.strip_prefix(&folder)?), entry)));
    Some(inside.collect())
}

/// An error of the archive as one of reading.
fn reason(error: rawzip::Error) -> io::Error {
    match error.into_kind() {
        rawzip::ErrorKind::IO(error) => error,
        kind => io::Error::new(io::ErrorKind::InvalidData, format!("not a ZIP archive, or a damaged one: {kind}")),
    }
}

impl ByteSource for Archive {
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        let entry = self.entry(file)?;
        let end = offset.checked_add(buf.len() as u64);
        if end.is_none_or(|end| end > entry.bytes) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let (start, _) = self.archive.get_entry(entry.place).map_err(reason)?.compressed_data_range();
        let at = start.checked_add(offset).ok_or(io::ErrorKind::UnexpectedEof)?;
        self.archive.get_ref().read_exact_at(buf, at)
    }

    fn size(&self, file: &str) -> io::Result<u64> {
        self.entry(file).map(|entry| entry.bytes)
    }

    fn locate(&self, file: &str) -> PathBuf {
        self.path.join(file)
    }
}

impl std::fmt::Debug for Archive {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Archive").field("at", &self.path).field("files", &self.entries.len()).finish_non_exhaustive()
    }
}
