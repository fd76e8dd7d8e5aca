//! A job that several processes share, on one machine or on many: a folder that all of them see, and a file for each unit that
//! is done. There is no lock and no journal: a file gets its name once it is complete, and a unit that two processes do is the
//! same twice.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::identity::Identity;
use super::unit_file::{UnitReader, UnitWriter};
use crate::cloud::{SafeBlock, Store};
use crate::error::{ConvertError, JobFault};
use crate::runtime::disk::{create_folder, sync_folder};
use crate::runtime::{Disk, DiskFile, TempFiles};
use crate::unit_name::{JobUnit, Stage, UnitName};

/// Says for what the job was made.
const IDENTITY: &str = "identity";
/// Units that are done, and the records that they have read or put in order.
const UNITS: &str = "units";
/// Where processes work.
const WORK: &str = "work-";

/// What this process does with the job.
#[derive(Debug)]
pub(crate) enum Task {
    /// Begins it.
    Plan,
    /// Looks which units there are.
    Look,
    /// Does these.
    Run {
        units: HashSet<UnitName>,
        /// Units that others do are waited for, so long without news.
        waits: Option<Duration>,
    },
    /// Puts the results of all units together.
    Finish,
}

/// A job that several processes share.
#[derive(Debug)]
pub(crate) struct SharedJob {
    folder: PathBuf,
    task: Task,
    disk: Arc<dyn Disk>,
    done: Mutex<HashSet<UnitName>>,
    settling: Mutex<Settling>,
}

/// What settling a pass comes to: results by name, some with records that were put in another order.
#[derive(Debug, Default)]
struct Settling {
    pass: u32,
    /// This process does it.
    is_running: bool,
    /// File of the records, in the folder of units; of the process that settles.
    records: Option<String>,
    results: Vec<(String, Vec<u8>)>,
}

impl SharedJob {
    /// Begins a job in a folder that is not there, or empty.
    pub(crate) fn begin(folder: &Path, disk: &Arc<dyn Disk>) -> Result<Self, ConvertError> {
        let fail = |e| ConvertError::io(folder, "making the job folder", e);
        if !folder.exists() {
            create_folder(&**disk, folder).map_err(fail)?;
        } else if fs::read_dir(folder).map_err(fail)?.next().is_some() {
            return Err(JobFault::NotEmpty { folder: folder.to_path_buf() }.into());
        }
        create_folder(&**disk, &folder.join(UNITS)).map_err(fail)?;
        Ok(Self::of(folder, Task::Plan, disk, HashSet::new()))
    }

    /// Opens a job that is there.
    pub(crate) fn open(folder: &Path, task: Task, disk: &Arc<dyn Disk>) -> Result<Self, ConvertError> {
        if !folder.join(IDENTITY).is_file() {
            return Err(JobFault::NotThere { folder: folder.to_path_buf() }.into());
        }
        Ok(Self::of(folder, task, disk, done_in(&folder.join(UNITS))?))
    }

    /// Looks which units others have done meanwhile.
    pub(crate) fn look_again(&self) -> Result<(), ConvertError> {
        let done = done_in(&self.folder.join(UNITS))?;
        self.lock_done().extend(done);
        Ok(())
    }

    fn of(folder: &Path, task: Task, disk: &Arc<dyn Disk>, done: HashSet<UnitName>) -> Self {
        let (folder, disk) = (folder.to_path_buf(), Arc::clone(disk));
        Self { folder, task, disk, done: Mutex::new(done), settling: Mutex::default() }
    }

    /// True if a process does a part of the work and leaves it to others to look at all inputs closely.
    pub(crate) fn is_in_parts(&self) -> bool {
        matches!(self.task, Task::Look | Task::Run { .. })
    }

    /// Notes for what the job is made, or refuses to go on with another one.
    pub(crate) fn identify(&self, identity: &Identity) -> Result<(), ConvertError> {
        let path = self.folder.join(IDENTITY);
        if matches!(self.task, Task::Plan) {
            let mut file = UnitWriter::create(&path, 0, &self.disk)?;
            file.put(identity)?;
            return file.finish(true);
        }
        let was: Identity = self.read(&path, 0)?.get(0)?;
        identity.differs_from(&was).map_or(Ok(()), |fault| Err(fault.into()))
    }

    /// The folder.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// What this process does.
    pub(crate) fn task(&self) -> &Task {
        &self.task
    }

    /// True if the unit is to be done here, now. What is settled here is divided for good once its file is there: nothing is built
    /// before.
    pub(crate) fn wants(&self, unit: UnitName) -> bool {
        let is_asked = matches!(&self.task, Task::Run { units, .. } if units.contains(&unit));
        let is_too_early = matches!(unit.stage, Stage::Build { .. }) && self.settles();
        is_asked && !is_too_early && !self.is_done(unit)
    }

    /// How long units that others do are waited for, without news of them.
    pub(crate) fn waits(&self) -> Option<Duration> {
        match self.task {
            Task::Run { waits, .. } => waits,
            _ => None,
        }
    }

