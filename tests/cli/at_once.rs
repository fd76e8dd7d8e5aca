//! Two runs to one output, and folders that vanish: what happens to a run while it is stopped.
#![cfg(unix)]

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::process::{Child, ChildStderr, Output, Stdio};

use nix::sys::signal::Signal;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::signals::send;
use crate::support::{Dir, Ended};

fn stage() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(2000, 1).bytes());
    for seed in 1..=4 {
        dir.write(&format!("scans/{seed}.las"), &Las::terrain(60_000, seed).bytes());
    }
    dir
}

/// A run that is stopped.
pub(crate) struct Stopped {
    child: Child,
    stderr: BufReader<ChildStderr>,
    said: String,
}

impl Stopped {
    /// Converts `scans`, and stops the run when it says that it begins to `phase`.
    pub(crate) fn new(dir: &Dir, more: &[&str], phase: &str) -> Self {
        let args = [&["convert", "scans", "-o", "out", "--progress", "json", "--threads", "1"], more].concat();
        let mut child = dir.command(args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let mut said = String::new();
        while !said.contains(&format!("{phase:?}")) {
            assert!(stderr.read_line(&mut said).unwrap() > 0, "{said}");
        }
        send(&child, Signal::SIGSTOP);
        Self { child, stderr, said }
    }

    /// Is interrupted as Ctrl-C does it.
    pub(crate) fn interrupt(self) -> Ended {
        send(&self.child, Signal::SIGINT);
        self.end()
    }

    /// Is killed.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Goes on to the end.
    pub(crate) fn end(mut self) -> Ended {
        send(&self.child, Signal::SIGCONT);
        std::io::Read::read_to_string(&mut self.stderr, &mut self.said).unwrap();
        let status = self.child.wait().unwrap();
        Ended(Output { status, stdout: Vec::new(), stderr: self.said.into_bytes() })
    }
}

#[test]
fn of_two_runs_that_make_one_new_output_the_later_one_says_so() {
    let dir = stage();
    let first = Stopped::new(&dir, &[], "build");
    dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
    let made = dataset(&dir.path("out"));
    first.end().failed_with(2, &["out", "exists", "--overwrite"]);
    assert!(dataset(&dir.path("out")) == made);
    assert_eq!(dir.names(), ["a.las", "out", "scans"]);
}

#[test]
fn of_two_runs_that_replace_one_output_the_later_one_is_what_stays() {
    let dir = stage();
    dir.succeed(["convert", "scans", "-o", "plain", "-q"]);
    dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
    let first = Stopped::new(&dir, &["--overwrite"], "build");
    dir.succeed(["convert", "a.las", "-o", "out", "-q", "--overwrite"]);
    assert_eq!(first.end().code(), 0);
    assert!(dataset(&dir.path("out")) == dataset(&dir.path("plain")));
    assert_eq!(dir.names(), ["a.las", "out", "plain", "scans"]);
}

#[test]
fn a_run_with_a_job_keeps_others_out_of_it() {
    let dir = stage();
    let job = ["--checkpoint", "50000"];
    let first = Stopped::new(&dir, &job, "build");
    for more in [&[][..], &["--resume"]] {
        let args = [&["convert", "scans", "-o", "out"], &job[..], more].concat();
        dir.run(args).failed_with(2, &["out.job", "another run"]);
    }
    assert_eq!(first.end().code(), 0);
    dir.validate("out", &["scans"]);
    assert_eq!(dir.names(), ["a.las", "out", "scans"]);
}

/// Files that are open stay until the run ends; what it would make in the folder it cannot make.
#[test]
fn a_temporary_folder_that_vanishes_costs_the_run_at_most() {
    let dir = stage();
    dir.succeed(["convert", "scans", "-o", "plain", "-q"]);
    for (phase, more) in
        [("read", &["--checkpoint", "50000"][..]), ("build", &["--checkpoint", "50000"]), ("read", &[])]
    {
        dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
        let before = dataset(&dir.path("out"));
        fs::create_dir(dir.path("temp")).unwrap();
        let run = Stopped::new(&dir, &[more, &["--overwrite", "--temp-dir", "temp"]].concat(), phase);
        fs::remove_dir_all(dir.path("temp")).unwrap();
        let ended = run.end();
        match ended.0.status.code() {
            Some(0) => assert!(dataset(&dir.path("out")) == dataset(&dir.path("plain")), "{phase} {more:?}"),
            _ => {
                ended.failed_with(5, &["temp"]);
                assert!(dataset(&dir.path("out")) == before, "{phase} {more:?}");
            }
        }
        assert_eq!(dir.names(), ["a.las", "out", "plain", "scans"], "{phase} {more:?}");
        fs::remove_dir_all(dir.path("out")).unwrap();
    }
}
