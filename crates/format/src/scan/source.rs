//! Positioned reads: any number of threads read one open file without sharing a cursor.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use crate::bytes::{ByteSource, read_exact_at};
use crate::{Advice, Fault, ReadError};

/// An open file of known length.
#[derive(Debug)]
pub(crate) struct Source {
    bytes: Bytes,
    path: PathBuf,
    len: u64,
}

/// Where the bytes are.
enum Bytes {
    File(File),
    /// The file of that name, wherever it is.
    #[cfg_attr(not(feature = "las"), allow(dead_code))]
    Elsewhere(Box<dyn ByteSource>, String),
}

impl Bytes {
    fn read_at(&self, buf: &mut [u8], offset: u64) -> io::Result<()> {
        match self {
            Self::File(file) => read_exact_at(file, buf, offset),
            Self::Elsewhere(source, file) => source.read_at(file, offset, buf),
        }
    }
}

impl std::fmt::Debug for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(file) => file.fmt(f),
            Self::Elsewhere(source, file) => source.locate(file).fmt(f),
        }
    }
}

impl Source {
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        let io = |e| ReadError::io(path, "opening", e);
        // to open a pipe would wait for somebody who writes to it
        let kind = std::fs::metadata(path).map_err(io)?.file_type();
        if kind.is_dir() {
            return Err(ReadError::unsupported(path, "this is a folder, not a file"));
        }
        if !kind.is_file() {
            return Err(ReadError::unsupported(path, "this is a pipe or a device, not a file")
                .advise("copy what comes from it to a file"));
        }
        let file = File::open(path).map_err(io)?;
        let meta = file.metadata().map_err(io)?;
        Ok(Self { bytes: Bytes::File(file), path: path.to_path_buf(), len: meta.len() })
    }

    /// The file `file` of any source.
    #[cfg(feature = "las")]
    pub(crate) fn elsewhere(source: impl ByteSource + 'static, file: &str) -> Result<Self, ReadError> {
        let path = source.locate(file);
        let len = source.size(file).map_err(|e| ReadError::io(&path, "opening", e))?;
        Ok(Self { bytes: Bytes::Elsewhere(Box::new(source), file.to_owned()), path, len })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of the file when it was opened.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// Fills `buf` from `offset`.
    pub(crate) fn read_at(&self, offset: u64, buf: &mut [u8]) -> Result<(), ReadError> {
        self.bytes.read_at(buf, offset).map_err(|e| match e.kind() {
            io::ErrorKind::UnexpectedEof => self.cut_short(offset, buf.len() as u64).advise(Advice::CutShort),
            _ => ReadError::io(&self.path, "reading", e),
        })
    }

    fn cut_short(&self, offset: u64, needed: u64) -> ReadError {
        let available = self.len.saturating_sub(offset);
        ReadError::broken(&self.path, offset, Fault::CutShort { needed, available })
    }

    /// `N` bytes from `offset`.
    #[cfg(any(feature = "e57", feature = "las", feature = "pcd"))]
    pub(crate) fn array_at<const N: usize>(&self, offset: u64) -> Result<[u8; N], ReadError> {
        let mut buf = [0; N];
        self.read_at(offset, &mut buf)?;
        Ok(buf)
    }

    /// `len` bytes from `offset`, at most what the file holds from there: the allocation never exceeds the file.
    #[cfg(any(feature = "las", feature = "pcd", feature = "ply", feature = "text"))]
    pub(crate) fn vec_at(&self, offset: u64, len: u64) -> Result<Vec<u8>, ReadError> {
        let len = len.min(self.len.saturating_sub(offset));
        let mut buf = vec![0; usize::try_from(len).unwrap_or(0)];
        self.read_at(offset, &mut buf)?;
        Ok(buf)
    }

    /// `len` bytes from `offset` into the front of `buf`, which grows but never shrinks (so that it is zeroed once).
    pub(crate) fn slice_at<'a>(&self, offset: u64, len: u64, buf: &'a mut Vec<u8>) -> Result<&'a [u8], ReadError> {
        let end = offset.checked_add(len).filter(|end| *end <= self.len);
        let Some(len) = end.and_then(|_| usize::try_from(len).ok()) else {
            return Err(self.cut_short(offset, len).advise(Advice::CutShort));
        };
        if buf.len() < len {
            buf.reserve_exact(len - buf.len());
            buf.resize(len, 0);
        }
        let out = &mut buf[..len];
        self.read_at(offset, out)?;
        Ok(out)
    }
}
