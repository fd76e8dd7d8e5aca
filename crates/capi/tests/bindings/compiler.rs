//! The C compiler of the machine, where there is one.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

/// How the library gets into the program.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Linked {
    Dynamically,
    Statically,
}

/// True if the machine has that program; says so if not.
pub(crate) fn has(program: &str) -> bool {
    let is_there = Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success());
    if !is_there {
        eprintln!("skipped: there is no {program}");
    }
    is_there
}

/// Where cargo puts the library beside this test.
pub(crate) fn libraries() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().to_path_buf()
}

/// The compiled program `tests/c/NAME.c`; `None` without a compiler.
pub(crate) fn compile(name: &str, linked: Linked) -> Option<PathBuf> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c").join(name).with_extension("c");
    compile_file(&source, name, linked)
}

/// The program `name`, compiled from `source`.
pub(crate) fn compile_file(source: &Path, name: &str, linked: Linked) -> Option<PathBuf> {
    static ONE: Mutex<()> = Mutex::new(());
    let _one_at_a_time = ONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if cfg!(not(unix)) || !has("cc") {
        return None;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let suffix = if linked == Linked::Statically { "static" } else { "dynamic" };
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{suffix}"));
    if is_newer(&program, &[source.to_path_buf(), libraries().join("libpointmill.a")]) {
        return Some(program);
    }
    let mut cc = Command::new("cc");
    cc.args(["-std=c11", "-O1", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-pthread", "-I"])
        .arg(root.join("include"))
        .arg(source)
        .arg("-o")
        .arg(&program);
    match linked {
        Linked::Statically => cc.arg(libraries().join("libpointmill.a")).args(["-ldl", "-lm"]),
        Linked::Dynamically => {
            let path = format!("-Wl,-rpath,{}", libraries().display());
            cc.arg("-L").arg(libraries()).args(["-lpointmill", &path])
        }
    };
    let output = cc.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(program)
}

/// True if `made` is there and younger than all of `from`.
fn is_newer(made: &Path, from: &[PathBuf]) -> bool {
    let time = |path: &Path| path.metadata().and_then(|m| m.modified()).ok();
    let header = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/pointmill.h");
    time(made).is_some_and(|made| from.iter().chain([&header]).all(|path| time(path).is_some_and(|time| time < made)))
}
