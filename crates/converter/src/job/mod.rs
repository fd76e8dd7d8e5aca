//! A job: what a run leaves in a folder, so that another one can go on where it ended.
//!
//! The folder holds a journal, which says for what it was made and which units are done, and the records that these have read.
//! Units are numbered within a pass over the scans. It is removed when the run has made its output.

mod identity;
mod in_place;
mod journal;
mod keeper;
mod shared;
mod tasks;
mod unit_file;

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

pub(crate) use identity::Identity;
pub(crate) use in_place::{InPlace, KeptFile, Place};
use journal::{Entry, Journal};
pub(crate) use keeper::{Build, GroupUnits, Keeper, settled};
use pointmill_format::DatasetKind;
use pointmill_format::bintree::PACKED_FILE;
use serde::{Deserialize, Serialize};
pub(crate) use shared::{SharedJob, Task};
pub(crate) use tasks::{Said, UnitLog, make_units, put_back};
pub(crate) use unit_file::{UnitReader, UnitWriter};

use crate::error::{ConvertError, JobFault};
use crate::plan::{Checkpoint, Plan};
use crate::runtime::disk::{create_folder, sync_folder};
use crate::runtime::os_files::{FileLock, Locked};
use crate::runtime::{Disk, DiskFile, TempFiles};
use crate::sources::Sources;
use crate::unit_name::UnitName;
use crate::warning::Warning;

const LOCK: &str = "lock";
const JOURNAL: &str = "journal";
const RECORDS: &str = "records-";
const BUILT: &str = "build-";
/// How the names begin of files that are part of the output, too.
pub(crate) const KEPT_OUTPUT: &str = "output-";
/// A file that is made to see whether that is possible.
pub(crate) const PROBE: &str = "probe";

/// What a run leaves for another one.
#[derive(Debug)]
pub(crate) struct Job {
    folder: PathBuf,
    disk: Arc<dyn Disk>,
    /// Until the end of the run.
    _lock: Option<FileLock>,
    state: Arc<Mutex<State>>,
    /// Notes the unit that was added last.
    noting: Mutex<Option<Noting>>,
    /// Nothing was there to go on with.
    is_new: bool,
    recalled: AtomicU64,
    recalled_units: AtomicU64,
}

type Noting = std::thread::JoinHandle<Result<(), ConvertError>>;

#[derive(Debug)]
struct State {
    journal: Journal,
    /// By pass and number.
    units: HashMap<(u32, u64), Entry>,
}

/// A record of the journal, before what the unit itself left.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct UnitHead {
    pass: u32,
    unit: u64,
}

/// The folder of the job of an output; `temp_dir`: where temporary files go, if not beside it.
pub(crate) fn folder_of(output: &Path, temp_dir: Option<&Path>) -> PathBuf {
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    match temp_dir {
        None => output.with_file_name(format!("{name}.job")),
        Some(dir) => dir.join(format!("{name}-{:08x}.job", crc32c::crc32c(output.as_os_str().as_encoded_bytes()))),
    }
}

impl Job {
    /// The job of a run, as the plan has it, and what there is to say of it; `is_large`: its points are not expected to fit into memory.
    /// `output`: its place. What a run that is over has left for this output goes, unless this one goes on with it.
    ///
    /// # Errors
    /// The run that is to go on is not this one, another run works with it, or the disk refuses.
    pub(crate) fn of(
        plan: &Plan,
        is_large: bool,
        sources: &Sources,
        settings: serde_json::Map<String, serde_json::Value>,
        output: &Path,
        disk: &Arc<dyn Disk>,
    ) -> Result<(Option<Self>, Vec<Warning>), ConvertError> {
        let folder = folder_of(output, plan.temp_dir.as_deref());
        let is_wanted = match plan.checkpoint {
            Checkpoint::Always => true,
            Checkpoint::Auto => is_large,
            Checkpoint::Never => false,
        };
        if !is_wanted && !plan.resume {
            return Ok((None, remove_dead(&folder).into_iter().collect()));
        }
        let identity = Identity::of(plan, sources, settings, true)?;
        let mut warnings = Vec::new();
        if plan.resume {
            if let Some(job) = Self::resume(folder.clone(), &identity, disk)? {
                return Ok((Some(job), warnings));
            }
            warnings.push(Warning::BeginsAnew);
        }
        let is_asked_for = plan.resume || plan.checkpoint == Checkpoint::Always;
        let begun = match folder.exists() {
            true => remove(&folder).map(|()| warnings.push(Warning::JobRemoved { folder: folder.clone() })),
            false => Ok(()),
        };
        match begun.and_then(|()| Self::begin(folder.clone(), &identity, disk)) {
            Ok(job) => Ok((Some(job), warnings)),
            Err(error @ ConvertError::Job(JobFault::InUse { .. })) => Err(error),
            Err(error) if is_asked_for => Err(error),
            // nobody has asked for it: the run is worth more
            Err(error) => {
                let _ = remove_files(&folder);
                warnings.push(Warning::NoJob { why: error.to_string() });
                Ok((None, warnings))
            }
        }
    }

