//! C#: the one file, its examples, and a program that walks datasets, compiled and run by Mono where it is there.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use pointmill_testkit::files::{entries, fixture};

use crate::compiler::{has, libraries};
use crate::{compare, text};

/// The compiled program; `None` without Mono.
fn program() -> Option<PathBuf> {
    static PROGRAM: OnceLock<Option<PathBuf>> = OnceLock::new();
    PROGRAM.get_or_init(compile).clone()
}

fn compile() -> Option<PathBuf> {
    if cfg!(not(unix)) || !has("mcs") || !has("mono") {
        return None;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bindings/csharp");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pointmill-test.exe");
    let mut mcs = Command::new("mcs");
    // the latest that this compiler has and Unity 2018 reads
    mcs.args(["-langversion:7.2", "-warnaserror", "-r:System.dll"]).arg(format!("-out:{}", program.display()));
    mcs.arg(root.join("Pointmill.cs")).args(entries(&root.join("examples"))).arg(root.join("tests/Program.cs"));
    text(&mcs.output().unwrap());
    Some(program)
}

fn run(program: &Path) -> Command {
    let mut command = Command::new("mono");
    command.env("LD_LIBRARY_PATH", libraries()).arg(program);
    command
}

#[test]
fn a_csharp_program_reads_what_the_rust_crates_read() {
    let Some(program) = program() else { return };
    compare(|| {
        let mut command = run(&program);
        command.arg("walk");
        command
    });
}

#[test]
fn the_examples_load_what_there_is() {
    let Some(program) = program() else { return };
    let paths = ["potree2/default", "batches/example.qbatch", "batches/blocks.qbatch", "bintree/packed"].map(fixture);
    let found = text(&run(&program).arg("examples").args(paths).output().unwrap());
    let expected = [
        // two clouds of 7 nodes and 13 points, a node with each update
        "set 14 26 26 14 26",
        // a budget of 0 and a cache of one point
        "set 0 0",
        // batches, points, words of the records, words of two sections, their sum, batches in sight
        "batches 1 6 8 12 2375442826 1",
        "batches 1 6 8 12 2375442826 1",
        // 8 leaves of 17 points: all beyond the switch distance, then all before it
        "materials 8 8 17 0 0",
        "materials 8 0 0 8 17",
        "pick 1",
    ];
    assert_eq!(found.lines().collect::<Vec<_>>(), expected);
}

#[test]
fn mistakes_are_exceptions() {
    let Some(program) = program() else { return };
    let paths = ["potree2/default", "las/format7.laz"].map(fixture);
    let found = text(&run(&program).arg("mistakes").args(paths).output().unwrap());
    let valid = format!("valid 1 [] {}", env!("CARGO_PKG_VERSION"));
    let expected = [
        "foreign Unsupported ",
        "missing Io ",
        "node Argument ",
        "decode Argument ",
        "small Buffer ",
        "null Buffer ",
        "window Argument ",
        "section Unsupported ",
        "closed disposed",
        "freed disposed",
        &valid,
    ];
    assert_eq!(found.lines().collect::<Vec<_>>(), expected);
}
