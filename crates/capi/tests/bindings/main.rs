//! Programs in C and C# that call the built library: what they read is what the Rust crates say, mistakes end in errors, and
//! valgrind finds neither errors nor leaks. C is compiled against the committed header.

mod compiler;
mod csharp;
mod dataset;
mod expected;
mod surfels;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use pointmill_testkit::files::{fixture, fixture_bytes};

use compiler::{Linked, compile, compile_file, has};
use expected::expected;

/// A dataset of every kind, and forms of them.
const DATASETS: [&str; 12] = [
    "potree2/default",
    "potree2/brotli",
    "potree1/words",
    "potree1/objects",
    "potree1/flat",
    "copc/format8.copc.laz",
    "copc/pages.copc.laz",
    "bintree/files",
    "bintree/packed",
    "batches/example.qbatch",
    "batches/blocks.qbatch",
    "batches/far.qbatch",
];

fn text(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}{}", output.status, text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

/// The words of a line are the same, as numbers where they are numbers.
fn is_same(found: &str, expected: &str) -> bool {
    let same = |(a, b): (&str, &str)| a == b || a.parse::<f64>().is_ok_and(|a| b.parse() == Ok(a));
    let (found, expected) = (found.split(' '), expected.split(' '));
    found.clone().count() == expected.clone().count() && found.zip(expected).all(same)
}

/// Runs a program that walks a dataset, PATH and AXES behind its arguments, on all of them: it prints what is expected.
fn compare(program: impl Fn() -> Command) {
    for (i, name) in DATASETS.iter().enumerate() {
        // one form of axes each, all of two
        for axes in (0..3u32).filter(|axes| i % 6 == 0 || *axes as usize == i % 3) {
            let path = fixture(name);
            let found = text(&program().arg(&path).arg(axes.to_string()).output().unwrap());
            let expected = expected(&path, axes);
            let found: Vec<&str> = found.lines().collect();
            for (found, expected) in found.iter().zip(&expected) {
                assert!(is_same(found, expected), "{name}, axes {axes}\nfound    {found}\nexpected {expected}");
            }
            assert_eq!(found.len(), expected.len(), "{name}, axes {axes}");
        }
    }
}

#[test]
fn a_c_program_reads_what_the_rust_crates_read() {
    let Some(walk) = compile("walk", Linked::Dynamically) else { return };
    compare(|| Command::new(&walk));
}

#[test]
fn the_example_of_the_documents_runs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("../../docs/embedding.md")).unwrap();
    let code = page.split("```c\n").nth(1).unwrap().split("```").next().unwrap();
    let source = Path::new(env!("CARGO_TARGET_TMPDIR")).join("example.c");
    std::fs::write(&source, code).unwrap();
    let Some(example) = compile_file(&source, "example", Linked::Dynamically) else { return };
    let found = text(&Command::new(&example).arg(fixture("potree2/default")).output().unwrap());
    let points = found.lines().filter_map(|line| line.strip_prefix("node ")?.split(' ').nth(1)?.parse::<u64>().ok());
    assert!(found.starts_with("Potree 2.0, ") && points.sum::<u64>() > 0, "{found}");
    assert!(!Command::new(&example).arg("there/is/nothing").output().unwrap().status.success());
}

/// Programs may take the whole library in.
#[test]
fn the_static_library_does_the_same() {
    let (Some(one), Some(other)) = (compile("walk", Linked::Statically), compile("walk", Linked::Dynamically)) else {
        return;
    };
    let run = |walk: PathBuf| text(&Command::new(walk).arg(fixture("potree2/brotli")).arg("2").output().unwrap());
    assert_eq!(run(one), run(other));
}

#[test]
fn the_header_is_one_of_cpp_too() {
    if !has("c++") {
        return;
    }
    let header = concat!(env!("CARGO_MANIFEST_DIR"), "/include/pointmill.h");
    let args = ["-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++", header];
    text(&Command::new("c++").args(args).output().unwrap());
}

/// A dataset whose points end early.
fn broken() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["metadata.json", "hierarchy.bin", "octree.bin"] {
        let mut bytes = fixture_bytes(&format!("potree2/default/{name}"));
        if name == "octree.bin" {
            bytes.truncate(bytes.len() / 2);
        }
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

fn misuse(command: &mut Command) -> String {
    let broken = broken();
    let paths = [fixture("potree2/default"), fixture("las/format7.laz"), broken.path().to_path_buf()];
    text(&command.args(paths).output().unwrap())
}

#[test]
fn mistakes_end_in_errors_and_threads_share_a_handle() {
    let Some(program) = compile("misuse", Linked::Dynamically) else { return };
    assert_eq!(misuse(&mut Command::new(program)), "");
}

#[test]
fn valgrind_finds_neither_errors_nor_leaks() {
    let programs = (compile("walk", Linked::Dynamically), compile("misuse", Linked::Dynamically));
    let (Some(walk), Some(program)) = programs else { return };
    if !has("valgrind") {
        return;
    }
    let valgrind = || {
        let mut command = Command::new("valgrind");
        command.args(["-q", "--error-exitcode=99", "--leak-check=full", "--errors-for-leak-kinds=definite,indirect"]);
        command
    };
    for name in ["potree2/brotli", "copc/format8.copc.laz", "bintree/packed", "batches/blocks.qbatch"] {
        text(&valgrind().arg(&walk).arg(fixture(name)).arg("1").output().unwrap());
    }
    misuse(valgrind().arg(&program));
}
