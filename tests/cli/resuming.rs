//! Runs that are ended and gone on with. Every operation of the disk is tried in `crates/converter/tests/resume.rs`; here the whole
//! process is killed.
#![cfg(unix)]

use std::process::Stdio;
use std::time::{Duration, Instant};

use pointmill_testkit::Random;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::at_once::Stopped;
use crate::signals::wait_until;
use crate::support::Dir;

const CONVERT: [&str; 7] = ["convert", "scans", "-o", "out", "--checkpoint", "50000", "-q"];

fn stage() -> Dir {
    let dir = Dir::new();
    for seed in 1..=6 {
        dir.write(&format!("scans/{seed}.las"), &Las::terrain(60_000, seed).bytes());
    }
    dir.succeed(["convert", "scans", "-o", "plain", "-q"]);
    dir
}

#[test]
fn runs_that_are_killed_again_and_again_end_in_the_same_bytes() {
    let dir = stage();
    let expected = dataset(&dir.path("plain"));
    let begun = Instant::now();
    dir.succeed(CONVERT);
    let took = begun.elapsed().as_micros() as u64;
    std::fs::remove_dir_all(dir.path("out")).unwrap();
    let mut random = Random::new(5);
    for round in 0..3 {
        for _ in 0..8 {
            let mut child = dir.command(CONVERT).arg("--resume").stderr(Stdio::null()).spawn().unwrap();
            std::thread::sleep(Duration::from_micros(random.below(took)));
            child.kill().unwrap();
            child.wait().unwrap();
            if dir.path("out").exists() {
                std::fs::remove_dir_all(dir.path("out")).unwrap();
            }
        }
        // whatever these have left, one more ends with all points read
        Stopped::new(&dir, &["--checkpoint", "50000", "--resume"], "build").kill();
        dir.succeed(CONVERT.into_iter().chain(["--resume"]));
        assert_eq!(dir.report("out")["recalled_points"], 360_000, "round {round}");
        assert!(dataset(&dir.path("out")) == expected, "round {round}");
        assert_eq!(dir.names(), ["out", "plain", "scans"], "round {round}");
        std::fs::remove_dir_all(dir.path("out")).unwrap();
    }
}

/// Some of the points are safe, and the rest is read: the first segments of a run that is killed as soon as there are any.
#[test]
fn a_run_that_is_killed_while_it_reads_has_its_finished_units() {
    let dir = stage();
    let mut saved = 0;
    for _ in 0..20 {
        let mut child = dir.command(CONVERT).args(["--threads", "1"]).stderr(Stdio::null()).spawn().unwrap();
        let journal = dir.path("out.job/journal");
        let size = || std::fs::metadata(&journal).map_or(0, |file| file.len());
        // it grows with its magic, with the plan, and with each unit
        let mut sizes = vec![0];
        wait_until("a unit is done", || {
            let now = size();
            if sizes.last() != Some(&now) {
                sizes.push(now);
            }
            sizes.len() > 3 || child.try_wait().unwrap().is_some()
        });
        child.kill().unwrap();
        child.wait().unwrap();
        if dir.path("out").exists() {
            std::fs::remove_dir_all(dir.path("out")).unwrap();
            continue;
        }
        dir.succeed(CONVERT.into_iter().chain(["--resume"]));
        saved = dir.report("out")["recalled_points"].as_u64().unwrap_or(0);
        assert!(dataset(&dir.path("out")) == dataset(&dir.path("plain")));
        std::fs::remove_dir_all(dir.path("out")).unwrap();
        if 0 < saved && saved < 360_000 {
            return;
        }
    }
    panic!("no run was met while it read; the last had saved {saved} points");
}

#[test]
fn an_interrupted_run_says_what_is_safe_and_a_changed_one_is_refused() {
    let dir = stage();
    let ended = Stopped::new(&dir, &["--checkpoint", "50000"], "build").interrupt();
    assert_eq!((ended.code(), dir.path("out.job").exists()), (130, true), "{}", ended.stderr());
    let said = ended.stderr();
    assert!(said.contains("interrupted; what was read is safe in ") && said.contains("--resume"), "{said}");
    let more =
        |more: &[&'static str]| CONVERT.into_iter().chain(["--resume"]).chain(more.iter().copied()).collect::<Vec<_>>();
    dir.run(more(&["--every", "2"])).failed_with(2, &["every", "leave out --resume"]);
    dir.write("scans/3.las", &Las::terrain(60_000, 9).bytes());
    dir.run(more(&[])).failed_with(2, &["3.las", "changed since", "leave out --resume"]);
    assert!(dir.path("out.job").exists());
    dir.succeed(CONVERT);
    assert_eq!(dir.names(), ["out", "plain", "scans"]);
}

/// Points that do not fit into what the options below allow.
fn large() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(2000, 1).bytes());
    for seed in 2..=3 {
        dir.write(&format!("scans/{seed}.las"), &Las::terrain(700_000, seed).bytes());
    }
    dir
}

