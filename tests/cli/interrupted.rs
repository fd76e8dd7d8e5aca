//! Runs that are ended from outside: the output is the old one or the new one, never half of either.
#![cfg(unix)]

use std::io::{BufRead as _, BufReader};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Stdio};

use nix::sys::signal::Signal;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::signals::send;
use crate::support::Dir;

/// A folder with a dataset `out` and a scan `big.las` whose conversion takes long enough to be met half-way.
fn stage() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(2000, 1).bytes());
    dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
    dir.write("big.las", &Las::terrain(1_500_000, 2).bytes());
    dir
}

/// Starts the conversion of `big.las` over `out`, waits until it builds, and sends `signal`.
fn interrupt(dir: &Dir, signal: Signal) -> (Child, Vec<String>) {
    let args = ["convert", "big.las", "-o", "out", "--overwrite", "--progress", "json", "--threads", "1"];
    let mut child = dir.command(args).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let mut seen: Vec<String> = lines.by_ref().take_while(|line| !line.contains("\"build\"")).collect();
    send(&child, signal);
    seen.extend(lines);
    (child, seen)
}

#[test]
fn ctrl_c_leaves_the_old_dataset_and_nothing_else() {
    let dir = stage();
    let before = dataset(&dir.path("out"));
    let (mut child, lines) = interrupt(&dir, Signal::SIGINT);
    assert_eq!(child.wait().unwrap().code(), Some(130), "{lines:?}");
    assert!(lines.last().unwrap().starts_with("pointmill: interrupted"), "{lines:?}");
    assert_eq!(dataset(&dir.path("out")), before);
    assert_eq!(dir.names(), ["a.las", "big.las", "out"]);
}

#[test]
fn a_killed_run_leaves_the_old_dataset_and_does_not_hinder_the_next() {
    let dir = stage();
    let before = dataset(&dir.path("out"));
    let (mut child, lines) = interrupt(&dir, Signal::SIGKILL);
    assert_eq!(child.wait().unwrap().signal(), Some(9), "{lines:?}");
    assert_eq!(dataset(&dir.path("out")), before);
    dir.succeed(["convert", "big.las", "-o", "out", "--overwrite", "-q"]);
    assert_eq!(dir.report("out")["outputs"][0]["points"], 1_500_000);
}
