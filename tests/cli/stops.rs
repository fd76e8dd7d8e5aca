//! Signals at any moment: the program ends within a second, and what was there is there.
#![cfg(unix)]

use std::fs;
use std::io::{Read as _, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use pointmill_testkit::Random;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::signals::{is_ignored_here, send, until_it_watches};
use crate::support::{Dir, Ended};

/// A second, and what a machine needs to notice it.
const AT_MOST: Duration = Duration::from_millis(1500);

/// Does what ends a run until that is in time: others may have had the machine, and late is what is late whenever it is tried.
fn in_time(mut ending: impl FnMut() -> Duration) {
    let took: Vec<Duration> = (0..4).map(|_| ending()).take_while(|took| *took >= AT_MOST).collect();
    assert!(took.len() < 4, "{took:?}");
}

const BROTLI: [&str; 4] = ["--encoding", "brotli", "--brotli-quality", "11"];

fn stage(points: usize) -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(2000, 1).bytes());
    dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
    dir.write("big.las", &Las::terrain(points, 2).bytes());
    dir
}

fn start(dir: &Dir, more: &[&str]) -> Child {
    let args = [&["convert", "big.las", "-o", "out", "--overwrite", "--threads", "2"], more].concat();
    dir.command(args).stderr(Stdio::piped()).spawn().unwrap()
}

/// The end of a session, or another signal where that is ignored, as below `nohup`.
fn hangup() -> Signal {
    if is_ignored_here(Signal::SIGHUP) { Signal::SIGTERM } else { Signal::SIGHUP }
}

/// Waits for the end; how long that took, and what was said.
fn end(mut child: Child) -> (Duration, Ended) {
    let sent = Instant::now();
    while child.try_wait().unwrap().is_none() && sent.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(5));
    }
    let took = sent.elapsed();
    let _ = child.kill(); // of a run that hangs
    (took, Ended(child.wait_with_output().unwrap()))
}

#[test]
fn a_signal_at_any_moment_ends_the_run_within_a_second() {
    let dir = stage(400_000);
    let before = dataset(&dir.path("out"));
    let mut random = Random::new(11);
    let kinds: [&[&str]; 5] = [
        &[],
        &["--verify=scans"],
        &BROTLI,
        &["--to", "bintree", "--capacity", "200"],
        &["--to", "batches", "--compress", "zstd:19", "--to", "potree2"],
    ];
    let mut stopped = 0;
    let mut stopped_run = |i: usize, wait| {
        let mut child = start(&dir, kinds[i % kinds.len()]);
        if i >= kinds.len() {
            until_it_watches(&mut child);
        }
        std::thread::sleep(wait);
        send(&child, [Signal::SIGINT, Signal::SIGTERM, hangup()][i % 3]);
        let (took, ended) = end(child);
        match ended.0.status.code() {
            // it was not there yet to watch for signals: the system ended it
            None if ended.0.status.signal() != Some(9) => ended,
            // the run was over before
            Some(0) => dir.succeed(["convert", "a.las", "-o", "out", "-q", "--overwrite"]),
            _ => {
                assert_eq!(ended.code(), 130, "{}", ended.stderr());
                assert!(ended.stderr().contains("interrupted"), "{}", ended.stderr());
                // beside what a run that was nearly over has to warn of, and that cleaning up takes long on a busy disk
                let said = ended.stderr();
                let is_more =
                    |line: &&str| line.starts_with("pointmill: warning: ") || line.contains("removing what was made");
                let lines = said.lines().filter(|line| !is_more(line));
                assert_eq!(lines.count(), 1, "{said}");
                stopped += 1;
                ended
            }
        };
        assert_eq!(dataset(&dir.path("out")), before, "run {i}");
        assert_eq!(dir.names(), ["a.las", "big.las", "out"], "run {i}");
        took
    };
    for i in 0..20 {
        let wait = Duration::from_millis(20 + random.below(700));
        in_time(|| stopped_run(i, wait));
    }
    assert!(stopped >= 3, "{stopped} of 20 runs were met"); // at least those that take long on any machine
}

