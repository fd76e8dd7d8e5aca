//! A dataset on its way into the output.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use crate::error::ConvertError;
use crate::job::{KeptFile, PROBE};
use crate::runtime::disk::{create_folder, link, sync_file_system, sync_folder, sync_path};
use crate::runtime::os_files::{is_only_name, is_same_file};
use crate::runtime::{Disk, DiskFile, Runtime, Sequential};

/// Bytes of JSON that are written at once.
const JSON_BUFFER: usize = 64 << 10;

/// More files are not synced one by one: the file system is asked to sync all it has. That takes a tenth of the time, but
/// it waits for what others write, too, and cannot be interrupted.
const FEW_FILES: usize = 50_000;

/// A dataset on its way into a [`super::StagedFolder`].
pub(crate) struct StagedDataset {
    pub(super) folder: PathBuf,
    /// What errors name: where it is to be.
    pub(super) shown: PathBuf,
    pub(super) name: &'static str,
    pub(super) disk: Arc<dyn Disk>,
    /// How the names begin that a job gives to files of the dataset, so that they outlive the run.
    pub(super) kept_as: Option<PathBuf>,
}

/// A file of a dataset while it is written.
pub(crate) struct OutputFile {
    pub(crate) file: DiskFile,
    /// A job has it, too.
    is_kept: bool,
}

impl OutputFile {
    /// One that no job has.
    pub(crate) fn new(file: DiskFile) -> Self {
        Self { file, is_kept: false }
    }

    /// The file as a job has it, if that is so; offsets count from `start`.
    pub(crate) fn kept(&self, start: u64) -> Option<KeptFile<'_>> {
        self.is_kept.then_some(KeptFile { file: &self.file, start })
    }
}

