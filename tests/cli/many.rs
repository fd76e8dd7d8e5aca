//! Very many scans.

use std::fs;
use std::process::Command;

use pointmill_testkit::las::{Las, Point};

use crate::support::{Dir, Ended};

/// Scans of one point each in the folder `name`, all within a few metres.
fn scans(dir: &Dir, name: &str, count: usize) {
    for i in 0..count {
        dir.write(&format!("{name}/{i:05}.las"), &Las::new(vec![point(i)]).bytes());
    }
}

fn point(i: usize) -> Point {
    Point::numbered(i, [i as i32 % 100, i as i32 / 100 % 100, i as i32 % 7])
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
fn a_scan_of_one_point_takes_at_most_a_kibibyte_of_memory() {
    const MANY: usize = 20_000;
    let dir = Dir::new();
    scans(&dir, "many", MANY);
    // the same points in one file
    dir.write("one.las", &Las::new((0..MANY).map(point).collect()).bytes());
    // one thread: the scans that several have in hand vary, and so do the arenas of the allocator
    let peak = |name: &str, out: &str| {
        dir.succeed(["convert", name, "-o", out, "--threads", "1", "--memory", "512MiB"]);
        dir.report(out)["peak_memory_bytes"].as_u64().unwrap()
    };
    // what the allocator keeps varies by 2 % from run to run, and is not of the scans
    let least = |name: &str| ["a", "b", "c"].map(|out| peak(name, &format!("{name}-{out}"))).into_iter().min().unwrap();
    let (many, one) = (least("many"), least("one.las"));
    let each = many.saturating_sub(one) / MANY as u64;
    assert!(each <= 1024, "{each} bytes per input: {one} in one file, {many} in {MANY}");
}
