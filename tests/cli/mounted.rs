//! Outputs on mounted folders, full disks and disks that cannot be written: with mounts of our own, which take the rights
//! of root; without them the tests say that they are skipped.
#![cfg(target_os = "linux")]

use std::process::Command;

use pointmill_testkit::las::Las;

use crate::support::{Dir, Ended};

fn with_scans() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(2000, 1).bytes());
    dir.write("b.las", &Las::terrain(30_000, 2).bytes());
    for name in ["out", "store"] {
        std::fs::create_dir(dir.path(name)).unwrap();
    }
    dir
}

/// Runs a script in its own space of mounts; `$0` is the program. `None`: no rights.
fn mounted(dir: &Dir, script: &str) -> Option<Ended> {
    let can = Command::new("unshare").args(["-m", "mount", "-t", "tmpfs", "none", "/mnt"]).output();
    if !can.is_ok_and(|c| c.status.success()) {
        eprintln!("skipped: no rights to mount");
        return None;
    }
    let mut unshare = Command::new("unshare");
    unshare.args(["-m", "sh", "-c", script, env!("CARGO_BIN_EXE_pointmill")]).current_dir(dir.path(""));
    Some(Ended(unshare.output().unwrap()))
}

#[test]
fn an_output_that_is_a_mount_point_is_made_and_replaced() {
    let dir = with_scans();
    for (mount, then) in [("mount --bind store out", ""), ("mount -t tmpfs none out", "cp -a out/. store;")] {
        let script = format!(
            "set -e; {mount}; \"$0\" convert a.las -o out -q; \"$0\" validate out --against a.las -q
             \"$0\" convert b.las -o out -q --overwrite; \"$0\" validate out --against b.las -q
             \"$0\" convert a.las -o out -q --overwrite --to batches --to bintree; \"$0\" validate out --against a.las -q
             touch out/mine; \"$0\" convert b.las -o out --overwrite && exit 1; rm out/mine
             \"$0\" convert b.las -o out -q --overwrite; ls -A out; {then}"
        );
        let Some(ended) = mounted(&dir, &script) else { return };
        assert_eq!(ended.code(), 0, "{}", ended.stderr());
        assert_eq!(ended.stdout(), "hierarchy.bin\nmetadata.json\noctree.bin\nreport.json\n", "{mount}");
        dir.validate("store", &["b.las"]);
        assert_eq!(std::fs::read_dir(dir.path("out")).unwrap().count(), 0, "nothing below the mount");
    }
    assert_eq!(dir.names(), ["a.las", "b.las", "out", "store"]);
}

#[test]
fn a_disk_that_cannot_be_written_is_an_error_before_the_work() {
    let dir = with_scans();
    let script = "mount -t tmpfs -o ro none store; \"$0\" convert a.las -o store/out --progress json";
    let Some(ended) = mounted(&dir, script) else { return };
    ended.failed_with(5, &["store/out", "ead-only"]);
    assert!(!ended.stderr().contains("\"read\""), "{}", ended.stderr());
}

#[test]
fn a_full_disk_is_answered_with_advice_for_that_disk() {
    let dir = with_scans();
    let script =
        "mount -t tmpfs -o size=300k none store; \"$0\" convert b.las -o store/out; code=$?; ls -A store; exit $code";
    let Some(ended) = mounted(&dir, script) else { return };
    ended.failed_with(5, &["store/out/octree.bin", "output on another disk"]);
    assert!(!ended.stderr().contains("--temp-dir"), "{}", ended.stderr());
    assert_eq!(ended.stdout(), "", "nothing is left on the disk");

    // no report rather than one of no bytes, and the output is there
    let script = "mount -t tmpfs -o size=4k none store; head -c 4000 /dev/zero > store/full
                  \"$0\" convert a.las -o new --report store/run.json; code=$?; ls -A store; exit $code";
    let ended = mounted(&dir, script).unwrap();
    ended.failed_with(5, &["run.json", "new is complete"]);
    assert_eq!(ended.stdout(), "full\n");
    dir.validate("new", &["a.las"]);
}

