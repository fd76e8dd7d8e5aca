//! Runs that are ended and gone on with. Every operation of the disk is tried in `crates/converter/tests/resume.rs`; here the whole
//! process is killed.
#![cfg(unix)]

use std::os::unix::process::ExitStatusExt as _;
use std::process::{Command, Stdio};
use std::time::Duration;

use pointmill_testkit::Random;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::support::{Dir, Ended};

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
    let mut random = Random::new(5);
    let (mut killed, mut saved) = (0, 0);
    for round in 0..3 {
        for _ in 0..8 {
            let mut child = dir.command(CONVERT).arg("--resume").stderr(Stdio::null()).spawn().unwrap();
            std::thread::sleep(Duration::from_micros(20_000 + random.below(400_000)));
            child.kill().unwrap();
            killed += u32::from(child.wait().unwrap().signal() == Some(9));
            if dir.path("out").exists() {
                std::fs::remove_dir_all(dir.path("out")).unwrap();
            }
        }
        dir.succeed(CONVERT.into_iter().chain(["--resume"]));
        saved += dir.report("out")["recalled_points"].as_u64().unwrap_or(0);
        assert!(dataset(&dir.path("out")) == expected, "round {round}");
        assert_eq!(dir.names(), ["out", "plain", "scans"], "round {round}");
        std::fs::remove_dir_all(dir.path("out")).unwrap();
    }
    assert!(killed >= 6 && saved > 0, "{killed} runs were killed, {saved} points were not read again");
}

#[test]
fn an_interrupted_run_says_what_is_safe_and_a_changed_one_is_refused() {
    let dir = stage();
    let mut random = Random::new(6);
    let said = (0..40).find_map(|_| {
        let child = dir.command(CONVERT).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(Duration::from_micros(20_000 + random.below(400_000)));
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        let ended = Ended(child.wait_with_output().unwrap());
        if dir.path("out").exists() {
            std::fs::remove_dir_all(dir.path("out")).unwrap();
        }
        (ended.0.status.code() == Some(130) && dir.path("out.job").exists()).then_some(ended)
    });
    let said = said.expect("a run that was met while it read").stderr();
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