#[test]
fn validation_ends_at_once() {
    let dir = stage(400_000);
    dir.succeed(["convert", "big.las", "-o", "out", "-q", "--overwrite"]);
    for wait in [30, 100, 200] {
        let args = ["validate", "out", "--against", "big.las"];
        in_time(|| {
            let mut child = dir.command(args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
            until_it_watches(&mut child);
            std::thread::sleep(Duration::from_millis(wait));
            send(&child, Signal::SIGTERM);
            let (took, ended) = end(child);
            assert!([0, 130].contains(&ended.code()), "{}", ended.stderr());
            took
        });
    }
}

/// Files that a run has made so far, in its hidden folder.
fn made_so_far(dir: &Dir) -> usize {
    let hidden = dir.names().into_iter().find(|name| name.contains(".unfinished-"));
    let entries = hidden.and_then(|name| fs::read_dir(dir.path(&name).join("new")).ok());
    entries.map_or(0, Iterator::count)
}

#[test]
fn a_second_signal_does_not_cut_the_cleaning_short() {
    let dir = stage(400_000);
    let mut stopped = 0;
    for pause in [0, 20, 150, 0, 20] {
        let mut child = start(&dir, &["--to", "bintree", "--layout", "files", "--capacity", "60"]);
        while made_so_far(&dir) < 200 && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        send(&child, Signal::SIGINT);
        std::thread::sleep(Duration::from_millis(pause));
        send(&child, Signal::SIGTERM);
        let (_, ended) = end(child);
        match ended.code() {
            // it was over before: the new output is there, and what the old one has left goes with the next run
            0 => dir.succeed(["convert", "a.las", "-o", "out", "-q", "--overwrite"]),
            code => {
                assert_eq!(code, 130, "{}", ended.stderr());
                stopped += 1;
                ended
            }
        };
        assert_eq!(dir.names(), ["a.las", "big.las", "out"]);
    }
    assert!(stopped > 0, "no run was met in its work");
}

/// Nobody reads what the program says, and all its threads wait for that.
#[test]
fn a_run_whose_threads_are_held_ends_within_a_second() {
    let dir = stage(400_000);
    let before = dataset(&dir.path("out"));
    let held_run = |room: usize| {
        let (mut reader, mut writer) = std::io::pipe().unwrap();
        writer.write_all(&vec![b'-'; (64 << 10) - room]).unwrap(); // Linux: a pipe holds 64 KiB
        let args = ["convert", "big.las", "-o", "out", "--overwrite", "--progress", "json"];
        let mut child = dir.command(args).stderr(writer).spawn().unwrap();
        until_it_watches(&mut child);
        std::thread::sleep(Duration::from_millis(800));
        send(&child, Signal::SIGINT);
        let (took, ended) = end(child);
        reader.read_to_end(&mut Vec::new()).unwrap();
        if cfg!(target_os = "linux") {
            assert_eq!(ended.code(), 130);
        }
        assert_eq!(dataset(&dir.path("out")), before);
        assert_eq!(dir.names(), ["a.las", "big.las", "out"]);
        if cfg!(target_os = "linux") { took } else { Duration::ZERO }
    };
    for room in [100, 300, 500] {
        in_time(|| held_run(room));
    }
}

#[test]
fn the_end_of_a_session_that_the_caller_ignores_stays_ignored() {
    let dir = stage(60_000);
    let script = "trap '' HUP; exec \"$0\" convert big.las -o out --overwrite -q";
    let mut sh = Command::new("sh");
    let mut child = sh.args(["-c", script, env!("CARGO_BIN_EXE_pointmill")]).current_dir(dir.path("")).spawn().unwrap();
    until_it_watches(&mut child);
    std::thread::sleep(Duration::from_millis(40));
    send(&child, Signal::SIGHUP);
    let (_, ended) = end(child);
    assert_eq!(ended.code(), 0);
    dir.validate("out", &["big.las"]);
}

#[test]
fn a_limit_on_the_size_of_files_is_an_error_and_no_death() {
    let dir = stage(60_000);
    let before = dataset(&dir.path("out"));
    for more in ["", "--to bintree --layout packed", "--to batches --compress zstd:1"] {
        let script = format!("ulimit -f 600; exec \"$0\" convert big.las -o out --overwrite {more}");
        let mut sh = Command::new("sh");
        sh.args(["-c", &script, env!("CARGO_BIN_EXE_pointmill")]).current_dir(dir.path(""));
        let ended = Ended(sh.output().unwrap());
        ended.failed_with(5, &["File too large", "limit"]);
        assert_eq!(ended.stderr().lines().count(), 1, "{}", ended.stderr());
        assert_eq!(dataset(&dir.path("out")), before);
        assert_eq!(dir.names(), ["a.las", "big.las", "out"]);
    }
}

#[test]
fn readers_that_leave_are_no_panic() {
    let dir = stage(10_000);
    for (command, code) in [
        ("info --json out a.las | head -1", 0),
        ("validate out --json | head -c 1", 0),
        ("convert big.las -o new -q --overwrite --json | head -c 1", 0),
        ("convert big.las -o new --overwrite --progress json 2>&1 | head -1", 0),
        ("convert nowhere -o new2 2>&1 | true", 2),
        ("--help | true", 0),
        ("convert --help | head -1", 0),
        ("convert --nonsense 2>&1 | true", 2),
    ] {
        let (run, pipe) = command.split_once('|').unwrap();
        let script = format!("{{ \"$0\" {run}; echo $? > code; }} | {pipe}");
        let script = script.replace("2>&1 ;", "2>&1;");
        let mut sh = Command::new("sh");
        sh.args(["-c", &script, env!("CARGO_BIN_EXE_pointmill")]).current_dir(dir.path(""));
        let ended = Ended(sh.output().unwrap());
        assert_eq!(ended.stderr(), "", "{command}");
        assert_eq!(fs::read_to_string(dir.path("code")).unwrap().trim(), code.to_string(), "{command}");
    }
    dir.validate("new", &["big.las"]);
}

/// One hundred kills, of runs that replace and of runs that make a new output. Takes a minute: `cargo test -- --ignored`.
#[test]
#[ignore = "takes a minute"]
fn a_hundred_kills_lose_nothing_and_leave_nothing_for_long() {
    let dir = stage(60_000);
    let mut random = Random::new(9);
    let (mut killed, mut leftovers, mut bytes) = (0, 0, 0);
    for i in 0..100 {
        let more: &[&str] = if i % 2 == 0 { &["-q"] } else { &["-q", "--to", "bintree", "--capacity", "100"] };
        let mut child = start(&dir, more);
        std::thread::sleep(Duration::from_micros(random.below(450_000)));
        child.kill().unwrap();
        killed += u32::from(child.wait().unwrap().signal() == Some(9));
        assert!(dir.path("out").exists(), "kill {i}: no output");
        dir.validate("out", &[]);
        let left: Vec<String> = dir.names().into_iter().filter(|name| name.starts_with('.')).collect();
        leftovers += u32::from(!left.is_empty());
        for name in left {
            bytes += walk(&dir.path(&name));
        }
        if i % 10 == 9 {
            dir.succeed(["convert", "a.las", "-o", "out", "-q", "--overwrite"]);
            assert_eq!(dir.names(), ["a.las", "big.las", "out"], "kill {i}");
        }
    }
    println!("{killed} of 100 runs were killed, {leftovers} left something, {bytes} bytes in all; nothing is left now");
    assert!(killed >= 50);
}

fn walk(folder: &std::path::Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|e| if e.path().is_dir() { walk(&e.path()) } else { e.metadata().map_or(0, |m| m.len()) }).sum()
}
