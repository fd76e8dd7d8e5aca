//! Files in a folder and the folders below it.

use std::io;
use std::path::{Component, Path, PathBuf};

use super::{ByteSource, open_file, read_exact_at};

/// A dataset of many small files in folders (`data/r/01234/r01234.bin`): each is open only while it is read.
///
/// Names that lead out of the folder are refused, so that a hostile index reads nothing else; so is what is no file.
#[derive(Debug, Clone)]
pub struct FolderTree {
    path: PathBuf,
}

impl FolderTree {
    /// The dataset in the folder `path`; nothing is opened yet.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    fn inside(&self, file: &str) -> io::Result<PathBuf> {
        let is_name = |part: Component<'_>| matches!(part, Component::Normal(_));
        if file.is_empty() || !Path::new(file).components().all(is_name) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "not the name of a file in a dataset's folder"));
        }
        Ok(self.path.join(file))
    }
}

impl ByteSource for FolderTree {
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        read_exact_at(&open_file(self.inside(file)?)?, buf, offset)
    }

    fn size(&self, file: &str) -> io::Result<u64> {
        let metadata = self.inside(file)?.metadata()?;
        if !metadata.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no file"));
        }
        Ok(metadata.len())
    }

    fn locate(&self, file: &str) -> PathBuf {
        self.path.join(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_below_the_folder_are_read_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("data/r")).unwrap();
        std::fs::write(folder.path().join("data/r/r.bin"), "points").unwrap();
        let source = FolderTree::new(folder.path().join("data"));
        let mut buf = [0; 3];
        source.read_at("r/r.bin", 2, &mut buf).unwrap();
        assert_eq!((&buf, source.size("r/r.bin").unwrap()), (b"int", 6));
        assert_eq!(source.read_at("r/r.bin", 4, &mut buf).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
        assert_eq!(source.size("r/r0.bin").unwrap_err().kind(), io::ErrorKind::NotFound);
        let absolute = folder.path().join("data/r/r.bin");
        for name in ["", "..", "../data/r/r.bin", "r/../r/r.bin", "./r/r.bin", "r", absolute.to_str().unwrap()] {
            assert_eq!(source.size(name).unwrap_err().kind(), io::ErrorKind::InvalidInput, "{name}");
            assert!(source.read_at(name, 0, &mut buf).is_err(), "{name}");
        }
    }
}
