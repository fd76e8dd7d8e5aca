//! Quantised batches from the command line: the same bytes whatever the machine, and how they are described.

use std::fs;

use pointmill_testkit::las::Las;

use crate::support::Dir;

fn two_scans(points: usize) -> Dir {
    let dir = Dir::new();
    dir.write("scans/a.las", &Las::terrain(points, 1).bytes());
    let mut b = Las::terrain(points / 2, 2);
    b.offset[0] += 30.0;
    dir.write("scans/b.las", &b.bytes());
    dir
}

/// Converts with `options` and returns the bytes of the file.
fn bytes(dir: &Dir, options: &[&str]) -> Vec<u8> {
    let args = ["convert", "-o", "out", "--overwrite", "-q", "--name", "same", "--to", "batches"];
    dir.succeed(args.iter().chain(options));
    fs::read(dir.path("out/points.qbatch")).unwrap()
}

#[test]
fn one_thread_or_four_in_memory_or_through_temporary_files_in_any_order() {
    let dir = two_scans(900_000);
    let one = bytes(&dir, &["scans", "--threads", "1", "--memory", "4GiB"]);
    assert!(one.starts_with(b"QBATCHES"));
    for options in [
        &["scans", "--threads", "4"][..],
        &["scans/b.las", "scans/a.las", "--memory", "4GiB"],
        &["scans", "--memory", "98MiB", "--threads", "1"],
    ] {
        assert!(bytes(&dir, options) == one, "{options:?} changed the bytes");
    }
    assert!(dir.report("out")["temp_bytes"].as_u64().unwrap() > 0, "98 MiB hold 1,350,000 points?");
    if let Some(peak) = dir.report("out")["peak_memory_bytes"].as_u64() {
        assert!(peak <= 98 << 20, "the resident set rose to {} MiB", peak >> 20);
    }
}

#[test]
fn beside_an_octree_of_the_same_read() {
    let dir = two_scans(20_000);
    let alone = bytes(&dir, &["scans", "--attributes", "intensity,classification"]);
    let both =
        ["--to", "potree2", "--to", "batches", "--attributes", "intensity,classification", "--name", "same", "-q"];
    dir.succeed(["convert", "scans", "-o", "both"].iter().chain(&both));
    assert!(fs::read(dir.path("both/batches/points.qbatch")).unwrap() == alone, "another output changed the bytes");
    let report = dir.report("both");
    assert_eq!(
        report["outputs"][1]["attributes"],
        serde_json::json!(["position", "rgb", "intensity", "classification"])
    );
    assert_eq!(report["outputs"][1]["checksum"], report["outputs"][0]["checksum"]);
}

#[test]
fn the_report_has_levels_planes_errors_and_what_would_be_drawn() {
    let dir = two_scans(30_000);
    let file = bytes(&dir, &["scans", "--lod-cell", "auto"]);
    let report = dir.report("out");
    let details = &report["outputs"][0]["details"];
    let levels: Vec<u64> = details["lod_points"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
    assert_eq!(levels.iter().sum::<u64>(), 45_000);
    assert!(levels[0] > 100 && levels[0] < levels[1] && levels[1] < levels[2], "{levels:?}");
    assert_eq!(details["cell"], 4.0, "eight to ten points a square metre");
    assert_eq!((details["batches"].as_u64(), details["planes"].as_u64()), (Some(5), Some(20)));
    assert!(details["planes_dropped"].as_str().unwrap().contains("lo10"));
    let error = |bits: &str| details["errors"][bits]["max"][0].as_f64().unwrap();
    assert!(error("10") < 0.1 && error("20") < error("10") / 900.0);
    assert!(details["errors"]["30"].is_null(), "bits that are not in the file");
    let drawn = details["drawn"].as_array().unwrap();
    assert!(drawn.iter().all(|at| ["10", "20", "30"].iter().map(|b| at[*b].as_u64().unwrap()).sum::<u64>() == 5));
    assert_eq!(report["output_bytes"].as_u64(), Some(file.len() as u64));
    assert!(dir.path("out").read_dir().unwrap().count() == 2, "the file and the report");
}

#[test]
fn compressed_files_are_smaller_and_originals_can_be_left_out() {
    let dir = two_scans(30_000);
    let plain = bytes(&dir, &["scans"]).len();
    let compressed = bytes(&dir, &["scans", "--compress", "zstd:3"]).len();
    let without = bytes(&dir, &["scans", "--no-originals"]).len();
    assert!(compressed < plain && without < plain, "{plain} {compressed} {without}");
    dir.run(["convert", "scans", "-o", "no", "--to", "batches", "--lod-cell", "1e-9"]).failed_with(2, &["--lod-cell"]);
    assert!(!dir.path("no").exists());
}

#[test]
fn what_is_converted_validates_against_its_scans_whatever_planes_and_packing() {
    let dir = two_scans(30_000);
    for options in [&["scans"][..], &["scans", "--compress", "zstd"], &["scans", "--planes", "10"]] {
        bytes(&dir, options);
        dir.succeed(["validate", "out", "--against", "scans", "-q"]);
        dir.succeed(["validate", "out/points.qbatch", "-q"]);
    }
}