/// Converts `b.las` over the dataset `old` on a disk with these limits; checks that it is the old or the new one, and alone.
/// `None`: no rights. Else true if there was enough.
fn is_enough(dir: &Dir, limits: &str, output: &str) -> Option<bool> {
    let script = format!(
        "mount -t tmpfs -o {limits} none store && cp -a old store/out || exit 99
         \"$0\" convert b.las -o store/out --overwrite {output}; code=$?; ls -A store
         if [ $code = 0 ]; then diff -rq -x report.json new store/out; else diff -rq old store/out; fi || exit 98; exit $code"
    );
    let ended = mounted(dir, &script)?;
    let is_enough = ended.code() == 0;
    if !is_enough {
        ended.failed_with(5, &["store/out", "No space left"]);
    }
    assert_eq!(ended.stdout(), "out\n", "{limits} {output}");
    Some(is_enough)
}

/// An old dataset, and the new one as a disk with enough room has it; how many inodes both take.
fn old_and_new(dir: &Dir, output: &str) -> usize {
    let convert = |scan, out| ["convert", scan, "-o", out, "-q", "--overwrite"].into_iter().chain(output.split(' '));
    dir.succeed(convert("a.las", "old"));
    dir.succeed(convert("b.las", "new"));
    let count = |name: &str| walkdir::WalkDir::new(dir.path(name)).into_iter().count();
    count("old") + count("new")
}

const ON_SMALL_DISKS: [&str; 3] =
    ["--to potree2", "--to bintree --capacity 3000", "--to potree2 --to batches --to copc"];

#[test]
fn a_disk_that_is_full_in_any_phase_keeps_the_old_dataset() {
    let dir = with_scans();
    for output in ON_SMALL_DISKS {
        old_and_new(&dir, output);
        let (mut low, mut high) = (500, 10_000); // KiB
        while high - low > 4 {
            let middle = (low + high) / 8 * 4;
            let Some(is_enough) = is_enough(&dir, &format!("size={middle}k"), output) else { return };
            (low, high) = if is_enough { (low, middle) } else { (middle, high) };
        }
        // just below what is enough, the files that are written last do not fit
        assert!((2..8).all(|pages| is_enough(&dir, &format!("size={}k", high - 4 * pages), output) == Some(false)));
    }
}

#[test]
fn a_disk_without_inodes_keeps_the_old_dataset() {
    let dir = with_scans();
    for output in ON_SMALL_DISKS {
        let most = old_and_new(&dir, output) + 10;
        let have = walkdir::WalkDir::new(dir.path("old")).into_iter().count() + 1;
        let mut short = 0;
        for inodes in have..most {
            match is_enough(&dir, &format!("size=100m,nr_inodes={inodes}"), output) {
                None => return,
                Some(true) => break,
                Some(false) => short += 1,
            }
        }
        assert!(short >= 5 && have + short < most, "{output}: {short}");
    }
}

#[test]
fn a_temporary_folder_that_cannot_be_written_is_an_error_before_the_work() {
    let dir = with_scans();
    let script = "mount -t tmpfs -o ro none store
                  \"$0\" convert a.las -o new --temp-dir store --checkpoint always --progress json";
    let Some(ended) = mounted(&dir, script) else { return };
    ended.failed_with(5, &["store", "ead-only"]);
    assert!(!ended.stderr().contains("\"read\"") && !dir.path("new").exists(), "{}", ended.stderr());
}

/// The folder of the output was made for a user who may write nothing beside it.
#[test]
fn an_output_in_a_folder_of_others_is_made_and_replaced() {
    use std::os::unix::fs::{PermissionsExt as _, chown};
    use std::os::unix::process::CommandExt as _;
    const USER: u32 = 12_345;
    let dir = with_scans();
    std::fs::set_permissions(dir.path(""), std::fs::Permissions::from_mode(0o755)).unwrap();
    if chown(dir.path("out"), Some(USER), Some(USER)).is_err() {
        eprintln!("skipped: no rights to give folders away");
        return;
    }
    for scan in ["a.las", "b.las", "a.las"] {
        let mut command = dir.command(["convert", scan, "-o", "out", "--overwrite", "-q"]);
        let Ok(output) = command.uid(USER).gid(USER).output() else {
            eprintln!("skipped: that user cannot start the program");
            return;
        };
        assert_eq!(Ended(output).stderr(), "");
        dir.validate("out", &[scan]);
    }
    assert_eq!(std::fs::read_dir(dir.path("out")).unwrap().count(), 4);
}
