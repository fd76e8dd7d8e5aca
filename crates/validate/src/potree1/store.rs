//! Where the files of a dataset are: in a folder, or in one archive.

use std::path::{Path, PathBuf};

use pointmill_format::ReadError;
use pointmill_format::bytes::{Archive, ByteSource, FolderTree};
use pointmill_format::potree1::METADATA_FILE;

use crate::memory::Budget;

/// What a file of an archive takes in memory.
const ARCHIVED_BYTES: u64 = 240;

/// The files of a dataset.
pub(crate) enum Store {
    Folder(PathBuf, FolderTree),
    Archive(Archive),
}

impl Store {
    /// Opens the folder or archive at `path`.
    ///
    /// # Errors
    /// An archive that cannot be read, or whose directory does not fit memory.
    pub(crate) fn open(path: &Path, budget: &mut Budget) -> Result<Self, ReadError> {
        if !path.is_file() {
            return Ok(Self::Folder(path.to_path_buf(), FolderTree::new(path)));
        }
        let archive = Archive::open(path, METADATA_FILE).map_err(|e| ReadError::io(path, "opening the archive", e))?;
        budget.take(archive.files().count() as u64 * ARCHIVED_BYTES)?;
        Ok(Self::Archive(archive))
    }

    fn source(&self) -> &dyn ByteSource {
        match self {
            Self::Folder(_, folder) => folder,
            Self::Archive(archive) => archive,
        }
    }

    /// Fills `buf` with bytes of a file.
    pub(crate) fn read_at(
        &self,
        file: &str,
        offset: u64,
        buf: &mut [u8],
        doing: &'static str,
    ) -> Result<(), ReadError> {
        let source = self.source();
        source.read_at(file, offset, buf).map_err(|e| ReadError::io(source.locate(file), doing, e))
    }

    /// Bytes of a file.
    pub(crate) fn size(&self, file: &str) -> Result<u64, ReadError> {
        let source = self.source();
        source.size(file).map_err(|e| ReadError::io(source.locate(file), "opening", e))
    }
}
