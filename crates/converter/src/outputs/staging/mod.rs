//! A dataset is made in a hidden folder beside its final name (or in the output, where that is a mounted folder), synced,
//! and given its name at once: finished or not there. What stood there before is there until that moment.

mod files;
mod hidden;
mod leftovers;
mod ours;
mod place;
mod replace;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pointmill_format::DatasetKind;

use crate::error::{ConvertError, OutputFault};
use crate::runtime::disk::{create_folder, sync_folder, sync_path};
use crate::runtime::os_files::adopt_owner;
use crate::runtime::{Disk, DiskFile, Events, Replacing};
use crate::warning::Warning;
pub use files::StagedFiles;
use hidden::HiddenFolder;
use ours::Standing;
use place::parent_of;
pub use place::resolve_path;
use replace::Replace;

/// The account of a run, beside the datasets or in the one that there is.
pub(crate) const REPORT_FILE: &str = "report.json";

/// A folder that becomes the output when all is well, and vanishes when not.
pub(crate) struct StagedFolder {
    hidden: HiddenFolder,
    replacing: Replacing,
    place: Place,
    disk: Arc<dyn Disk>,
    /// What there is to say of earlier runs.
    pub(crate) warnings: Vec<Warning>,
}

/// Where the output is to be.
struct Place {
    /// As it was requested.
    given: PathBuf,
    /// Resolved.
    path: PathBuf,
    overwrite: bool,
}

impl StagedFolder {
    /// Settles what earlier runs have left, checks that `output` may be made, and makes the hidden folder.
    pub(crate) fn new(
        output: &Path,
        overwrite: bool,
        disk: Arc<dyn Disk>,
        events: &dyn Events,
    ) -> Result<Self, ConvertError> {
        let path = resolve_path(output).map_err(|e| ConvertError::io(output, "finding the place of the output", e))?;
        let warnings = leftovers::settle(&path, events)?;
        let place = Place { given: output.to_path_buf(), path, overwrite };
        let standing = place.check(None)?;
        let (hidden, replacing) = place.make_room(&standing, &*disk)?;
        Ok(Self { hidden, replacing, place, disk, warnings })
    }

    /// The folder on whose file system the output is made.
    pub(crate) fn parent(&self) -> PathBuf {
        parent_of(self.hidden.path()).to_path_buf()
    }

    /// The hidden folder.
    pub(crate) fn path(&self) -> &Path {
        self.hidden.path()
    }

    /// The place of a dataset: the folder itself if it is the only one, else a folder in it.
    pub(crate) fn dataset(&self, kind: DatasetKind, is_only_one: bool) -> Result<StagedDataset, ConvertError> {
        let mut dataset = self.whole();
        if !is_only_one {
            dataset.name = kind.name();
            dataset.folder.push(dataset.name);
            dataset.shown.push(dataset.name);
            create_folder(&*self.disk, &dataset.folder)
                .map_err(|e| ConvertError::io(&dataset.shown, "making the folder of a dataset", e))?;
        }
        Ok(dataset)
    }

    /// Writes and syncs the report beside the datasets, or in the one that there is.
    pub(crate) fn write_report(&self, text: &str) -> Result<(), ConvertError> {
        self.whole().write(REPORT_FILE, text.as_bytes())
    }

    fn whole(&self) -> StagedDataset {
        let (folder, shown) = (self.hidden.path_of_new(), self.place.given.clone());
        StagedDataset { folder, shown, name: "", disk: Arc::clone(&self.disk) }
    }

