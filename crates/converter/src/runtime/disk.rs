//! Files of a run: what makes, writes, syncs and renames the files of datasets and temporary files passes through here, so
//! that a test can make any of it fail. Undoing what failed does not.

use std::fmt::Debug;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill_format::bytes;

use super::direct::DirectWriter;
use super::{os_files, os_hints};
use crate::error::ConvertError;

/// Something that is about to be done to the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DiskOperation {
    /// Make a file or a folder.
    Create,
    /// Write bytes into a file, or cut it.
    Write,
    /// Wait until a file or a folder is safe.
    Sync,
    /// Give a file or a folder another name.
    Rename,
}

/// The disk that a run writes to. [`SystemDisk`] permits everything; a test's disk fails when it likes.
pub trait Disk: Debug + Send + Sync {
    /// Called before each operation, from any thread; an error takes the place of the operation.
    ///
    /// # Errors
    /// What the operation fails with.
    fn permit(&self, operation: DiskOperation) -> io::Result<()>;

    /// The best way in which an output can be replaced; what the file system cannot do is not done, whatever this says.
    fn replacing(&self) -> Replacing {
        Replacing::AtOnce
    }
}

/// How a folder takes the place of another, from the best way to the worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Replacing {
    /// The names change places.
    AtOnce,
    /// The old folder is moved aside, then the new one to its place.
    InTwoSteps,
    /// What is in the folder is moved, as in a mounted folder, which cannot be.
    EntryByEntry,
}

/// The file system as it is.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemDisk;

impl Disk for SystemDisk {
    fn permit(&self, _: DiskOperation) -> io::Result<()> {
        Ok(())
    }
}

/// A file that is open for writing and reading at positions, from any thread; errors name it.
#[derive(Debug)]
pub(crate) struct DiskFile {
    file: File,
    path: PathBuf,
    disk: Arc<dyn Disk>,
    /// Counts what is written, if it is a temporary file.
    written: Option<Arc<AtomicU64>>,
    /// Of a large file of an output.
    direct: Option<DirectWriter>,
}

impl DiskFile {
    /// Makes the file `path`; errors name `shown`.
    pub(crate) fn create(path: &Path, shown: PathBuf, disk: &Arc<dyn Disk>) -> Result<Self, ConvertError> {
        let create = || {
            disk.permit(DiskOperation::Create)?;
            File::options().read(true).write(true).create(true).truncate(true).open(path)
        };
        let file = create().map_err(|e| ConvertError::io(&shown, "making the file", e))?;
        Ok(Self { file, path: shown, disk: Arc::clone(disk), written: None, direct: None })
    }

    /// Opens the file `path`, which is there; errors name `shown`.
    pub(crate) fn open(path: &Path, shown: PathBuf, disk: &Arc<dyn Disk>) -> Result<Self, ConvertError> {
        let file = File::options().read(true).write(true).open(path);
        let file = file.map_err(|e| ConvertError::io(&shown, "opening the file again", e))?;
        Ok(Self { file, path: shown, disk: Arc::clone(disk), written: None, direct: None })
    }

    /// What is written at once in large parts goes past the cache of the system, if that has such a way. `path` leads to the file.
    pub(crate) fn past_cache(mut self, path: &Path) -> Self {
        self.direct = DirectWriter::open(&self.file, path);
        self
    }

    /// Writes all of `bytes` at `offset`; `doing` is for the error ("writing a leaf").
    pub(crate) fn write_at(&self, bytes: &[u8], offset: u64, doing: &'static str) -> Result<(), ConvertError> {
        self.try_write_at(bytes, offset).map_err(|e| self.failed(doing, e))
    }

