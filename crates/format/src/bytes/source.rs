//! Where the bytes of a dataset come from.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, OnceLock};

use super::{open_file, read_exact_at};

/// Ranges of a dataset's files, wherever they are: in a folder, in memory, on a web server, in an archive.
///
/// Files are named as in the dataset's folder: `metadata.json`, `leaves.bin`, `n0110.bin`. Calls may come from several
/// threads at once. A source over HTTP, with whatever client the program has:
///
/// ```
/// use pointmill_format::bytes::ByteSource;
/// use std::{io, path::PathBuf};
/// # struct Response { status: u16, content_range: Option<String>, body: Vec<u8> }
/// # struct Client;
/// # impl Client { fn get(&self, _: &str, _: &str) -> io::Result<Response> { unimplemented!() } }
///
/// struct Http { client: Client, base: String }
///
/// impl ByteSource for Http {
///     fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
///         let Some(last) = (buf.len() as u64).checked_sub(1) else { return Ok(()) };
///         let url = format!("{}/{file}", self.base);
///         let response = self.client.get(&url, &format!("bytes={offset}-{}", offset + last))?;
///         // A server without range support answers 200 with the whole file: wrong bytes, so refuse.
///         if response.status != 206 || response.body.len() != buf.len() {
///             return Err(io::Error::other(format!("{url}: the server does not serve byte ranges")));
///         }
///         buf.copy_from_slice(&response.body);
///         Ok(())
///     }
///     fn size(&self, file: &str) -> io::Result<u64> {
///         let response = self.client.get(&self.locate(file).to_string_lossy(), "bytes=0-0")?;
///         let total = response.content_range.as_deref().and_then(|r| r.rsplit('/').next()?.parse().ok());
///         total.ok_or_else(|| io::Error::other("the server does not report the size of the file"))
///     }
///     fn locate(&self, file: &str) -> PathBuf {
///         format!("{}/{file}", self.base).into()
///     }
/// }
/// ```
pub trait ByteSource: Send + Sync {
    /// Fills `buf` with the bytes of `file` from `offset` on.
    ///
    /// # Errors
    /// `NotFound` if the file is not there; `UnexpectedEof` if it ends before `buf` is full.
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()>;

    /// Bytes of `file`.
    ///
    /// # Errors
    /// `NotFound` if the file is not there.
    fn size(&self, file: &str) -> io::Result<u64>;

    /// What to call `file` in messages: a path or a URL.
    fn locate(&self, file: &str) -> PathBuf;
}

macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<S: ByteSource + ?Sized> ByteSource for $pointer {
            fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
                (**self).read_at(file, offset, buf)
            }

            fn size(&self, file: &str) -> io::Result<u64> {
                (**self).size(file)
            }

            fn locate(&self, file: &str) -> PathBuf {
                (**self).locate(file)
            }
        }
    )*};
}
forward!(Box<S>, Arc<S>, &S);

/// Files that stay open: more than any dataset has that is read again and again. (A binary tree may have thousands of
/// leaf files; each is read once in a while.)
const KEPT_FILES: usize = 4;

/// A dataset in a folder, read with positioned reads: threads share it without a lock.
///
/// The first four files requested stay open, others are open while they are read. Names with a path in them
/// are refused, so that a hostile index does not lead out of the folder; so is what is no file.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    kept: [OnceLock<(String, File)>; KEPT_FILES],
}

impl Folder {
    /// The dataset in the folder `path`; nothing is opened yet.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), kept: [const { OnceLock::new() }; KEPT_FILES] }
    }

    /// As [`Self::new`], where `path` may also be the file `marker` in the folder.
    pub(crate) fn with_marker(path: &Path, marker: &str) -> Self {
        let named_marker = path.file_name().is_some_and(|name| name == marker);
        Self::new(if named_marker { path.parent().unwrap_or(path) } else { path })
    }

    fn with_file<T>(&self, name: &str, read: impl FnOnce(&File) -> io::Result<T>) -> io::Result<T> {
        let kept = self.kept.iter().map_while(OnceLock::get).find(|(kept, _)| kept == name);
        if let Some((_, file)) = kept {
            return read(file);
        }
        let mut parts = Path::new(name).components();
        if !matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == name) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "not the name of a file in a dataset's folder"));
        }
        let mut opened = (name.to_owned(), open_file(self.path.join(name))?);
        let result = read(&opened.1);
        for place in &self.kept {
            match place.set(opened) {
                Ok(()) => break,
                Err(rejected) => opened = rejected,
            }
        }
        result
    }
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

/// A dataset in memory: the bytes of each file by its name.
///
/// ```
/// use pointmill_format::bytes::{ByteSource, Memory};
///
/// let source = Memory::from([("index.json".to_owned(), b"{}".to_vec())]);
/// assert_eq!(source.size("index.json").unwrap(), 2);
/// assert!(source.size("leaves.bin").is_err());
/// ```
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
    fn a_folder_reads_ranges_of_its_files_and_leads_nowhere_else() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["index.json", "leaves.bin", "n0.bin", "n10.bin", "n110.bin", "n111.bin"];
        for file in files {
            std::fs::write(folder.path().join(file), file).unwrap();
        }
        let source = Folder::with_marker(&folder.path().join("index.json"), "index.json");
        let mut buf = [0; 3];
        for file in files.into_iter().chain(files) {
            source.read_at(file, 2, &mut buf).unwrap();
            assert_eq!((&buf[..], source.size(file).unwrap()), (&file.as_bytes()[2..5], file.len() as u64));
        }
        assert_eq!(source.read_at("n0.bin", 4, &mut buf).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
        assert_eq!(source.size("n1.bin").unwrap_err().kind(), io::ErrorKind::NotFound);
        for foreign in ["../n0.bin", "n../x.bin", "/etc/hostname", "a/", ".", "..", ""] {
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
