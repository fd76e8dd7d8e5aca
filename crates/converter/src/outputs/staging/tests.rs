//! Outputs that appear, replace, fail half-way and are killed.

use std::fs;
use std::io;

use super::*;
use crate::error::OutputFault;
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
        for overwrite in [false, true] {
            assert!(
                matches!(fault(stage(overwrite)), OutputFault::NotADataset(_)),
                "no word of replacing what is not ours"
            );
        }
        fs::write(out.join("metadata.json"), "{\"hierarchy\": {}}").unwrap();
        assert!(matches!(fault(stage(true)), OutputFault::NotADataset(_)), "metadata of something else");
        fs::write(out.join("metadata.json"), METADATA).unwrap();
        assert_eq!(fault(stage(true)), OutputFault::Foreign { output: out.clone(), file: out.join("letter.txt") });
        fs::remove_file(out.join("letter.txt")).unwrap();
        fs::write(out.join("hierarchy.bin"), "old").unwrap();
        assert!(matches!(fault(stage(false)), OutputFault::Exists(_)));
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
    let left = leftovers::clear(staged.hidden, &Silent);
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

/// A dataset that looks complete may have a file beside it that is not, as a report that is being written.
#[test]
fn a_run_that_is_killed_before_it_replaces_leaves_nothing_whatever_it_has_begun() {
    for file in ["report.json", "notes.txt", "data/r/x"] {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let mut dead = stage(&out, false).unwrap();
        dead.whole().write("metadata.json", METADATA.as_bytes()).unwrap();
        fs::create_dir_all(dead.path_of_new().join(file).parent().unwrap()).unwrap();
        dead.whole().write(file, b"{").unwrap();
        dead.hidden.keep();
        drop(dead);
        assert_eq!(stage(&out, false).unwrap().warnings, []);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "{file}");
    }
}

/// What was judged to be ours and is half removed does not look like ours any more.
#[test]
fn what_a_run_that_is_killed_has_left_of_the_old_output_goes_with_the_next() {
    struct Stops(std::sync::atomic::AtomicUsize);
    impl Events for Stops {
        fn stop_requested(&self) -> bool {
            self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed) >= 2
        }
    }
    for replacing in ALL_WAYS {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let stage = || StagedFolder::new(&out, true, Arc::new(Poor(replacing)), &Silent).unwrap();
        for _ in 0..2 {
            let staged = stage();
            assert_eq!(staged.warnings, [], "{replacing:?}");
            for name in ["hierarchy.bin", "metadata.json", "octree.bin"] {
                staged.whole().write(name, METADATA.as_bytes()).unwrap();
            }
            let left = staged.finish(&Stops(0.into())).unwrap();
            assert_eq!(
                left.is_some(),
                out.read_dir().unwrap().count() > 3 || dir.path().read_dir().unwrap().count() > 1
            );
        }
        drop(stage());
        assert_eq!(dir.path().read_dir().unwrap().count(), 1, "{replacing:?}");
        assert_eq!(out.read_dir().unwrap().count(), 3, "{replacing:?}");
    }
}