    /// Gives the folder its final name; whatever fails before it has it is undone. What stood there goes afterwards.
    /// Returns what there is to say of that.
    pub(crate) fn finish(mut self, events: &dyn Events) -> Result<Option<Warning>, ConvertError> {
        let output = self.place.path.as_path();
        let standing = self.place.check(Some(self.hidden.path()))?;
        let new = self.hidden.path_of_new();
        sync_folder(&*self.disk, &new).map_err(|e| ConvertError::io(output, "syncing the output", e))?;
        let replace = Replace { hidden: &mut self.hidden, output, disk: &*self.disk };
        match (standing, self.replacing) {
            (Standing::Nothing, _) => replace.appear()?,
            (Standing::Ours(files), Replacing::EntryByEntry) => replace.entries(&names_directly_in(output, &files))?,
            (_, Replacing::EntryByEntry) => replace.entries(&[])?,
            (_, replacing) => replace.whole(replacing)?,
        }
        self.hidden.keep_parents();
        Ok(leftovers::clear(self.hidden, leftovers::Whose::OldOutput, events))
    }
}

fn names_directly_in(folder: &Path, files: &[PathBuf]) -> Vec<String> {
    let names = files.iter().filter(|file| file.parent() == Some(folder)).filter_map(|file| file.file_name());
    names.filter_map(|name| name.to_str()).map(str::to_owned).collect()
}

impl Place {
    /// An output may be replaced if it is ours or an empty folder; anything else is not ours to delete. `aside`: a path
    /// in it that does not count.
    fn check(&self, aside: Option<&Path>) -> Result<Standing, ConvertError> {
        let standing =
            Standing::of(&self.path, aside).map_err(|e| ConvertError::io(&self.given, "reading the output", e))?;
        let output = self.given.clone();
        match standing {
            Standing::Nothing | Standing::Empty => Ok(standing),
            _ if !self.overwrite => Err(OutputFault::Exists(output).into()),
            Standing::Ours(_) => Ok(standing),
            Standing::Foreign(file) => {
                let file = file.strip_prefix(&self.path).map_or(file.clone(), |inner| output.join(inner));
                Err(OutputFault::Foreign { output, file }.into())
            }
            Standing::Other => Err(OutputFault::NotADataset(output).into()),
        }
    }

    /// Makes the hidden folder beside the output, or in it: where the folder of the output cannot be replaced, because
    /// something is mounted there, the folder above is not writable, or its owner could not be kept.
    fn make_room(&self, standing: &Standing, disk: &dyn Disk) -> Result<(HiddenFolder, Replacing), ConvertError> {
        let best = disk.replacing();
        if *standing == Standing::Nothing || best != Replacing::EntryByEntry {
            match HiddenFolder::beside(&self.path) {
                Ok(hidden) if *standing == Standing::Nothing => return Ok((hidden, best)),
                Ok(mut hidden) => {
                    if self.can_be_moved(&mut hidden) && self.keeps_owner(standing, &hidden) {
                        return Ok((hidden, best));
                    }
                }
                Err(e) if *standing == Standing::Nothing || !is_denied(&e) => {
                    return Err(ConvertError::io(&self.given, "making a folder beside the output", e));
                }
                _ => {}
            }
        }
        match HiddenFolder::inside(&self.path) {
            Ok(hidden) => Ok((hidden, Replacing::EntryByEntry)),
            Err(e) => Err(ConvertError::io(&self.given, "making a folder in the output", e)),
        }
    }

    /// Learns it from the system without moving anything: a folder never takes the place of one with something in it,
    /// and what cannot be moved at all is refused first.
    fn can_be_moved(&self, hidden: &mut HiddenFolder) -> bool {
        if cfg!(not(unix)) {
            return true;
        }
        let full = hidden.path().join("probe");
        let made = fs::create_dir(&full).and_then(|()| fs::write(full.join("full"), ""));
        let moved = made.and_then(|()| fs::rename(&self.path, &full));
        if moved.is_ok() {
            // a file system that keeps no promise: back with it
            if fs::rename(&full, &self.path).is_err() {
                hidden.keep();
            }
            return false;
        }
        let _ = fs::remove_dir_all(&full);
        moved.is_err_and(|e| matches!(e.kind(), io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::AlreadyExists))
    }