    /// Begins a job.
    fn begin(folder: PathBuf, identity: &Identity, disk: &Arc<dyn Disk>) -> Result<Self, ConvertError> {
        create_folder(&**disk, &folder).map_err(|e| ConvertError::io(&folder, "making the job folder", e))?;
        let lock = lock(&folder, FileLock::create)?;
        let mut journal = Journal::create(&folder.join(JOURNAL), disk)?;
        journal.append(&encode(identity)?)?;
        sync_folder(&**disk, &folder).map_err(|e| ConvertError::io(&folder, "syncing the job folder", e))?;
        let state = Arc::new(Mutex::new(State { journal, units: HashMap::new() }));
        Ok(Self {
            folder,
            disk: Arc::clone(disk),
            _lock: lock,
            state,
            noting: Mutex::default(),
            is_new: true,
            recalled: AtomicU64::new(0),
            recalled_units: AtomicU64::new(0),
        })
    }

    /// Goes on with a job; `None`: there is none, or its run ended before it had one.
    fn resume(folder: PathBuf, identity: &Identity, disk: &Arc<dyn Disk>) -> Result<Option<Self>, ConvertError> {
        let path = folder.join(JOURNAL);
        if !path.is_file() {
            return Ok(None);
        }
        let lock = lock(&folder, FileLock::open)?;
        let Some((journal, entries)) = Journal::open(&path, disk)? else { return Ok(None) };
        let damaged = |entry: Entry| JobFault::Damaged { file: path.clone(), byte: entry.offset };
        let Some((first, others)) = entries.split_first() else { return Ok(None) };
        let was: Identity = postcard::from_bytes(&journal.read(*first)?).map_err(|_| damaged(*first))?;
        if let Some(fault) = identity.differs_from(&was) {
            return Err(fault.into());
        }
        let mut units = HashMap::new();
        for entry in others {
            let payload = journal.read(*entry)?;
            let (head, rest) = postcard::take_from_bytes::<UnitHead>(&payload).map_err(|_| damaged(*entry))?;
            let skipped = (payload.len() - rest.len()) as u32;
            let body = Entry { offset: entry.offset + u64::from(skipped), bytes: entry.bytes - skipped };
            units.insert((head.pass, head.unit), body);
        }
        let state = Arc::new(Mutex::new(State { journal, units }));
        Ok(Some(Self {
            folder,
            disk: Arc::clone(disk),
            _lock: lock,
            state,
            noting: Mutex::default(),
            is_new: false,
            recalled: AtomicU64::new(0),
            recalled_units: AtomicU64::new(0),
        }))
    }

