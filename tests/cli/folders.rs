//! Folders of scans as disks have them: closed folders, links that loop or end nowhere, pipes, odd names, and very many
//! files.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;
use std::time::{Duration, Instant};

use pointmill_testkit::las::Las;
use serde_json::Value;

use crate::support::Dir;

fn with_scan() -> Dir {
    let dir = Dir::new();
    dir.write("scans/a.las", &Las::terrain(100, 1).bytes());
    dir
}

fn warnings(dir: &Dir) -> Vec<String> {
    let report = dir.report("out");
    let list = report["warnings"].as_array().cloned().unwrap_or_default();
    let skipped = list.iter().filter(|w| w["kind"] == "input_skipped");
    skipped.filter_map(|w| w["text"].as_str().map(str::to_owned)).collect()
}

/// A link to itself cannot be looked into by anybody, not even root: it stands for all that the system refuses.
#[test]
fn what_cannot_be_looked_into_ends_the_run_by_name_or_is_skipped_and_listed() {
    let dir = with_scan();
    symlink("tiles", dir.path("scans/tiles")).unwrap();
    let ended = dir.run(["convert", "scans", "-o", "out"]);
    ended.failed_with(5, &["scans/tiles", "--unreadable skip"]);
    assert_eq!(ended.stderr().lines().count(), 1, "{}", ended.stderr());
    let ended = dir.succeed(["convert", "scans", "-o", "out", "--unreadable", "skip"]);
    assert!(ended.stderr().contains("scans/tiles"), "{}", ended.stderr());
    assert_eq!(dir.report("out")["outputs"][0]["points"], 100);
    let listed = warnings(&dir);
    assert!(listed.len() == 1 && listed[0].contains("scans/tiles: "), "{listed:?}");
    let ended = dir.run(["validate", "out", "--against", "scans"]);
    assert!(ended.code() == 0 && ended.stderr().contains("scans/tiles: not searched"), "{}", ended.stderr());
    let ended = dir.run(["info", "scans"]);
    ended.failed_with(5, &["scans/tiles"]);
    assert!(ended.stdout().contains("a.las"), "{}", ended.stdout());
}

#[test]
fn a_scan_behind_a_link_to_itself_follows_the_policy_for_inputs() {
    let dir = with_scan();
    symlink("b.las", dir.path("scans/b.las")).unwrap();
    symlink("gone", dir.path("scans/c.laz")).unwrap();
    for input in ["scans", "scans/*.la?"] {
        let ended = dir.run(["convert", input, "-o", "out", "--overwrite"]);
        ended.failed_with(5, &["scans/b.las"]);
        assert!(!ended.stderr().contains("os error"), "{}", ended.stderr());
        dir.succeed(["convert", input, "-o", "out", "--unreadable", "skip", "--overwrite"]);
        assert_eq!(warnings(&dir).len(), 2, "{input}");
    }
    dir.run(["convert", "scans/b.las", "scans/a.las", "-o", "out2"]).failed_with(5, &["scans/b.las"]);
    dir.succeed(["convert", "scans/b.las", "scans/a.las", "-o", "out2", "--unreadable", "skip"]);
}

#[test]
fn a_closed_folder_is_named_or_skipped() {
    use std::os::unix::fs::PermissionsExt as _;
    let dir = with_scan();
    dir.write("scans/closed/b.las", &Las::terrain(100, 2).bytes());
    let set = |mode: u32| fs::set_permissions(dir.path("scans/closed"), fs::Permissions::from_mode(mode)).unwrap();
    set(0);
    if fs::read_dir(dir.path("scans/closed")).is_ok() {
        eprintln!("skipped: everything is open to this user");
    } else {
        dir.run(["convert", "scans", "-o", "out"]).failed_with(5, &["scans/closed", "--unreadable skip"]);
        dir.succeed(["convert", "scans", "-o", "out", "--unreadable", "skip"]);
        assert_eq!(warnings(&dir).len(), 1);
    }
    set(0o755);
}

#[test]
fn links_to_folders_are_followed_and_those_back_are_not_followed_again() {
    let dir = with_scan();
    dir.write("elsewhere/b.las", &Las::terrain(50, 2).bytes());
    symlink("../elsewhere", dir.path("scans/more")).unwrap();
    symlink("..", dir.path("scans/up")).unwrap();
    symlink(".", dir.path("scans/here")).unwrap();
    let ended = dir.succeed(["convert", "scans", "-o", "out"]);
    assert_eq!(dir.report("out")["outputs"][0]["points"], 150, "each scan once");
    assert!(ended.stderr().contains("scans/here"), "{}", ended.stderr());
    dir.validate("out", &["scans", "elsewhere"]);
}