    fn try_write_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        self.disk.permit(DiskOperation::Write)?;
        if let Some(written) = &self.written {
            written.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        }
        let Some(direct) = &self.direct else { return bytes::write_all_at(&self.file, bytes, offset) };
        let blocks = DirectWriter::blocks(offset, bytes.len()).unwrap_or_default();
        let is_taken = !blocks.is_empty() && direct.write(&bytes[blocks.clone()], offset + blocks.start as u64)?;
        let ends = if is_taken { [0..blocks.start, blocks.end..bytes.len()] } else { [0..0, 0..bytes.len()] };
        for end in ends.into_iter().filter(|end| !end.is_empty()) {
            let at = offset + end.start as u64;
            direct.wait_for(&(at..offset + end.end as u64))?;
            bytes::write_all_at(&self.file, &bytes[end], at)?;
        }
        Ok(())
    }

    /// Waits for all that is on its way to the file.
    fn settle(&self) -> io::Result<()> {
        self.direct.as_ref().map_or(Ok(()), DirectWriter::wait)
    }

    /// Fills `buf` from `offset`.
    pub(crate) fn read_at(&self, buf: &mut [u8], offset: u64, doing: &'static str) -> Result<(), ConvertError> {
        let range = offset..offset.saturating_add(buf.len() as u64);
        let read = self.direct.as_ref().map_or(Ok(()), |direct| direct.wait_for(&range));
        read.and_then(|()| bytes::read_exact_at(&self.file, buf, offset)).map_err(|e| self.failed(doing, e))
    }

    /// What the file system says of it.
    pub(crate) fn metadata(&self) -> io::Result<fs::Metadata> {
        self.settle()?;
        self.file.metadata()
    }

    /// What errors call it.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of the file.
    pub(crate) fn len(&self, doing: &'static str) -> Result<u64, ConvertError> {
        self.metadata().map(|meta| meta.len()).map_err(|e| self.failed(doing, e))
    }

    /// Cuts or extends the file.
    pub(crate) fn set_len(&self, bytes: u64, doing: &'static str) -> Result<(), ConvertError> {
        let cut = || {
            self.disk.permit(DiskOperation::Write)?;
            self.settle()?;
            self.file.set_len(bytes)
        };
        cut().map_err(|e| self.failed(doing, e))
    }

    /// Waits until the file is safe.
    pub(crate) fn sync(&self, doing: &'static str) -> Result<(), ConvertError> {
        let sync = || {
            self.disk.permit(DiskOperation::Sync)?;
            self.settle()?;
            self.file.sync_all()
        };
        sync().map_err(|e| self.failed(doing, e))
    }

    /// The error of a writer on top of this file.
    pub(crate) fn failed(&self, doing: &'static str, error: io::Error) -> ConvertError {
        let error = ConvertError::io(&self.path, doing, error);
        if self.written.is_some() { error.temporary() } else { error }
    }

    /// Asks the system to begin writing a range to the disk, without waiting.
    pub(crate) fn start_write_back(&self, offset: u64, len: usize) {
        os_hints::start_write_back(&self.file, offset, len);
    }
}

/// Where temporary files are made.
#[derive(Debug, Clone)]
pub(crate) struct TempFiles {
    folder: PathBuf,
    disk: Arc<dyn Disk>,
    written: Arc<AtomicU64>,
}

impl TempFiles {
    pub(crate) fn new(folder: PathBuf, disk: Arc<dyn Disk>) -> Self {
        Self { folder, disk, written: Arc::default() }
    }

    /// Bytes that were written to all of them.
    pub(crate) fn written_bytes(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// A new file without a name: nothing is left behind however the run ends. Errors name the folder.
    pub(crate) fn make(&self) -> Result<DiskFile, ConvertError> {
        let make = || {
            self.disk.permit(DiskOperation::Create)?;
            tempfile::tempfile_in(&self.folder)
        };
        let file = make().map_err(|e| ConvertError::io(&self.folder, "making a temporary file", e).temporary())?;
        let written = Some(Arc::clone(&self.written));
        Ok(DiskFile { file, path: self.folder.clone(), disk: Arc::clone(&self.disk), written, direct: None })
    }
}

impl TempFiles {
    /// A file with a name that is safe, made or opened as it is: it outlives the run.
    pub(crate) fn keep(&self, path: &Path) -> Result<DiskFile, ConvertError> {
        let open = || {
            self.disk.permit(DiskOperation::Create)?;
            let file = File::options().read(true).write(true).create(true).truncate(false).open(path)?;
            path.parent().map_or(Ok(()), |folder| sync_folder(&*self.disk, folder))?;
            Ok(file)
        };
        let file = open().map_err(|e| ConvertError::io(path, "opening the file for records", e).temporary())?;
        let written = Some(Arc::clone(&self.written));
        Ok(DiskFile { file, path: path.to_path_buf(), disk: Arc::clone(&self.disk), written, direct: None })
    }
}

impl TempFiles {
    /// A file that another process has made, to read.
    pub(crate) fn read(&self, path: &Path) -> Result<DiskFile, ConvertError> {
        let file = File::open(path).map_err(|e| ConvertError::io(path, "opening the file", e))?;
        Ok(DiskFile { file, path: path.to_path_buf(), disk: Arc::clone(&self.disk), written: None, direct: None })
    }
}

/// A [`DiskFile`] written from front to back.
pub(crate) struct Sequential<'a> {
    file: &'a DiskFile,
    at: u64,
}

