//! Kills at random moments, of runs to every output. `crates/bench/reliability.py` does the same with more points, less memory and
//! every combination.
#![cfg(unix)]

use std::fs;
use std::os::unix::process::ExitStatusExt as _;
use std::process::Stdio;
use std::time::{Duration, Instant};

use pointmill_testkit::Random;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::signals::wait_until;
use crate::support::{Dir, OUTPUTS};

const JOB: [&str; 2] = ["--checkpoint", "10000"];

#[test]
fn a_killed_run_to_any_output_leaves_the_old_dataset_or_the_new_one_and_the_next_run_clears_up() {
    let dir = Dir::new();
    dir.write("old.las", &Las::terrain(2000, 1).bytes());
    for seed in 1..=4 {
        dir.write(&format!("scans/{seed}.las"), &Las::terrain(10_000, seed).bytes());
    }
    let mut random = Random::new(21);
    let (mut killed, mut left) = (0, 0);
    for (i, output) in OUTPUTS.iter().enumerate() {
        let convert = |scans, out| [&["convert", scans, "-o", out, "-q", "--name", "same"], *output].concat();
        dir.succeed(convert("old.las", "old"));
        let start = Instant::now();
        dir.succeed(convert("scans", "plain"));
        let took = start.elapsed().as_micros() as u64;
        let (old, new) = (dataset(&dir.path("old")), dataset(&dir.path("plain")));
        for kill in 0..3 {
            let job: &[&str] = if (i + kill) % 2 == 0 { &JOB } else { &[] };
            let is_over = kill != 1;
            if is_over {
                dir.succeed([&convert("old.las", "out")[..], &["--overwrite"]].concat());
            }
            let args = [&convert("scans", "out")[..], job, &["--overwrite"]].concat();
            let mut child = dir.command(&args).stderr(Stdio::null()).spawn().unwrap();
            if kill == 0 {
                // as soon as it has made something
                wait_until("it works", || dir.names().len() > 5 || child.try_wait().unwrap().is_some());
            } else {
                std::thread::sleep(Duration::from_micros(random.below(took)));
            }
            child.kill().unwrap();
            killed += u32::from(child.wait().unwrap().signal() == Some(9));
            match dir.path("out").exists() {
                true => {
                    let found = dataset(&dir.path("out"));
                    assert!(is_over && found == old || found == new, "{output:?}, kill {kill}: half a dataset");
                }
                false => assert!(!is_over, "{output:?}, kill {kill}: the old dataset is gone"),
            }
            left += usize::from(dir.names().len() > 5);
            let resume: &[&str] = if job.is_empty() { &[] } else { &["--resume"] };
            dir.succeed([&args[..], resume].concat());
            assert!(dataset(&dir.path("out")) == new, "{output:?}, kill {kill}: other bytes");
            assert_eq!(dir.names(), ["old", "old.las", "out", "plain", "scans"], "{output:?}, kill {kill}");
            fs::remove_dir_all(dir.path("out")).unwrap();
        }
        for folder in ["old", "plain"] {
            fs::remove_dir_all(dir.path(folder)).unwrap();
        }
    }
    assert!(killed >= 8 && left >= 4, "{killed} runs were killed, {left} left something");
}