    /// An empty folder was made by someone for this output: it keeps its owner, come what may.
    fn keeps_owner(&self, standing: &Standing, hidden: &HiddenFolder) -> bool {
        let owner = fs::metadata(&self.path);
        *standing != Standing::Empty || owner.is_ok_and(|of| adopt_owner(&hidden.path_of_new(), &of))
    }
}

fn is_denied(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem)
}

/// A dataset on its way into a [`StagedFolder`].
pub(crate) struct StagedDataset {
    folder: PathBuf,
    /// What errors name: where it is to be.
    shown: PathBuf,
    name: &'static str,
    disk: Arc<dyn Disk>,
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

    /// Writes and syncs a small file.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Result<(), ConvertError> {
        let file = self.create(name)?;
        file.write_at(bytes, 0, "writing the file")?;
        file.sync("writing the file")
    }

    /// Syncs a file that was made before and is closed.
    pub(crate) fn sync_file(&self, name: &str) -> Result<(), ConvertError> {
        let path = self.folder.join(name);
        sync_path(&*self.disk, &path).map_err(|e| ConvertError::io(self.shown.join(name), "syncing the file", e))
    }

    /// Syncs the names of the files.
    pub(crate) fn sync(&self) -> Result<(), ConvertError> {
        sync_folder(&*self.disk, &self.folder).map_err(|e| ConvertError::io(&self.shown, "syncing the output", e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::{DiskOperation, Silent, SystemDisk};

    /// What is in a dataset of ours, as far as anybody looks.
    const METADATA: &str = r#"{"hierarchy": {}, "pointmill": {}}"#;

    /// A disk that can do less.
    #[derive(Debug)]
    struct Poor(Replacing);

    impl Disk for Poor {
        fn permit(&self, _: DiskOperation) -> io::Result<()> {
            Ok(())
        }

        fn replacing(&self) -> Replacing {
            self.0
        }
    }

    const ALL_WAYS: [Replacing; 3] = [Replacing::AtOnce, Replacing::InTwoSteps, Replacing::EntryByEntry];

    fn stage(output: &Path, overwrite: bool) -> Result<StagedFolder, ConvertError> {
        StagedFolder::new(output, overwrite, Arc::new(SystemDisk), &Silent)
    }

    fn fault(result: Result<StagedFolder, ConvertError>) -> OutputFault {
        match result.err() {
            Some(ConvertError::Output(fault)) => fault,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_output_appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("größe");
        let staged = stage(&out, false).unwrap();
        staged.whole().write("metadata.json", b"{}").unwrap();
        assert!(!out.exists());
        drop(staged);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "nothing is left behind");
        let staged = stage(&out, false).unwrap();
        staged.whole().write("metadata.json", b"{}").unwrap();
        assert_eq!(staged.finish(&Silent).unwrap(), None);
        assert_eq!(fs::read(out.join("metadata.json")).unwrap(), b"{}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_datasets_are_replaced_and_only_when_asked() {
        for replacing in ALL_WAYS {
            let dir = tempfile::tempdir().unwrap();
            let out = dir.path().join("out");
            let stage = |overwrite| StagedFolder::new(&out, overwrite, Arc::new(Poor(replacing)), &Silent);
            fs::create_dir(&out).unwrap();
            fs::write(out.join("letter.txt"), "dear").unwrap();
            assert!(matches!(fault(stage(false)), OutputFault::Exists(_)));
            assert!(matches!(fault(stage(true)), OutputFault::NotADataset(_)));
            fs::write(out.join("metadata.json"), "{\"hierarchy\": {}}").unwrap();
            assert!(matches!(fault(stage(true)), OutputFault::NotADataset(_)), "metadata of something else");
            fs::write(out.join("metadata.json"), METADATA).unwrap();
            assert_eq!(fault(stage(true)), OutputFault::Foreign { output: out.clone(), file: out.join("letter.txt") });
            fs::remove_file(out.join("letter.txt")).unwrap();
            fs::write(out.join("hierarchy.bin"), "old").unwrap();
            let staged = stage(true).unwrap();
            staged.whole().write("metadata.json", b"new").unwrap();
            assert_eq!(staged.finish(&Silent).unwrap(), None);
            assert_eq!(fs::read(out.join("metadata.json")).unwrap(), b"new");
            assert_eq!(fs::read_dir(&out).unwrap().count(), 1, "{replacing:?}");
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "{replacing:?}");
        }
    }

    #[test]
    fn what_comes_into_the_old_output_at_the_last_moment_is_kept_and_named() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        fs::create_dir(&out).unwrap();
        fs::write(out.join("metadata.json"), METADATA).unwrap();
        let mut staged = stage(&out, true).unwrap();
        staged.whole().write("metadata.json", b"new").unwrap();
        let replace = Replace { hidden: &mut staged.hidden, output: &staged.place.path, disk: &SystemDisk };
        fs::write(out.join("letter.txt"), "dear").unwrap();
        replace.whole(Replacing::AtOnce).unwrap();
        let left = leftovers::clear(staged.hidden, leftovers::Whose::OldOutput, &Silent);
        let Some(Warning::Leftover { path, .. }) = left else { panic!("{left:?}") };
        assert_eq!(fs::read(path).unwrap(), b"dear");
        assert_eq!(fs::read(out.join("metadata.json")).unwrap(), b"new");
    }

    /// Every moment at which a run can be killed while it replaces: the next one finds the old output or the new one,
    /// and nothing beside it.
    #[test]
    fn a_run_that_is_killed_while_it_replaces_leaves_one_dataset_for_the_next() {
        /// Stands for the kill: from the Nth operation on nothing more is done, and nothing is undone.
        #[derive(Debug)]
        struct Killed(Replacing, std::sync::atomic::AtomicUsize);

        impl Disk for Killed {
            fn permit(&self, _: DiskOperation) -> io::Result<()> {
                let left = self.1.fetch_sub(1, std::sync::atomic::Ordering::Relaxed);
                if left == 0 { std::panic::resume_unwind(Box::new("killed")) } else { Ok(()) }
            }

            fn replacing(&self) -> Replacing {
                self.0
            }
        }

        for (replacing, with_old) in ALL_WAYS.into_iter().flat_map(|way| [(way, false), (way, true)]) {
            for operations in 0.. {
                let dir = tempfile::tempdir().unwrap();
                let out = dir.path().join("out");
                fs::create_dir(&out).unwrap();
                if with_old {
                    fs::write(out.join("metadata.json"), METADATA).unwrap();
                    fs::write(out.join("octree.bin"), "old").unwrap();
                }
                let mut staged = StagedFolder::new(&out, true, Arc::new(Poor(replacing)), &Silent).unwrap();
                staged.whole().write("metadata.json", METADATA.as_bytes()).unwrap();
                staged.whole().write("octree.bin", b"new").unwrap();
                staged.whole().write("hierarchy.bin", b"").unwrap();
                staged.disk = Arc::new(Killed(replacing, operations.into()));
                // what is dropped when it unwinds must stay, as it would
                staged.hidden.keep();
                let killed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| staged.finish(&Silent)));
                let is_whole = || {
                    let text = fs::read(out.join("octree.bin")).ok();
                    fs::read(out.join("metadata.json")).ok().filter(|t| t == METADATA.as_bytes()).and(text)
                };
                let found = is_whole();
                if replacing == Replacing::AtOnce && with_old {
                    assert!(found.is_some(), "never without a dataset");
                }
                let is_false = out.join("metadata.json").exists() && found.is_none();
                assert!(!is_false, "metadata of a dataset that is not all there");
                drop(stage(&out, true).unwrap_or_else(|e| panic!("{replacing:?} {operations}: {e}")));
                match is_whole() {
                    Some(text) => assert!(text == b"new" || with_old && text == b"old"),
                    None => assert!(!with_old && fs::read_dir(&out).unwrap().count() == 0),
                }
                let entries = fs::read_dir(&out).unwrap().count();
                assert!([0, 2, 3].contains(&entries), "{replacing:?} {operations}: {entries}");
                assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "{replacing:?} {operations}");
                if killed.is_ok() {
                    break;
                }
            }
        }
    }

    #[test]
    fn a_run_that_lives_keeps_its_folder_and_a_dead_one_does_not() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let living = stage(&out, false).unwrap();
        living.whole().write("octree.bin", b"").unwrap();
        let mut dead = stage(&out, false).unwrap();
        dead.whole().write("octree.bin", b"").unwrap();
        dead.hidden.keep();
        let path = dead.hidden.path().to_path_buf();
        assert!(stage(&out, false).is_ok() && path.exists(), "both live");
        drop(dead);
        assert!(stage(&out, false).is_ok() && !path.exists() && living.hidden.path().exists());
    }

    #[test]
    fn two_runs_do_not_write_in_one_folder_entry_by_entry() {
        let dir = tempfile::tempdir().unwrap();
        let disk = || Arc::new(Poor(Replacing::EntryByEntry));
        let _living = StagedFolder::new(dir.path(), false, disk(), &Silent).unwrap();
        assert!(matches!(fault(StagedFolder::new(dir.path(), false, disk(), &Silent)), OutputFault::Busy(_)));
    }

    #[cfg(unix)]
    #[test]
    fn the_folder_keeps_its_mode() {
        use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
        for (replacing, metadata) in ALL_WAYS.into_iter().flat_map(|way| [(way, None), (way, Some(METADATA))]) {
            let dir = tempfile::tempdir().unwrap();
            let out = dir.path().join("out");
            fs::create_dir(&out).unwrap();
            if let Some(text) = metadata {
                fs::write(out.join("metadata.json"), text).unwrap();
            }
            fs::set_permissions(&out, fs::Permissions::from_mode(0o2710)).unwrap();
            let staged = StagedFolder::new(&out, true, Arc::new(Poor(replacing)), &Silent).unwrap();
            staged.whole().write("metadata.json", METADATA.as_bytes()).unwrap();
            staged.finish(&Silent).unwrap();
            assert_eq!(fs::metadata(&out).unwrap().mode() & 0o7777, 0o2710, "{replacing:?}");
        }
    }

    #[test]
    fn what_version_0_1_0_left_is_recovered_or_named() {
        let dir = tempfile::tempdir().unwrap();
        let (out, old) = (dir.path().join("out"), dir.path().join(".out.unfinished-abcdef-old"));
        fs::create_dir(&old).unwrap();
        fs::write(old.join("metadata.json"), METADATA).unwrap();
        let unknown = dir.path().join(".out.unfinished-ghijkl");
        fs::create_dir(&unknown).unwrap();
        fs::write(unknown.join("octree.bin"), "").unwrap();
        let mut staged = stage(&out, true).unwrap();
        staged.warnings.sort_by_key(Warning::kind);
        let warnings = staged.warnings.iter().map(Warning::kind).collect::<Vec<_>>();
        assert_eq!(warnings, ["leftover", "old_output_back"]);
        assert!(unknown.exists() && out.join("metadata.json").exists() && !old.exists());
    }

    #[test]
    fn what_of_the_old_output_cannot_be_removed_is_told_and_removed_by_the_next_run() {
        struct Stops;
        impl Events for Stops {
            fn stop_requested(&self) -> bool {
                true
            }
        }
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        for _ in 0..2 {
            let staged = stage(&out, true).unwrap();
            staged.whole().write("metadata.json", METADATA.as_bytes()).unwrap();
            let left = staged.finish(&Stops).unwrap();
            assert!(out.join("metadata.json").exists());
            if let Some(Warning::Leftover { path, .. }) = left {
                assert!(path.join("metadata.json").exists());
            }
        }
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2, "the old output is left over");
        drop(stage(&out, true).unwrap());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