#[test]
fn pipes_sockets_and_devices_are_never_opened() {
    let dir = with_scan();
    let made = std::process::Command::new("mkfifo").args([dir.path("scans/b.las"), dir.path("scans/pipe")]).status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("skipped: no mkfifo here");
        return;
    }
    let _socket = std::os::unix::net::UnixListener::bind(dir.path("scans/c.las")).unwrap();
    symlink("/dev/zero", dir.path("scans/d.las")).unwrap();
    symlink("b.las", dir.path("scans/e.las")).unwrap();
    let began = Instant::now();
    dir.succeed(["convert", "scans", "-o", "out", "-q"]);
    dir.succeed(["info", "scans"]);
    assert_eq!(dir.report("out")["other_files"]["count"], 5);
    for name in ["scans/b.las", "scans/c.las", "scans/d.las", "scans/e.las"] {
        for command in [&["convert", name, "-o", "out2"][..], &["info", name], &["extract", name, "-o", "ex"]] {
            dir.run(command).failed_with(4, &[name, "not a file that can be read"]);
        }
    }
    dir.run(["convert", "scans/a.las", "-o", "out2", "--transform", "scans/b.las"]).failed_with(2, &["--transform"]);
    dir.run(["validate", "scans/b.las"]).failed_with(2, &["scans/b.las"]);
    assert!(began.elapsed() < Duration::from_secs(60), "it waited for a pipe");
}

#[test]
fn odd_names_are_read_and_named_safely() {
    use std::os::unix::ffi::OsStrExt as _;
    let dir = with_scan();
    let names: [&[u8]; 5] = [b"b\xff.las", b"c\nd.las", b"\x1b[2Je.las", b" f .las", b"-g.las"];
    for name in names {
        fs::copy(dir.path("scans/a.las"), dir.path("scans").join(std::ffi::OsStr::from_bytes(name))).unwrap();
    }
    let ended = dir.succeed(["convert", "scans", "-o", "out", "-v"]);
    assert_eq!(dir.report("out")["outputs"][0]["points"], 600);
    assert!(!ended.stderr().contains(['\u{1b}', '\r']), "{}", ended.stderr());
    assert!(ended.stderr().lines().all(|line| line.starts_with("pointmill: ")), "{}", ended.stderr());
    let ended = dir.succeed(["info", "scans"]);
    assert!(!ended.stdout().contains('\u{1b}'), "{}", ended.stdout());
    let json: Value = serde_json::from_str(&dir.succeed(["info", "scans", "--json"]).stdout()).unwrap();
    assert_eq!(json.as_array().unwrap().len(), 6);
}

/// None of the files stays open, and the time for each does not grow. (`POINTMILL_FILES=50000` for the large run.)
#[test]
fn very_many_files_are_found_with_few_open_at_a_time() {
    let files: usize = std::env::var("POINTMILL_FILES").ok().and_then(|n| n.parse().ok()).unwrap_or(2000);
    let dir = Dir::new();
    let scan = Las::terrain(1, 1).bytes();
    let names: Vec<String> = (0..files).map(|i| format!("scans/{:02}/{i:05}.las", i % 64)).collect();
    names.iter().for_each(|name| drop(dir.write(name, &scan)));
    let began = Instant::now();
    let script = "ulimit -n 64; exec \"$0\" info --json scans";
    let mut sh = std::process::Command::new("sh");
    let output = sh.args(["-c", script, env!("CARGO_BIN_EXE_pointmill")]).current_dir(dir.path("")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let objects: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let mut seen: Vec<&str> = objects.iter().map(|object| object["path"].as_str().unwrap()).collect();
    seen.sort_unstable();
    assert_eq!(seen.len(), names.len());
    assert!(seen.windows(2).all(|pair| pair[0] < pair[1]), "each once");
    let seconds = began.elapsed().as_secs_f64();
    eprintln!("{files} files in {seconds:.1} s");
    assert!(seconds < 30.0 + files as f64 / 100.0, "{seconds:.1} s");
}