    /// Units that are done, as far as was seen.
    pub(crate) fn done(&self) -> usize {
        self.lock_done().len()
    }

    /// True if the unit is done.
    pub(crate) fn is_done(&self, unit: UnitName) -> bool {
        self.lock_done().contains(&unit)
    }

    /// A unit as it is listed.
    pub(crate) fn listed(&self, name: UnitName, points: u64, needs: Vec<UnitName>) -> JobUnit {
        JobUnit::new(name, points, needs, self.is_done(name))
    }

    /// Hands what a unit has left to `take`; `None`: it is not done, or its file is not whole, and then it is not done any more.
    pub(crate) fn recall<T>(
        &self,
        unit: UnitName,
        take: impl FnOnce(&UnitReader) -> Result<T, ConvertError>,
    ) -> Result<Option<T>, ConvertError> {
        self.recall_marked(unit, 0, take)
    }

    /// [`Self::recall`] of a unit of work that was divided so.
    pub(super) fn recall_marked<T>(
        &self,
        unit: UnitName,
        mark: u32,
        take: impl FnOnce(&UnitReader) -> Result<T, ConvertError>,
    ) -> Result<Option<T>, ConvertError> {
        if !self.is_done(unit) {
            return Ok(None);
        }
        let path = self.path(unit);
        match self.read(&path, unit.label(mark)).and_then(|reader| take(&reader)) {
            Ok(value) => Ok(Some(value)),
            Err(ConvertError::Job(JobFault::Damaged { .. })) => {
                if !matches!(self.task, Task::Look) {
                    fs::remove_file(&path).map_err(|e| ConvertError::io(&path, "removing a broken unit", e))?;
                }
                self.lock_done().remove(&unit);
                Ok(None)
            }
            Err(other) => Err(other),
        }
    }

    /// Writes what a unit leaves: `fill` puts it into the file.
    pub(crate) fn keep(
        &self,
        unit: UnitName,
        fill: impl FnOnce(&mut UnitWriter) -> Result<(), ConvertError>,
    ) -> Result<(), ConvertError> {
        self.keep_marked(unit, 0, fill)
    }

    /// [`Self::keep`] of a unit of work that was divided so.
    pub(super) fn keep_marked(
        &self,
        unit: UnitName,
        mark: u32,
        fill: impl FnOnce(&mut UnitWriter) -> Result<(), ConvertError>,
    ) -> Result<(), ConvertError> {
        let mut file = UnitWriter::create(&self.path(unit), unit.label(mark), &self.disk)?;
        fill(&mut file)?;
        file.finish(true)?;
        self.lock_done().insert(unit);
        Ok(())
    }

    /// A new file for records that a unit leaves, and its name.
    pub(crate) fn new_records(&self, unit: UnitName, temp: &TempFiles) -> Result<(DiskFile, String), ConvertError> {
        let name = format!("{unit}.{}.records", super::unique());
        Ok((temp.keep(&self.records(&name))?, name))
    }

    /// Where records of that name are.
    pub(crate) fn records(&self, name: &str) -> PathBuf {
        self.folder.join(UNITS).join(name)
    }

    /// The file for records of a pass that is settled here.
    pub(crate) fn settle_records(&self, pass: u32, temp: &TempFiles) -> Result<Option<DiskFile>, ConvertError> {
        let unit = settle(pass);
        if !self.wants(unit) {
            return Ok(None);
        }
        let (file, name) = self.new_records(unit, temp)?;
        self.settling().records = Some(name);
        Ok(Some(file))
    }

    /// A file for other records of the pass that is settled here, and its name.
    pub(crate) fn more_records(&self, temp: &TempFiles) -> Result<Option<(DiskFile, String)>, ConvertError> {
        let pass = self.settling().pass;
        self.settles().then(|| self.new_records(settle(pass), temp)).transpose()
    }

    /// Begins to settle a pass, or takes what another process has come to.
    ///
    /// # Errors
    /// It is not done, and not to be done here.
    pub(crate) fn enter(&self, pass: u32, points: u64) -> Result<(), ConvertError> {
        let unit = settle(pass);
        if self.wants(unit) {
            let mut settling = self.settling();
            (settling.pass, settling.is_running) = (pass, true);
            return Ok(());
        }
        match self.recall(unit, |file| file.get(0))? {
            Some(results) => {
                *self.settling() = Settling { pass, is_running: false, records: None, results };
                Ok(())
            }
            None => Err(JobFault::Unfinished { units: vec![self.listed(unit, points, Vec::new())] }.into()),
        }
    }

    /// True if this process settles the pass.
    pub(crate) fn settles(&self) -> bool {
        self.settling().is_running
    }