impl<'a> Sequential<'a> {
    pub(crate) fn new(file: &'a DiskFile) -> Self {
        Self { file, at: 0 }
    }

    /// Bytes written so far.
    pub(crate) fn len(&self) -> u64 {
        self.at
    }
}

impl io::Write for Sequential<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.try_write_at(bytes, self.at)?;
        self.at += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Waits until the names in a folder are safe.
pub(crate) fn sync_folder(disk: &dyn Disk, folder: &Path) -> io::Result<()> {
    disk.permit(DiskOperation::Sync)?;
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

/// Waits until all that is written to the file system of a folder is safe; false where the system has no such request.
pub(crate) fn sync_file_system(disk: &dyn Disk, folder: &Path) -> io::Result<bool> {
    disk.permit(DiskOperation::Sync)?;
    os_hints::sync_file_system(&File::open(folder)?)
}

/// Waits until a file that is closed is safe.
pub(crate) fn sync_path(disk: &dyn Disk, path: &Path) -> io::Result<()> {
    disk.permit(DiskOperation::Sync)?;
    File::open(path)?.sync_all()
}

/// Makes a folder in one that exists.
pub(crate) fn create_folder(disk: &dyn Disk, folder: &Path) -> io::Result<()> {
    disk.permit(DiskOperation::Create)?;
    fs::create_dir(folder)
}

/// Gives a file a second name.
pub(crate) fn link(disk: &dyn Disk, path: &Path, second: &Path) -> io::Result<()> {
    disk.permit(DiskOperation::Create)?;
    fs::hard_link(path, second)
}

/// Gives a folder another name.
pub(crate) fn rename(disk: &dyn Disk, from: &Path, to: &Path) -> io::Result<()> {
    disk.permit(DiskOperation::Rename)?;
    fs::rename(from, to)
}

/// What two paths lead to changes places; false: the file system cannot do that.
pub(crate) fn exchange(disk: &dyn Disk, a: &Path, b: &Path) -> io::Result<bool> {
    disk.permit(DiskOperation::Rename)?;
    os_files::exchange(a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes of all sizes at all places, small ones over large ones and the other way round, read back at once and in the end.
    #[test]
    fn a_file_past_the_cache_has_the_bytes_that_were_written_last() {
        let dir = tempfile::tempdir().unwrap();
        let disk: Arc<dyn Disk> = Arc::new(SystemDisk);
        let path = dir.path().join("file");
        let file = DiskFile::create(&path, path.clone(), &disk).unwrap().past_cache(&path);
        let mut random = pointmill_testkit::Random::new(5);
        let mut expected = vec![0; 6 << 20];
        file.set_len(expected.len() as u64, "").unwrap();
        for round in 0..150u64 {
            let len = if round % 3 == 0 { random.below(3 << 20) } else { random.below(70_000) } as usize;
            let at = random.below((expected.len() - len) as u64) as usize;
            let bytes: Vec<u8> = (0..len as u64).map(|i| (i * 31 + round) as u8).collect();
            expected[at..at + len].copy_from_slice(&bytes);
            file.write_at(&bytes, at as u64, "").unwrap();
            let from = random.below((expected.len() - 100_000) as u64) as usize;
            let mut read = vec![0; 100_000];
            file.read_at(&mut read, from as u64, "").unwrap();
            assert!(read == expected[from..from + 100_000], "round {round}");
        }
        for round in 0..20 {
            expected[..4 << 20].fill(round);
            file.write_at(&expected[..4 << 20], 0, "").unwrap();
            let at = (4 << 20) - 90_000;
            expected[at..at + 9].fill(!round);
            file.write_at(&expected[at..at + 9], at as u64, "").unwrap();
            let mut read = [0; 10];
            file.read_at(&mut read, at as u64, "").unwrap();
            assert!(read == expected[at..at + 10], "a small one over a large one, round {round}");
        }
        assert_eq!(file.len("").unwrap(), expected.len() as u64);
        file.sync("").unwrap();
        assert!(fs::read(&path).unwrap() == expected);
    }
}