    /// What a unit that is done has left.
    pub(crate) fn unit<T: for<'d> Deserialize<'d>>(&self, pass: u32, unit: u64) -> Result<Option<T>, ConvertError> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(entry) = state.units.get(&(pass, unit)) else { return Ok(None) };
        let payload = state.journal.read(*entry)?;
        let damaged = |_| JobFault::Damaged { file: self.folder.join(JOURNAL), byte: entry.offset }.into();
        postcard::from_bytes(&payload).map(Some).map_err(damaged)
    }

    /// Notes that a unit is done once `records` are safe; neither is waited for. One that was noted before is safe then.
    pub(crate) fn add(
        &self,
        pass: u32,
        unit: u64,
        left: &impl Serialize,
        records: Arc<DiskFile>,
    ) -> Result<(), ConvertError> {
        let payload = encode(&(UnitHead { pass, unit }, left))?;
        self.settle()?;
        let state = Arc::clone(&self.state);
        let note = move || {
            records.sync("syncing the records")?;
            let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
            let entry = state.journal.append(&payload)?;
            state.units.insert((pass, unit), entry); // nobody asks for it again
            Ok(())
        };
        let failed = |e| ConvertError::io(&self.folder, "starting a thread", e);
        let thread = std::thread::Builder::new().name("journal".into()).spawn(note).map_err(failed)?;
        *self.noting.lock().unwrap_or_else(PoisonError::into_inner) = Some(thread);
        Ok(())
    }

    /// Waits until the unit that was added last is safe.
    pub(crate) fn settle(&self) -> Result<(), ConvertError> {
        let Some(thread) = self.noting.lock().unwrap_or_else(PoisonError::into_inner).take() else { return Ok(()) };
        let failed = |_| Err(ConvertError::Internal("the thread that writes the journal failed".into()));
        thread.join().unwrap_or_else(failed)
    }

    /// The file for the records of a pass; those of passes before it are not needed any more.
    pub(crate) fn records(&self, pass: u32, temp: &TempFiles) -> Result<DiskFile, ConvertError> {
        for before in 1..pass {
            match fs::remove_file(self.records_path(before)) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                    return Err(ConvertError::io(&self.folder, "removing records", e));
                }
                _ => {}
            }
        }
        temp.keep(&self.records_path(pass))
    }

    fn records_path(&self, pass: u32) -> PathBuf {
        self.folder.join(format!("{RECORDS}{pass}"))
    }

    /// Where a unit leaves what it has built.
    fn built_path(&self, unit: UnitName) -> PathBuf {
        self.folder.join(unit.to_string())
    }

    /// The error for a unit that has left what no unit of this run leaves.
    pub(crate) fn damaged_unit(&self, pass: u32, unit: u64) -> ConvertError {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let byte = state.units.get(&(pass, unit)).map_or(0, |entry| entry.offset);
        JobFault::Damaged { file: self.folder.join(JOURNAL), byte }.into()
    }

    /// The folder.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Notes points that did not have to be read again.
    pub(crate) fn count_recalled(&self, points: u64) {
        self.recalled.fetch_add(points, Ordering::Relaxed);
    }

    /// Points that did not have to be read again.
    pub(crate) fn recalled(&self) -> u64 {
        self.recalled.load(Ordering::Relaxed)
    }

    /// Notes units that did not have to be built again.
    fn count_recalled_units(&self, units: u64) {
        self.recalled_units.fetch_add(units, Ordering::Relaxed);
    }

    /// Units that did not have to be built again.
    pub(crate) fn recalled_units(&self) -> u64 {
        self.recalled_units.load(Ordering::Relaxed)
    }

    /// True if nothing was there to go on with.
    pub(crate) fn is_new(&self) -> bool {
        self.is_new
    }

    /// True if another run could go on by now.
    pub(crate) fn is_safe(&self) -> bool {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        !state.units.is_empty()
    }

    /// True if another run can go on.
    pub(crate) fn has_units(&self) -> bool {
        let _ = self.settle(); // what failed is not there
        self.is_safe()
    }

    /// Parts with the files that are part of the output, too: it is about to get its name, and nothing is to change it from then
    /// on.
    pub(crate) fn part_with_output(&self) -> Result<(), ConvertError> {
        let failed = |e| ConvertError::io(&self.folder, "removing a name of the output", e);
        let entries = match fs::read_dir(&self.folder) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()), // somebody has removed all of it
            entries => entries.map_err(failed)?,
        };
        for entry in entries {
            let entry = entry.map_err(failed)?;
            let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
            if is_file && is_output(&entry.file_name().to_string_lossy()) {
                fs::remove_file(entry.path()).map_err(failed)?;
            }
        }
        Ok(())
    }

    /// Removes the folder; what there is to say if that cannot be done.
    pub(crate) fn end(self) -> Option<Warning> {
        let _ = self.settle(); // it goes
        let why = remove_files(&self.folder).err()?;
        Some(Warning::Leftover { path: self.folder, why: why.to_string() })
    }
}

/// A part of a name that no other process makes.
fn unique() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let time = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    // processes of two machines may have the same number, but hardly begin in the same nanosecond
    format!("{:x}-{time:x}-{:x}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed))
}

/// Bytes for a file of a job.
pub(crate) fn encode(value: &impl Serialize) -> Result<Vec<u8>, ConvertError> {
    postcard::to_stdvec(value).map_err(|e| ConvertError::Internal(format!("writing a job: {e}")))
}

/// What [`encode`] made; fails where it was not that.
pub(crate) fn decode<T: serde::de::DeserializeOwned>(bytes: &[u8]) -> Result<T, ConvertError> {
    postcard::from_bytes(bytes).map_err(|e| ConvertError::Internal(format!("reading a job: {e}")))
}

fn lock(folder: &Path, take: impl FnOnce(&Path) -> std::io::Result<Locked>) -> Result<Option<FileLock>, ConvertError> {
    match take(&folder.join(LOCK)).map_err(|e| ConvertError::io(folder, "locking the job folder", e))? {
        Locked::Ours(lock) => Ok(Some(lock)),
        Locked::Taken => Err(JobFault::InUse { folder: folder.to_path_buf() }.into()),
        Locked::Unknown => Ok(None),
    }
}