    /// A result of settling: made here, with what it puts into the store, or as another process has found it, if that `can_be`.
    /// `records`: the file for records of this process, if it is another one than that of the pass.
    pub(crate) fn settled_in<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        store: &Store,
        records: Option<String>,
        can_be: impl FnOnce(&T) -> bool,
        make: impl FnOnce() -> Result<T, ConvertError>,
    ) -> Result<T, ConvertError> {
        let first = store.next_block()?;
        if self.settles() {
            let value = make()?;
            let blocks = store.secure(first)?;
            let records = records.or_else(|| self.settling().records.clone());
            let result = super::encode(&(&value, first, records, blocks))?;
            self.settling().results.push((name.to_owned(), result));
            return Ok(value);
        }
        let settling = self.settling();
        let unit = settle(settling.pass);
        let damaged = || ConvertError::Job(JobFault::Damaged { file: self.path(unit), byte: 0 });
        let (_, result) = settling.results.iter().find(|(known, _)| known == name).ok_or_else(damaged)?;
        let (value, was_first, records, blocks) =
            postcard::from_bytes::<(T, u32, Option<String>, Vec<SafeBlock>)>(result).map_err(|_| damaged())?;
        let is_name = |name: &String| name.starts_with(&unit.to_string()) && !name.contains('/');
        let are_blocks = blocks.iter().all(|block| store.can_hold(block)) && records.iter().all(is_name);
        if !are_blocks || !can_be(&value) {
            return Err(damaged());
        }
        if was_first != first {
            return Err(ConvertError::Internal(format!(
                "{name}: {first} blocks before it, {was_first} when it was made"
            )));
        }
        if let (Some(records), false) = (records, blocks.is_empty()) {
            store.adopt_from(self.records(&records), &blocks)?;
        }
        Ok(value)
    }

    /// Ends settling, if this process does it: its results are safe then. What another process has settled meanwhile stays: units may
    /// have been built from it.
    pub(crate) fn end_settling(&self) -> Result<(), ConvertError> {
        let Settling { pass, is_running, results, .. } = std::mem::take(&mut *self.settling());
        if !is_running {
            return Ok(());
        }
        self.look_again()?;
        let unit = settle(pass);
        if self.is_done(unit) { Ok(()) } else { self.keep(unit, |file| file.put(&results)) }
    }

    /// Removes the job, and what else its processes have left in its folders. Files of others stay.
    pub(crate) fn end(&self) -> Result<(), ConvertError> {
        let fail = |e| ConvertError::io(&self.folder, "removing the job folder", e);
        for entry in fs::read_dir(&self.folder).map_err(fail)? {
            let entry = entry.map_err(fail)?;
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if name == UNITS {
                remove_units(&entry.path()).map_err(fail)?;
            } else if name.starts_with(WORK) {
                fs::remove_dir_all(entry.path()).map_err(fail)?;
            } else if name.starts_with(IDENTITY) {
                fs::remove_file(entry.path()).map_err(fail)?;
            }
        }
        sync_folder(&*self.disk, &self.folder).map_err(fail)
    }

    /// A folder to work in, which is removed when it is dropped. Who only looks leaves the folder of the job as it is.
    pub(crate) fn work(&self) -> Result<tempfile::TempDir, ConvertError> {
        let folder = if matches!(self.task, Task::Look) { std::env::temp_dir() } else { self.folder.clone() };
        let fail = |e| ConvertError::io(&folder, "making a folder to work in", e);
        tempfile::Builder::new().prefix(WORK).tempdir_in(&folder).map_err(fail)
    }

    fn path(&self, unit: UnitName) -> PathBuf {
        self.folder.join(UNITS).join(unit.to_string())
    }

    fn read(&self, path: &Path, label: u32) -> Result<UnitReader, ConvertError> {
        let fail = |e| ConvertError::io(path, "opening a unit", e);
        let length = fs::metadata(path).map_err(fail)?.len();
        UnitReader::open(path, label, DiskFile::open(path, path.to_path_buf(), &self.disk)?, length)
    }

    fn lock_done(&self) -> MutexGuard<'_, HashSet<UnitName>> {
        self.done.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn settling(&self) -> MutexGuard<'_, Settling> {
        self.settling.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The units whose files are in a folder.
fn done_in(units: &Path) -> Result<HashSet<UnitName>, ConvertError> {
    let fail = |e| ConvertError::io(units, "looking for units", e);
    let mut done = HashSet::new();
    for entry in fs::read_dir(units).map_err(fail)? {
        let name = entry.map_err(fail)?.file_name();
        done.extend(name.to_str().and_then(|name| name.parse::<UnitName>().ok()));
    }
    Ok(done)
}

/// Removes units, their records, and what of them was never complete; the folder, too, if nothing else is in it.
fn remove_units(units: &Path) -> std::io::Result<()> {
    let is_ours = |name: &str| name.split('.').next().is_some_and(|unit| unit.parse::<UnitName>().is_ok());
    for entry in fs::read_dir(units)? {
        let entry = entry?;
        if entry.file_name().to_str().is_some_and(is_ours) {
            fs::remove_file(entry.path())?;
        }
    }
    match fs::remove_dir(units) {
        Err(e) if e.kind() == std::io::ErrorKind::DirectoryNotEmpty => Ok(()),
        other => other,
    }
}

fn settle(pass: u32) -> UnitName {
    UnitName { stage: Stage::Settle { pass }, number: 0 }
}
