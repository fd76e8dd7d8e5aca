//! Where the bytes of a dataset come from.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::{INDEX_FILE, PACKED_FILE};
use crate::bytes::read_exact_at;

/// Anything that can tell ranges of a dataset's files: a folder, memory, a web server, an archive.
///
/// Files are named as in the dataset's folder: `index.json`, `leaves.bin`, `n0110.bin`. Calls may come from several
/// threads at once.
pub trait ByteSource: Send + Sync {
    /// Fills `buf` with the bytes of `file` from `offset` on.
    ///
    /// # Errors
    /// Fails if it cannot fill all of `buf` (`UnexpectedEof` past the end of the file).
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()>;

    /// Bytes of `file`.
    ///
    /// # Errors
    /// Fails if the file is not there.
    fn size(&self, file: &str) -> io::Result<u64>;

    /// What to call `file` in messages: a path or a URL.
    fn locate(&self, file: &str) -> PathBuf;
}

/// A dataset in a folder, read with positioned reads. `leaves.bin` stays open once it was asked for; the file of a leaf
/// is open while it is read.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    packed: OnceLock<File>,
}

impl Folder {
    /// The dataset in the folder `path`, or beside the `index.json` that is named.
    pub fn new(path: &Path) -> Self {
        let named_index = path.file_name().is_some_and(|n| n == INDEX_FILE);
        let folder = if named_index { path.parent().unwrap_or(path) } else { path };
        Self { path: folder.to_path_buf(), packed: OnceLock::new() }
    }

    fn with_file<T>(&self, name: &str, read: impl FnOnce(&File) -> io::Result<T>) -> io::Result<T> {
        if name != PACKED_FILE {
            return read(&open_own(&self.path, name)?);
        }
        let file = match self.packed.get() {
            Some(file) => file,
            None => {
                let file = open_own(&self.path, name)?;
                self.packed.get_or_init(|| file)
            }
        };
        read(file)
    }
}

/// Opens a file of the format; a name with a path in it is never one.
fn open_own(folder: &Path, name: &str) -> io::Result<File> {
    let path = name.strip_prefix('n').and_then(|n| n.strip_suffix(".bin"));
    let is_leaf = path.is_some_and(|p| p.bytes().all(|b| matches!(b, b'0' | b'1')));
    if !is_leaf && name != INDEX_FILE && name != PACKED_FILE {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "this is no file of a binary tree"));
    }
    File::open(folder.join(name))
}

impl ByteSource for Folder {
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        self.with_file(file, |f| read_exact_at(f, buf, offset))
    }

    fn size(&self, file: &str) -> io::Result<u64> {
        self.with_file(file, |f| Ok(f.metadata()?.len()))
    }

    fn locate(&self, file: &str) -> PathBuf {
        self.path.join(file)
    }
}

/// A dataset in memory: the bytes of every file by its name.
pub type Memory = BTreeMap<String, Vec<u8>>;

impl ByteSource for Memory {
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        let start = usize::try_from(offset).ok();
        let range = start.and_then(|start| Some(start..start.checked_add(buf.len())?));
        let bytes = self.get(file).ok_or(io::ErrorKind::NotFound)?;
        buf.copy_from_slice(range.and_then(|range| bytes.get(range)).ok_or(io::ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn size(&self, file: &str) -> io::Result<u64> {
        Ok(self.get(file).ok_or(io::ErrorKind::NotFound)?.len() as u64)
    }

    fn locate(&self, file: &str) -> PathBuf {
        Path::new("memory").join(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_reads_ranges_of_its_own_files_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        for file in [INDEX_FILE, PACKED_FILE, "n01.bin", "other.bin"] {
            std::fs::write(folder.path().join(file), file).unwrap();
        }
        let source = Folder::new(&folder.path().join(INDEX_FILE));
        let mut buf = [0; 3];
        for (file, expected) in [(INDEX_FILE, b"dex"), (PACKED_FILE, b"ave"), ("n01.bin", b"1.b")] {
            source.read_at(file, 2, &mut buf).unwrap();
            assert_eq!((&buf, source.size(file).unwrap()), (expected, file.len() as u64));
        }
        assert_eq!(source.read_at("n01.bin", 5, &mut buf).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
        assert_eq!(source.size("n1.bin").unwrap_err().kind(), io::ErrorKind::NotFound);
        for foreign in ["other.bin", "../n01.bin", "n../x.bin", "/etc/hostname", "n", ""] {
            assert_eq!(source.size(foreign).unwrap_err().kind(), io::ErrorKind::InvalidInput, "{foreign}");
        }
    }

    #[test]
    fn memory_refuses_ranges_that_overflow() {
        let source = Memory::from([("n.bin".to_owned(), vec![1, 2, 3])]);
        let mut buf = [0; 2];
        source.read_at("n.bin", 1, &mut buf).unwrap();
        assert_eq!(buf, [2, 3]);
        for offset in [2, u64::MAX, u64::MAX - 1] {
            assert!(source.read_at("n.bin", offset, &mut buf).is_err());
        }
    }
}