/// Removes what a run that is over has left, if that is a job; what there is to say.
fn remove_dead(folder: &Path) -> Option<Warning> {
    if !folder.join(JOURNAL).is_file() {
        return None;
    }
    let folder = folder.to_path_buf();
    match remove(&folder) {
        Ok(()) => Some(Warning::JobRemoved { folder }),
        Err(ConvertError::Job(_)) => None, // another run works with it, or it is none
        Err(error) => Some(Warning::Leftover { path: folder, why: error.to_string() }),
    }
}

/// Removes a job whose run is over, and nothing that is none.
fn remove(folder: &Path) -> Result<(), ConvertError> {
    let names: Vec<_> = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name()).collect();
    let is_job = names.is_empty() || names.iter().any(|name| name == LOCK || name == JOURNAL);
    if !is_job || !names.iter().all(|name| is_ours(&name.to_string_lossy())) {
        return Err(JobFault::NoJob { folder: folder.to_path_buf() }.into());
    }
    let held = match folder.join(LOCK).is_file() {
        true => lock(folder, FileLock::open)?,
        false => None,
    };
    remove_files(folder)?;
    drop(held);
    Ok(())
}

fn is_ours(name: &str) -> bool {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let is_records = name.strip_prefix(RECORDS).is_some_and(is_number);
    // of one that was not complete something follows
    let unit = name.split('.').next().filter(|unit| unit.starts_with(BUILT));
    let is_built = unit.is_some_and(|unit| unit.parse::<UnitName>().is_ok());
    name == LOCK || name == JOURNAL || is_records || is_built || is_output(name)
}

/// True if a job gives files of outputs such a name.
fn is_output(name: &str) -> bool {
    let of_kind = |kind: &DatasetKind| name.strip_prefix(KEPT_OUTPUT)?.strip_prefix(kind.name())?.strip_prefix('-');
    DatasetKind::ALL.iter().any(|kind| of_kind(kind).is_some_and(|file| is_kept_file(*kind, file)))
}

/// True if a job keeps a file of that name of datasets of that kind.
fn is_kept_file(kind: DatasetKind, file: &str) -> bool {
    let is_leaf = |name: &str| name.bytes().all(|b| matches!(b, b'0' | b'1'));
    match kind {
        DatasetKind::Potree2 => file == "octree.bin",
        DatasetKind::Bintree => {
            let leaf = file.strip_prefix('n').and_then(|rest| rest.strip_suffix(".bin"));
            file == PACKED_FILE || file == PROBE || leaf.is_some_and(is_leaf)
        }
        _ => file == kind.marker_file(),
    }
}

/// Removes our files, and the folder if nothing else is in it. The journal goes first: without it no run
/// looks for the rest.
fn remove_files(folder: &Path) -> Result<(), ConvertError> {
    let remove = || {
        let mut names: Vec<String> =
            fs::read_dir(folder)?.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.retain(|name| is_ours(name));
        names.sort_by_key(|name| (name == LOCK, name != JOURNAL));
        names.iter().try_for_each(|name| fs::remove_file(folder.join(name)))?;
        fs::remove_dir(folder)
    };
    remove().map_err(|e| ConvertError::io(folder, "removing the job folder", e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_job_are_known_by_their_whole_names() {
        for name in [
            "lock",
            "journal",
            "records-1",
            "build-0-12",
            "build-0-12.7e23-18ebf1a1141aaac6-0",
            "output-potree2-octree.bin",
            "output-copc-points.copc.laz",
            "output-batches-points.qbatch",
            "output-bintree-leaves.bin",
            "output-bintree-n.bin",
            "output-bintree-n0110.bin",
        ] {
            assert!(is_ours(name), "{name}");
        }
        for name in [
            "output-results.csv",
            "output-",
            "output-potree2-notes.txt",
            "output-bintree-notes.bin",
            "output-bintree-n02.bin",
            "output-potree2-octree.bin.bak",
            "records-of-may.txt",
            "records-",
            "build-log",
            "build-0-x",
            "read-1-0",
            "lock.txt",
        ] {
            assert!(!is_ours(name), "{name}");
        }
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("records-1"), "of mine").unwrap();
        assert!(matches!(remove(dir.path()), Err(ConvertError::Job(JobFault::NoJob { .. }))), "no journal, no lock");
        fs::write(dir.path().join("journal"), "").unwrap();
        remove(dir.path()).unwrap();
        assert!(!dir.path().exists());
    }
}