/// The old output cannot be put back, since something else is at its place by now.
#[test]
fn an_old_output_that_cannot_be_put_back_stays_for_the_next_run() {
    #[derive(Debug)]
    struct Disturbed(PathBuf, std::sync::atomic::AtomicUsize);

    impl Disk for Disturbed {
        fn permit(&self, operation: DiskOperation) -> io::Result<()> {
            let renames = usize::from(operation == DiskOperation::Rename);
            if renames > 0 && self.1.fetch_add(renames, std::sync::atomic::Ordering::Relaxed) == 1 {
                fs::create_dir(&self.0)?;
                fs::write(self.0.join("theirs"), "")?;
            }
            Ok(())
        }

        fn replacing(&self) -> Replacing {
            Replacing::InTwoSteps
        }
    }

    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("metadata.json"), METADATA).unwrap();
    fs::write(out.join("octree.bin"), "old").unwrap();
    let mut staged = StagedFolder::new(&out, true, Arc::new(Poor(Replacing::InTwoSteps)), &Silent).unwrap();
    staged.whole().write("metadata.json", METADATA.as_bytes()).unwrap();
    staged.disk = Arc::new(Disturbed(out.clone(), 0.into()));
    let hidden = staged.path().to_path_buf();
    assert!(staged.finish(&Silent).is_err());
    assert_eq!(fs::read(hidden.join("old/octree.bin")).unwrap(), b"old");
    assert!(out.join("theirs").exists() && stage(&out, true).is_err(), "it says so as long as that is there");
    fs::remove_dir_all(&out).unwrap();
    let next = stage(&out, true).unwrap();
    assert_eq!(next.warnings, [Warning::OldOutputBack { output: out.clone() }]);
    assert_eq!(fs::read(out.join("octree.bin")).unwrap(), b"old");
    drop(next);
    assert_eq!(dir.path().read_dir().unwrap().count(), 1);
}

#[test]
fn a_run_that_is_killed_when_it_has_undone_the_moves_of_another_hinders_nobody() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("metadata.json"), METADATA).unwrap();
    fs::write(out.join("octree.bin"), "old").unwrap();
    let poor = || StagedFolder::new(&out, true, Arc::new(Poor(Replacing::EntryByEntry)), &Silent);
    let dead = poor().unwrap();
    dead.whole().write("metadata.json", METADATA.as_bytes()).unwrap();
    let path = dead.path().to_path_buf();
    dead.hidden.will_hold_old(&SystemDisk).unwrap();
    fs::write(path.join("moving"), "metadata.json\nall of them\n").unwrap();
    fs::create_dir(path.join("old")).unwrap();
    fs::rename(out.join("metadata.json"), path.join("old/metadata.json")).unwrap();
    drop(dead);
    let found = HiddenFolder::find(&out, hidden::Side::Inside);
    let [hidden::Found::Dead(second)] = &found[..] else { panic!("{found:?}") };
    assert!(replace::undo(second, &out, replace::When::Unfinished).unwrap());
    drop(found); // killed before it has cleared up: the folder stays
    assert!(path.exists() && out.join("metadata.json").exists());
    drop(poor().unwrap());
    assert!(!path.exists());
    assert_eq!(fs::read(out.join("octree.bin")).unwrap(), b"old");
}

#[test]
fn what_comes_into_the_old_output_while_it_is_removed_is_kept_and_named() {
    struct Writes(PathBuf);
    impl Events for Writes {
        fn stop_requested(&self) -> bool {
            let _ = fs::write(self.0.join("new/letter.txt"), "dear");
            false
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("metadata.json"), METADATA).unwrap();
    let mut staged = stage(&out, true).unwrap();
    staged.whole().write("metadata.json", METADATA.as_bytes()).unwrap();
    let replace = Replace { hidden: &mut staged.hidden, output: &staged.place.path, disk: &SystemDisk };
    replace.whole(Replacing::AtOnce).unwrap();
    let hidden = staged.path().to_path_buf();
    let left = leftovers::clear(staged.hidden, &Writes(hidden.clone()));
    for left in [left, stage(&out, true).unwrap().warnings.pop()] {
        assert!(matches!(&left, Some(Warning::Leftover { path, .. }) if path.starts_with(&hidden)), "{left:?}");
        assert_eq!(fs::read(hidden.join("new/letter.txt")).unwrap(), b"dear");
    }
}

/// As a power failure can leave it on some file systems.
#[test]
fn a_folder_whose_lock_says_nothing_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let mut dead = stage(&out, false).unwrap();
    let path = dead.path().to_path_buf();
    dead.hidden.keep();
    drop(dead);
    fs::write(path.join("lock"), "").unwrap();
    let warnings = stage(&out, false).unwrap().warnings;
    assert!(matches!(&warnings[..], [Warning::Leftover { path: left, .. }] if *left == path), "{warnings:?}");
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
