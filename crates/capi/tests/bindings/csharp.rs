//! C#: the one file, its examples, and a program that walks datasets, compiled and run by Mono where it is there.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use pointmill_testkit::files::{entries, fixture};

use crate::compiler::{has, libraries};
use crate::surfels::write_surfels;
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

/// The weight of point 1, levels at 0, 300 and 1001 of cells of 1, and the example of the format page.
const CLOD: &str = "clod 0.40834903717041016 4 2 0 1 0";

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
        CLOD,
        "kept 4 1 0",
        "batches 1 6 8 12 2375442826 1",
        CLOD,
        "kept 4 1 0",
        "batches 1 6 8 12 2375442826 1",
        // 8 leaves of 17 points: all beyond the switch distance, then all before it
        "materials 8 8 17 0 0",
        "materials 8 0 0 8 17",
        "pick 1",
    ];
    assert_eq!(found.lines().collect::<Vec<_>>(), expected);
}

/// A node with more points than a mesh has vertices, and attributes beside colours.
#[test]
fn normals_and_radii_become_vertices_in_windows() {
    let Some(program) = program() else { return };
    let folder = tempfile::tempdir().unwrap();
    write_surfels(folder.path(), 130_001);
    let run = |axes: &str| text(&run(&program).arg("surfels").arg(folder.path()).arg(axes).output().unwrap());
    // point i is at (i % 1000, i / 1000, 5) mm, its normal (0, 0.6, 0.8) at twice the length, its radius i / 1024
    let radius = |i: u32| f64::from(i) / 1024.0;
    let expected = |turned: fn([f64; 3]) -> [f64; 3]| {
        let buffer = |count: u32, last: u32| {
            let [x, y, z] = turned([f64::from(last % 1000) / 1000.0, f64::from(last / 1000) / 1000.0, 0.005]);
            let [a, b, c] = turned([0.0, 0.6, 0.8]).map(|v| f64::from(v as f32));
            let (r, [red, green]) = (radius(last), [last % 256, last / 256 % 256]);
            format!("buffer {count} {x} {y} {z} {a} {b} {c} {r} {red} {green} 7 255 32")
        };
        let lines = [buffer(65_000, 64_999), buffer(65_000, 129_999), buffer(1, 130_000)];
        [&["surfels 130001 1 1 3".to_owned()][..], &lines].concat()
    };
    let same = |found: &str, expected: &[String]| {
        assert_eq!(found.lines().count(), expected.len(), "{found}");
        for (found, expected) in found.lines().zip(expected) {
            assert!(crate::is_same(found, expected), "{found}\n{expected}");
        }
    };
    same(&run("0"), &expected(|p| p));
    same(&run("1"), &expected(|[x, y, z]| [x, z, -y]));
    same(&run("2"), &expected(|[x, y, z]| [x, z, y]));
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
