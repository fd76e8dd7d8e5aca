//! Where the bytes of a dataset come from.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use crate::bytes::read_exact_at;

/// The three files of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DatasetFile {
    /// `metadata.json`
    Metadata,
    /// `hierarchy.bin`
    Hierarchy,
    /// `octree.bin`
    Octree,
}

impl DatasetFile {
    /// The three, in the order above.
    pub const ALL: [Self; 3] = [Self::Metadata, Self::Hierarchy, Self::Octree];

    /// The name of the file in its folder.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Metadata => "metadata.json",
            Self::Hierarchy => "hierarchy.bin",
            Self::Octree => "octree.bin",
        }
    }
}

/// Anything that can tell ranges of the three files: a folder, memory, a web server, an archive.
///
/// Calls may come from several threads at once. A source over HTTP, with whatever client the program has:
///
/// ```
/// use pointmill_format::potree2::{ByteSource, DatasetFile};
/// use std::{io, path::PathBuf};
/// # struct Response { status: u16, content_range: Option<String>, body: Vec<u8> }
/// # struct Client;
/// # impl Client { fn get(&self, _: &str, _: &str) -> io::Result<Response> { unimplemented!() } }
///
/// struct Http { client: Client, base: String }
///
/// impl ByteSource for Http {
///     fn read_at(&self, file: DatasetFile, offset: u64, buf: &mut [u8]) -> io::Result<()> {
///         let Some(last) = (buf.len() as u64).checked_sub(1) else { return Ok(()) };
///         let url = format!("{}/{}", self.base, file.name());
///         let response = self.client.get(&url, &format!("bytes={offset}-{}", offset + last))?;
///         // A server without range support answers 200 with the whole file: wrong bytes, so refuse.
///         if response.status != 206 || response.body.len() != buf.len() {
///             return Err(io::Error::other(format!("{url}: the server does not serve byte ranges")));
///         }
///         buf.copy_from_slice(&response.body);
///         Ok(())
///     }
///     fn size(&self, file: DatasetFile) -> io::Result<u64> {
///         let response = self.client.get(&self.locate(file).to_string_lossy(), "bytes=0-0")?;
///         let total = response.content_range.as_deref().and_then(|r| r.rsplit('/').next()?.parse().ok());
///         total.ok_or_else(|| io::Error::other("the server does not tell the size of the file"))
///     }
///     fn locate(&self, file: DatasetFile) -> PathBuf {
///         format!("{}/{}", self.base, file.name()).into()
///     }
/// }
/// ```
pub trait ByteSource: Send + Sync {
    /// Fills `buf` with the bytes of `file` from `offset` on.
    ///
    /// # Errors
    /// Fails if it cannot fill all of `buf` (`UnexpectedEof` past the end of the file).
    fn read_at(&self, file: DatasetFile, offset: u64, buf: &mut [u8]) -> io::Result<()>;

    /// Bytes of `file`. [`crate::potree2::Dataset`] asks once, when it is opened.
    ///
    /// # Errors
    /// Fails if the file is not there.
    fn size(&self, file: DatasetFile) -> io::Result<u64>;

    /// What to call `file` in messages: a path or a URL.
    fn locate(&self, file: DatasetFile) -> PathBuf;
}

/// A dataset in a folder, read with positioned reads: threads share it without a lock.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// By the order of [`DatasetFile`].
    files: [File; 3],
}

impl Folder {
    /// Opens the three files in `path`.
    ///
    /// # Errors
    /// The file that cannot be opened, and why.
    pub fn open(path: &Path) -> Result<Self, crate::ReadError> {
        let open = |file: DatasetFile| {
            let at = path.join(file.name());
            File::open(&at).map_err(|e| {
                crate::ReadError::io(at, "opening", e)
                    .advise("a Potree 2.0 dataset is a folder with metadata.json, hierarchy.bin and octree.bin")
            })
        };
        let [metadata, hierarchy, octree] = DatasetFile::ALL;
        Ok(Self { path: path.to_path_buf(), files: [open(metadata)?, open(hierarchy)?, open(octree)?] })
    }
}

impl ByteSource for Folder {
    fn read_at(&self, file: DatasetFile, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        read_exact_at(&self.files[file as usize], buf, offset)
    }

    fn size(&self, file: DatasetFile) -> io::Result<u64> {
        self.files[file as usize].metadata().map(|m| m.len())
    }

    fn locate(&self, file: DatasetFile) -> PathBuf {
        self.path.join(file.name())
    }
}

/// A dataset in memory.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Memory {
    /// `metadata.json`
    pub metadata: Vec<u8>,
    /// `hierarchy.bin`
    pub hierarchy: Vec<u8>,
    /// `octree.bin`
    pub octree: Vec<u8>,
}

impl Memory {
    /// The bytes of `file`.
    pub fn bytes(&self, file: DatasetFile) -> &[u8] {
        match file {
            DatasetFile::Metadata => &self.metadata,
            DatasetFile::Hierarchy => &self.hierarchy,
            DatasetFile::Octree => &self.octree,
        }
    }
}

impl ByteSource for Memory {
    fn read_at(&self, file: DatasetFile, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        let start = usize::try_from(offset).ok();
        let range = start.and_then(|start| Some(start..start.checked_add(buf.len())?));
        let bytes = range.and_then(|range| self.bytes(file).get(range)).ok_or(io::ErrorKind::UnexpectedEof)?;
        buf.copy_from_slice(bytes);
        Ok(())
    }

    fn size(&self, file: DatasetFile) -> io::Result<u64> {
        Ok(self.bytes(file).len() as u64)
    }

    fn locate(&self, file: DatasetFile) -> PathBuf {
        Path::new("memory").join(file.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_reads_ranges_and_refuses_to_read_past_the_end() {
        let folder = tempfile::tempdir().unwrap();
        for file in DatasetFile::ALL {
            std::fs::write(folder.path().join(file.name()), file.name()).unwrap();
        }
        let source = Folder::open(folder.path()).unwrap();
        let mut buf = [0; 4];
        source.read_at(DatasetFile::Octree, 2, &mut buf).unwrap();
        assert_eq!(&buf, b"tree");
        assert_eq!(source.size(DatasetFile::Hierarchy).unwrap(), 13);
        let past = source.read_at(DatasetFile::Octree, 7, &mut buf).unwrap_err();
        assert_eq!(past.kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn memory_refuses_ranges_that_overflow() {
        let source = Memory { octree: vec![1, 2, 3], ..Memory::default() };
        let mut buf = [0; 2];
        source.read_at(DatasetFile::Octree, 1, &mut buf).unwrap();
        assert_eq!(buf, [2, 3]);
        for offset in [2, u64::MAX, u64::MAX - 1] {
            assert!(source.read_at(DatasetFile::Octree, offset, &mut buf).is_err());
        }
    }

    #[test]
    fn a_folder_without_a_dataset_is_told_what_one_is() {
        let folder = tempfile::tempdir().unwrap();
        let message = Folder::open(folder.path()).unwrap_err().to_string();
        assert!(message.contains("metadata.json") && message.contains("octree.bin"), "{message}");
    }
}