impl StagedDataset {
    /// The name of its folder below the output, or nothing.
    pub(crate) fn name(&self) -> &'static str {
        self.name
    }

    /// Makes a file; whoever writes it syncs it.
    pub(crate) fn create(&self, name: &str) -> Result<DiskFile, ConvertError> {
        DiskFile::create(&self.folder.join(name), self.shown.join(name), &self.disk)
    }

    /// The same for a file whose bytes a job keeps: one that a run before has left, as it is, or a new one. Whoever writes it cuts
    /// it in the end.
    ///
    /// The job has the file under a second name. A file with more names than this one is part of an output that is complete,
    /// or of a hidden folder that could not be removed: it is left alone.
    pub(crate) fn create_kept(&self, name: &str) -> Result<OutputFile, ConvertError> {
        let Some(kept) = self.second_name(name) else { return self.create(name).map(OutputFile::new) };
        let path = self.folder.join(name);
        if File::open(&path).is_ok_and(|file| is_same_file(&file, &kept)) {
            return Ok(OutputFile { file: self.open(name)?, is_kept: true });
        }
        let file = self.create(name)?;
        if file.metadata().is_ok_and(|new| is_only_name(&kept, &new)) {
            if let Ok(file) = self.take_over(&kept, name, &file) {
                return Ok(OutputFile { file, is_kept: true });
            }
            drop(file);
            let _ = fs::remove_file(&path); // it may be that of the job
            let _ = fs::remove_file(&kept); // what stays is not written to
            let file = self.create(name)?;
            let is_kept = link(&*self.disk, &path, &kept).is_ok();
            return Ok(OutputFile { file, is_kept });
        }
        let _ = fs::remove_file(&kept);
        let is_kept = link(&*self.disk, &path, &kept).is_ok();
        Ok(OutputFile { file, is_kept })
    }

    /// Gives the file of a job the name of one that was just made, and the mode of that: it is part of an output like any other.
    fn take_over(&self, kept: &Path, name: &str, new: &DiskFile) -> Result<DiskFile, ConvertError> {
        let path = self.folder.join(name);
        let renamed = || {
            let mode = new.metadata()?.permissions();
            fs::remove_file(&path)?;
            link(&*self.disk, kept, &path)?;
            fs::set_permissions(&path, mode)
        };
        renamed().map_err(|e| ConvertError::io(self.shown.join(name), "going on with the file", e))?;
        self.open(name)
    }

    /// A file that was just made and is to hold most of the output: its bytes go past the cache of the system.
    pub(crate) fn past_cache(&self, name: &str, OutputFile { file, is_kept }: OutputFile) -> OutputFile {
        OutputFile { file: file.past_cache(&self.folder.join(name)), is_kept }
    }

    /// True if [`Self::create_kept`] makes files that a job has, too: not if it is on another file system, or on one without
    /// second names.
    pub(crate) fn can_keep(&self) -> bool {
        let (name, path) = (PROBE, self.folder.join(PROBE));
        let Some(second) = self.second_name(name) else { return false };
        let is_kept = self.create_kept(name).is_ok_and(|probe| probe.is_kept);
        is_kept & fs::remove_file(path).is_ok() & fs::remove_file(second).is_ok()
    }

    fn second_name(&self, name: &str) -> Option<PathBuf> {
        let mut second = self.kept_as.as_ref().filter(|_| cfg!(unix))?.clone().into_os_string();
        second.push(name);
        Some(second.into())
    }

    /// Opens a file that was made before, to write more.
    pub(crate) fn open(&self, name: &str) -> Result<DiskFile, ConvertError> {
        DiskFile::open(&self.folder.join(name), self.shown.join(name), &self.disk)
    }

    /// Writes and syncs a small file.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<(), ConvertError> {
        let file = self.create(name)?;
        file.write_at(bytes, 0, "writing the file")?;
        file.sync("writing the file")
    }

    /// Writes and syncs an object, however large, as indented JSON.
    pub(super) fn write_json(&self, name: &str, object: &impl Serialize) -> Result<(), ConvertError> {
        let doing = "writing the file";
        let file = self.create(name)?;
        let mut writer = BufWriter::with_capacity(JSON_BUFFER, Sequential::new(&file));
        let written = serde_json::to_writer_pretty(&mut writer, object).map_err(io::Error::from);
        written.and_then(|()| writer.flush()).map_err(|e| file.failed(doing, e))?;
        file.sync(doing)
    }

    /// Makes a folder in one that is there; whoever makes it syncs it ([`Self::sync_all`]).
    pub(crate) fn create_folder(&self, name: &str) -> Result<(), ConvertError> {
        create_folder(&*self.disk, &self.folder.join(name))
            .map_err(|e| ConvertError::io(self.shown.join(name), "making the folder", e))
    }

    /// Syncs files `0..count`, which were made before and are closed, and the names in `folders`.
    pub(crate) fn sync_all(
        &self,
        rt: &Runtime<'_>,
        count: usize,
        name: impl Fn(usize) -> String + Sync,
        folders: &[String],
    ) -> Result<(), ConvertError> {
        if count > FEW_FILES && self.sync_file_system()? {
            return Ok(());
        }
        let sync = |(): &mut (), file: usize| self.sync_file(&name(file));
        rt.in_parallel(count, || (), sync, |()| ())?;
        folders.iter().try_for_each(|folder| self.sync_folder(folder))
    }

    /// Syncs everything that the file system of the dataset has; false where the system cannot.
    fn sync_file_system(&self) -> Result<bool, ConvertError> {
        sync_file_system(&*self.disk, &self.folder).map_err(|e| ConvertError::io(&self.shown, "syncing the files", e))
    }

    fn sync_file(&self, name: &str) -> Result<(), ConvertError> {
        let path = self.folder.join(name);
        sync_path(&*self.disk, &path).map_err(|e| ConvertError::io(self.shown.join(name), "syncing the file", e))
    }

    fn sync_folder(&self, name: &str) -> Result<(), ConvertError> {
        let path = self.folder.join(name);
        sync_folder(&*self.disk, &path).map_err(|e| ConvertError::io(self.shown.join(name), "syncing the folder", e))
    }

    /// Syncs the names of the files.
    pub(crate) fn sync(&self) -> Result<(), ConvertError> {
        sync_folder(&*self.disk, &self.folder).map_err(|e| ConvertError::io(&self.shown, "syncing the output", e))
    }
}
