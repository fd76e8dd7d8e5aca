//! The same points give the same bytes, whatever the machine and in whatever order they come.

use std::collections::BTreeMap;

use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::support::{Dir, OUTPUTS};

fn two_scans(points: usize) -> Dir {
    let dir = Dir::new();
    dir.write("scans/a.las", &Las::terrain(points, 1).bytes());
    let mut b = Las::terrain(points / 2, 2);
    b.offset[0] += 300.0;
    dir.write("scans/b.las", &b.bytes());
    dir
}

/// Converts with `options` and returns the bytes of the dataset.
fn bytes(dir: &Dir, options: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let args = ["convert", "-o", "out", "--overwrite", "-q", "--name", "same"];
    dir.succeed(args.iter().chain(options));
    dataset(&dir.path("out"))
}

#[test]
fn one_thread_or_four() {
    let dir = two_scans(60_000);
    let one = bytes(&dir, &["scans", "--threads", "1"]);
    assert_eq!(bytes(&dir, &["scans", "--threads", "4"]), one);
    assert_eq!(bytes(&dir, &["scans", "--threads", "4"]), one, "a second time");
}

#[test]
fn whatever_threads_folder_of_temporary_files_order_or_job_for_every_output() {
    let dir = two_scans(20_000);
    std::fs::create_dir(dir.path("temp")).unwrap();
    for output in OUTPUTS {
        let options = |more: &[&'static str]| [more, output].concat();
        let plain = bytes(&dir, &options(&["scans/a.las", "scans/b.las", "--threads", "1"]));
        let others: [&[&str]; 2] = [
            &["scans/b.las", "scans/a.las", "--threads", "4", "--temp-dir", "temp"],
            &["scans/b.las", "scans/a.las", "--threads", "2", "--temp-dir", "temp", "--checkpoint", "5000"],
        ];
        for other in others {
            assert!(bytes(&dir, &options(other)) == plain, "{output:?}, {other:?}");
        }
        assert_eq!(std::fs::read_dir(dir.path("temp")).unwrap().count(), 0);
    }
}

#[test]
fn in_memory_or_through_temporary_files() {
    let dir = two_scans(900_000);
    let ample = bytes(&dir, &["scans", "--memory", "4GiB"]);
    assert_eq!(dir.report("out")["temp_bytes"], 0);
    let scarce = bytes(&dir, &["scans", "--memory", "98MiB", "--threads", "1"]);
    assert!(dir.report("out")["temp_bytes"].as_u64().unwrap() > 0, "98 MiB hold 1,350,000 points?");
    assert!(ample == scarce, "the datasets differ");
    if let Some(peak) = dir.report("out")["peak_memory_bytes"].as_u64() {
        assert!(peak <= 98 << 20, "the resident set rose to {} MiB", peak >> 20);
    }
    dir.validate("out", &["scans"]);
}

#[test]
fn whatever_order_the_inputs_come_in() {
    let dir = two_scans(20_000);
    let forth = bytes(&dir, &["scans/a.las", "scans/b.las"]);
    assert_eq!(bytes(&dir, &["scans/b.las", "scans/a.las"]), forth);
    assert_eq!(bytes(&dir, &["scans/*.las", "scans/a.las"]), forth, "named twice, read once");
    dir.write("list", b"scans/b.las\nscans/a.las\n");
    assert_eq!(bytes(&dir, &["--files-from", "list"]), forth);
}

#[test]
fn whatever_a_header_says_of_the_bounds() {
    let dir = Dir::new();
    let honest = Las::terrain(150_000, 3).bytes();
    // largest and least of x, then of y and z
    let bounds = |file: &[u8]| -> Vec<f64> {
        file[179..227].as_chunks::<8>().0.iter().map(|v| f64::from_le_bytes(*v)).collect()
    };
    let [max_x, min_x, ..] = bounds(&honest)[..] else { panic!("no bounds") };
    let lies =
        [[max_x, min_x], [max_x + 0.01, min_x], [max_x + 40.0, min_x - 3.0], [min_x + 5.0, min_x + 4.9], [9e4, -8e4]];
    let formats = ["potree2", "bintree", "batches"];
    let mut first = None;
    for [max, min] in lies {
        let mut file = honest.clone();
        file[179..187].copy_from_slice(&max.to_le_bytes());
        file[187..195].copy_from_slice(&min.to_le_bytes());
        dir.write("a.las", &file);
        let to = formats.iter().flat_map(|format| ["--to", format]);
        let args = ["convert", "a.las", "-o", "out", "--overwrite", "--memory", "160MiB", "--threads", "2"];
        let ended = dir.succeed(args.into_iter().chain(to));
        assert!(!ended.stderr().contains("again"), "{}", ended.stderr());
        let all = formats.map(|format| dataset(&dir.path("out").join(format)));
        assert!(*first.get_or_insert(all.clone()) == all, "x from {min} to {max}");
    }
    dir.validate("out", &["a.las"]);
    let metadata: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.path("out/potree2/metadata.json")).unwrap()).unwrap();
    let cube = &metadata["boundingBox"];
    let [side, extent] = [cube["max"][0].as_f64().unwrap() - cube["min"][0].as_f64().unwrap(), max_x - min_x];
    assert!((1.0..1.01).contains(&(side / extent)), "a cube of {side} around {extent}");
}
