//! Outputs that exist, that must not be touched, or that do not fit the disk: what was there stays as it was.

use std::fs;

use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::support::{Dir, Ended};

fn with_dataset() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(2000, 1).bytes());
    dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
    dir
}

#[test]
fn an_output_that_exists_is_left_alone_unless_overwriting() {
    let dir = with_dataset();
    let before = dataset(&dir.path("out"));
    dir.write("b.las", &Las::terrain(3000, 2).bytes());
    dir.run(["convert", "b.las", "-o", "out"]).failed_with(2, &["out", "--overwrite"]);
    assert_eq!(dataset(&dir.path("out")), before);
    dir.succeed(["convert", "b.las", "-o", "out", "--overwrite"]);
    dir.validate("out", &["b.las"]);
    assert_eq!(dir.names(), ["a.las", "b.las", "out"]);
}

#[test]
fn a_run_that_fails_leaves_the_old_dataset_as_it_was() {
    let dir = with_dataset();
    let before = dataset(&dir.path("out"));
    let whole = Las::terrain(3000, 2).bytes();
    dir.write("b.las", &whole[..whole.len() / 2]);
    dir.run(["convert", "b.las", "-o", "out", "--overwrite"]).failed_with(3, &["b.las"]);
    assert_eq!(dataset(&dir.path("out")), before);
    assert_eq!(dir.names(), ["a.las", "b.las", "out"]);
}

#[test]
fn overwriting_is_for_datasets_and_never_for_the_scans_themselves() {
    let dir = with_dataset();
    dir.write("home/letter.txt", b"dear");
    dir.run(["convert", "a.las", "-o", "home", "--overwrite"]).failed_with(2, &["home"]);
    dir.write("out/b.las", &Las::terrain(10, 1).bytes());
    dir.run(["convert", "out/b.las", "-o", "out", "--overwrite"]).failed_with(2, &["b.las"]);
    dir.run(["convert", "a.las", "-o", "a.las", "--overwrite"]).failed_with(2, &["a.las"]);
    assert_eq!(fs::read(dir.path("home/letter.txt")).unwrap(), b"dear");
    assert!(dir.path("out/b.las").exists() && dir.path("a.las").is_file());
}

#[test]
fn an_output_whose_parent_is_missing_or_a_file_is_no_panic() {
    let dir = with_dataset();
    let ended = dir.run(["convert", "a.las", "-o", "a.las/out"]);
    ended.failed_with(ended.code(), &["a.las"]);
    assert!([2, 5].contains(&ended.code()), "{}", ended.stderr());
}

/// A limit on file size stands for a full disk: it needs no rights and fails in the middle of a write just so.
#[cfg(unix)]
#[test]
fn a_full_disk_is_code_5_and_the_old_dataset_stays() {
    let dir = with_dataset();
    let before = dataset(&dir.path("out"));
    dir.write("b.las", &Las::terrain(60_000, 2).bytes());
    let program = env!("CARGO_BIN_EXE_pointmill");
    // 1,000 blocks of 512 bytes
    let script = "ulimit -f 1000; exec \"$0\" convert b.las -o out --overwrite";
    let output = std::process::Command::new("sh").args(["-c", script, program]).current_dir(dir.path("")).output();
    Ended(output.unwrap()).failed_with(5, &["arge"]); // "File too large"
    assert_eq!(dataset(&dir.path("out")), before);
    assert_eq!(dir.names(), ["a.las", "b.las", "out"]);
}

#[test]
fn a_memory_ceiling_that_is_too_small_is_code_6() {
    let dir = with_dataset();
    dir.run(["convert", "a.las", "-o", "out2", "--memory", "1MiB"]).failed_with(6, &["--memory"]);
    assert_eq!(dir.names(), ["a.las", "out"]);
}

#[test]
fn validation_finds_a_planted_fault() {
    let dir = with_dataset();
    let octree = dir.path("out/octree.bin");
    let mut bytes = fs::read(&octree).unwrap();
    bytes[2] ^= 0x40; // x of the first point
    fs::write(&octree, bytes).unwrap();
    dir.run(["validate", "out", "--against", "a.las"]).failed_with(7, &["out"]);
    let json = dir.run(["validate", "out", "--against", "a.las", "--json"]);
    assert_eq!(json.code(), 7);
    let outcome: serde_json::Value = serde_json::from_str(&json.stdout()).unwrap();
    assert_eq!(outcome["ok"], false);
}

#[test]
fn validation_of_nothing_is_a_mistake() {
    let dir = Dir::new();
    dir.run(["validate", "out"]).failed_with(2, &["out"]);
}