const SCARCE: [&str; 3] = ["--memory", "98MiB", "--overwrite"];

#[test]
fn a_run_that_spills_can_be_gone_on_with_unasked() {
    let dir = large();
    Stopped::new(&dir, &SCARCE, "build").kill();
    assert!(dir.path("out.job").exists());
    let on = ["convert", "scans", "-o", "out", "-q", "--threads", "1", "--resume"];
    dir.succeed(on.iter().chain(&SCARCE));
    assert_eq!(dir.report("out")["recalled_points"].as_u64(), Some(1_400_000));
    assert_eq!(dir.names(), ["a.las", "out", "scans"]);
    dir.validate("out", &["scans"]);
    Stopped::new(&dir, &[&SCARCE[..], &["--checkpoint", "never"]].concat(), "build").kill();
    assert!(!dir.path("out.job").exists());
}

#[test]
fn what_a_run_has_left_goes_with_any_later_run_to_that_output_which_says_so() {
    let dir = large();
    let convert = |input, more: &[&'static str]| [&["convert", input, "-o", "out", "--threads", "1"], more].concat();
    for (input, more) in
        [("a.las", &["--overwrite"][..]), ("a.las", &["--overwrite", "--checkpoint", "never"]), ("scans", &SCARCE)]
    {
        Stopped::new(&dir, &SCARCE, "build").kill();
        assert!(dir.path("out.job").exists());
        let said = dir.succeed(convert(input, more)).stderr();
        assert!(said.contains("out.job: removed; a run that was ended had left it"), "{said}");
        assert_eq!(dir.names(), ["a.las", "out", "scans"]);
        let said = dir.succeed(convert("a.las", &["--overwrite"])).stderr();
        assert!(!said.contains("removed"), "{said}");
    }
    // one whose run lives is that run's
    let first = Stopped::new(&dir, &SCARCE, "build");
    let said = dir.succeed(convert("a.las", &["--overwrite"])).stderr();
    assert!(!said.contains("removed"), "{said}");
    assert_eq!(first.end().code(), 0);
    dir.validate("out", &["scans"]);
    assert_eq!(dir.names(), ["a.las", "out", "scans"]);
}

#[test]
fn a_job_that_nobody_has_asked_for_costs_no_run() {
    let dir = large();
    dir.write("out.job/mine.txt", b"of mine");
    let args = [&["convert", "scans", "-o", "out", "--threads", "1"], &SCARCE[..]].concat();
    let said = dir.succeed(&args).stderr();
    assert!(said.contains("no run can go on where this one ends") && said.contains("out.job"), "{said}");
    dir.run([&args[..], &["--checkpoint", "always"]].concat()).failed_with(2, &["out.job"]);
    dir.succeed(["convert", "a.las", "-o", "out", "--overwrite", "-q"]);
    assert_eq!(std::fs::read(dir.path("out.job/mine.txt")).unwrap(), b"of mine");
    assert_eq!(dir.names(), ["a.las", "out", "out.job", "scans"]);
}

#[test]
fn what_ends_any_such_run_in_the_same_way_leaves_no_job() {
    let dir = large();
    let mut las = Las::terrain(700_000, 4);
    las.points.iter_mut().for_each(|point| point.rgb = [0; 3]);
    dir.write("scans/2.las", &las.bytes());
    las.points.last_mut().unwrap().rgb = [256; 3];
    dir.write("scans/3.las", &las.bytes());
    let only = ["--threads", "1", "--checkpoint", "100000", "--rgb-depth", "8"];
    let args = [&["convert", "scans", "-o", "out"], &only[..], &SCARCE].concat();
    let said = dir.run(args);
    said.failed_with(3, &["3.las", "255"]);
    assert!(!said.stderr().contains("--resume"), "{}", said.stderr());
    assert_eq!(dir.names(), ["a.las", "scans"]);
}
