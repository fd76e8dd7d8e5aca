//! Very many scans.

use std::fs;
use std::process::Command;

use pointmill_testkit::las::{Las, Point};

use crate::support::{Dir, Ended};

/// Scans of one point each in the folder `name`, all within a few metres.
fn scans(dir: &Dir, name: &str, count: usize) {
    for i in 0..count {
        let place = [i as i32 % 100, i as i32 / 100 % 100, i as i32 % 7];
        dir.write(&format!("{name}/{i:05}.las"), &Las::new(vec![Point::numbered(i, place)]).bytes());
    }
}

#[cfg(unix)]
#[test]
fn more_scans_than_files_may_be_open_convert_to_the_same_bytes() {
    let dir = Dir::new();
    scans(&dir, "in", 200);
    let under_limit = |limit: u32, out: &str, threads: &str| {
        let program = env!("CARGO_BIN_EXE_pointmill");
        let line = format!("ulimit -n {limit} && exec '{program}' convert in -o {out} --threads {threads}");
        Ended(Command::new("sh").args(["-c", &line]).current_dir(dir.path("")).output().unwrap())
    };
    for (limit, out, threads) in [(64, "few", "2"), (64, "threads", "8"), (1024, "usual", "2")] {
        let ended = under_limit(limit, out, threads);
        assert_eq!(ended.code(), 0, "{out}: {}", ended.stderr());
        assert_eq!(dir.report(out)["points"]["kept"], 200);
    }
    let octree = |out: &str| fs::read(dir.path(out).join("octree.bin")).unwrap();
    assert!(octree("few") == octree("usual") && octree("threads") == octree("usual"));
    dir.validate("few", &["in"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_scan_of_one_point_takes_less_than_a_kibibyte_of_memory() {
    const FEW: usize = 500;
    const MANY: usize = 5_000;
    let dir = Dir::new();
    scans(&dir, "few", FEW);
    scans(&dir, "many", MANY);
    let peak = |name: &str, out: &str| {
        dir.succeed(["convert", name, "-o", out, "--threads", "2", "--memory", "512MiB"]);
        dir.report(out)["peak_memory_bytes"].as_u64().unwrap()
    };
    let (few, many) = (peak("few", "a"), peak("many", "b"));
    let each = many.saturating_sub(few) / (MANY - FEW) as u64;
    assert!(each < 1024, "{each} bytes for each input: {few} of {FEW}, {many} of {MANY}");
}
