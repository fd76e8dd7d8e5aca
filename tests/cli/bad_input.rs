//! Inputs that lie, break off, or are none at all: a clear line, the right exit code, nothing half-written.

use std::fs;

use pointmill_testkit::files::corpus;
use pointmill_testkit::las::{Las, Point};

use crate::support::Dir;

#[test]
fn an_empty_file_called_a_scan_is_broken() {
    let dir = Dir::new();
    dir.write("a.las", b"");
    dir.run(["convert", "a.las", "-o", "out"]).failed_with(3, &["a.las"]);
    assert_eq!(dir.names(), ["a.las"]);
}

#[test]
fn a_scan_that_was_cut_short_fails_or_is_accounted_for() {
    let dir = Dir::new();
    let whole = Las::terrain(1000, 1).bytes();
    dir.write("a.las", &whole[..227 + 34 * 600 + 11]);
    let ended = dir.run(["convert", "a.las", "-o", "out"]);
    ended.failed_with(3, &["a.las"]);
    assert_eq!(dir.names(), ["a.las"]);

    dir.succeed(["convert", "a.las", "-o", "out", "--unreadable", "skip"]);
    let report = dir.report("out");
    assert_eq!((&report["outputs"][0]["points"], &report["points"]["unreadable"]), (&600.into(), &400.into()));
    dir.write("header.las", &whole[..100]);
    dir.run(["convert", "header.las", "-o", "out2"]).failed_with(3, &["header.las"]);
}

#[test]
fn a_folder_without_scans_says_what_is_there_instead() {
    let dir = Dir::new();
    fs::create_dir(dir.path("scans")).unwrap();
    dir.run(["convert", "scans", "-o", "out"]).failed_with(3, &["scans", "no scan"]);
    dir.write("scans/readme.txt", b"hello");
    dir.run(["convert", "scans", "-o", "out"]).failed_with(3, &["scans", "readme.txt"]);
    assert_eq!(dir.names(), ["scans"]);
}

#[test]
fn an_archive_that_was_named_says_what_it_is_and_one_in_a_folder_is_skipped() {
    let dir = Dir::new();
    fs::create_dir(dir.path("scans")).unwrap();
    dir.write("scans/a.ply.gz", b"\x1f\x8b\x08\x08\0\0\0\0\0\x03a.ply\0");
    dir.write("scans/b.xyz", b"1 2 3\n4 5 6\n");
    dir.run(["convert", "scans/a.ply.gz", "-o", "out"]).failed_with(4, &["a.ply.gz", "a gzip file", "unpack it"]);
    dir.succeed(["convert", "scans", "-o", "out"]);
    assert_eq!(dir.report("out")["outputs"][0]["points"], 2);
}

#[test]
fn a_file_that_was_named_and_is_no_scan_is_not_supported() {
    let dir = Dir::new();
    dir.write("notes.txt", b"hello");
    let supported = ["notes.txt", "LAS, LAZ", "E57", "PLY", "PCD", "XYZ"];
    dir.run(["convert", "notes.txt", "-o", "out"]).failed_with(4, &supported);
    dir.run(["info", "notes.txt"]).failed_with(4, &supported);
    dir.write("cube.ply", b"ply\nformat ascii 1.0\n");
    dir.run(["convert", "cube.ply", "-o", "out"]).failed_with(3, &["cube.ply", "end_header", "byte 21"]);
}

#[test]
fn files_that_a_folder_brings_along_are_skipped_and_reported() {
    let dir = Dir::new();
    dir.write("scans/a.las", &Las::terrain(100, 1).bytes());
    dir.write("scans/readme.txt", b"hello");
    let ended = dir.succeed(["convert", "scans", "-o", "out"]);
    assert!(ended.stderr().contains("1 other file skipped, not scans (scans/readme.txt)"), "{}", ended.stderr());
}

#[test]
fn a_header_count_of_two_to_the_63_is_not_believed() {
    let dir = Dir::new();
    let points = (0..7).map(|i| Point::at([37 * i; 3])).collect();
    let las = Las { point_format: 6, points_declared: Some(1 << 63), ..Las::new(points) };
    dir.write("a.las", &las.bytes());
    let ended = dir.run(["convert", "a.las", "-o", "out"]);
    assert!([0, 3].contains(&ended.code()), "{}", ended.stderr());
    dir.succeed(["convert", "a.las", "-o", "out", "--overwrite", "--unreadable", "skip"]);
    assert_eq!(dir.report("out")["outputs"][0]["points"], 7);
}

#[test]
fn a_scan_without_points_has_nothing_to_convert() {
    let dir = Dir::new();
    dir.write("a.las", &Las::new(Vec::new()).bytes());
    dir.run(["convert", "a.las", "-o", "out"]).failed_with(3, &[]);
    assert_eq!(dir.names(), ["a.las"]);
}

#[test]
fn odd_shapes_are_scans_like_any_other() {
    let one = vec![[7, 8, 9]];
    let equal = vec![[-5, 5, 0]; 25_000]; // more than a leaf holds
    let flat = Las::terrain(25_000, 1).points.iter().map(|p| [p.xyz[0], p.xyz[1], 3]).collect();
    let pillar = (0..25_000).map(|i| [0, 0, i]).collect();
    let far = vec![[i32::MIN, i32::MIN, i32::MIN], [i32::MAX, i32::MAX, i32::MAX], [0, 0, 0]];
    for (name, points) in [("one", one), ("equal", equal), ("flat", flat), ("pillar", pillar), ("far", far)] {
        let dir = Dir::new();
        let count = points.len();
        dir.write("a.las", &Las::numbered(points).bytes());
        dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
        assert_eq!(dir.report("out")["outputs"][0]["points"], count, "{name}");
        dir.validate("out", &["a.las"]);
    }
}

#[test]
fn a_gps_time_that_is_no_number_is_carried_not_spread() {
    let dir = Dir::new();
    let mut las = Las::terrain(100, 1);
    las.points.iter_mut().for_each(|p| p.gps_time = f64::NAN);
    dir.write("a.las", &las.bytes());
    dir.succeed(["convert", "a.las", "-o", "out"]);
    let metadata = fs::read_to_string(dir.path("out/metadata.json")).unwrap();
    assert!(serde_json::from_str::<serde_json::Value>(&metadata).is_ok() && !metadata.contains("NaN"));
    dir.validate("out", &["a.las"]);
}

#[test]
fn names_in_any_language_work() {
    let dir = Dir::new();
    dir.write("Gelände/日本 'q\" scan.las", &Las::terrain(500, 1).bytes());
    dir.succeed(["convert", "Gelände", "-o", "Ausgabe ü"]);
    dir.validate("Ausgabe ü", &["Gelände"]);
    let name = dir.report("Ausgabe ü")["inputs"][0]["path"].as_str().unwrap().to_owned();
    assert!(name.ends_with("日本 'q\" scan.las"), "{name}");
}

/// A name that is not UTF-8 at all, as old archives have them.
#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_text_work() {
    use std::os::unix::ffi::OsStrExt as _;
    let dir = Dir::new();
    let name = std::ffi::OsStr::from_bytes(b"a\xFF.las");
    fs::write(dir.path("").join(name), Las::terrain(50, 1).bytes()).unwrap();
    let args = ["convert".as_ref(), name, "-o".as_ref(), "out".as_ref()];
    dir.succeed(args);
    dir.validate("out", &[]);
}

/// Real scans of others, point formats 0 to 8, LAS and LAZ: every point is found again.
#[test]
fn good_scans_of_others_come_back_whole() {
    let Some(folder) = corpus("las") else { return };
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let dir = Dir::new();
        let ended = dir.run(["convert".as_ref(), path.as_os_str(), "-o".as_ref(), "out".as_ref(), "-q".as_ref()]);
        if path.file_name().unwrap() == "no-points.las" {
            ended.failed_with(3, &[]);
        } else {
            assert_eq!(ended.code(), 0, "{}", ended.stderr());
            dir.validate("out", &[path.to_str().unwrap()]);
        }
    }
}
