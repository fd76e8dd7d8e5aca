//! Octrees with a file for each node: made, told of, replaced and protected.

use std::fs;

use pointmill_format::potree1::Dataset;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;
use serde_json::{Value, json};

use crate::support::Dir;

fn with_scans() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(2000, 1).bytes());
    dir.write("b.las", &Las::terrain(3000, 2).bytes());
    dir
}

fn points(dir: &Dir, folder: &str) -> u64 {
    let octree = Dataset::open(dir.path(folder)).unwrap();
    octree.read_hierarchy().unwrap().iter().map(|node| octree.count(node.key).unwrap()).sum()
}

#[test]
fn an_octree_for_engines_has_16_bytes_a_point_and_says_what_it_lacks() {
    let dir = with_scans();
    let ended = dir.succeed(["convert", "a.las", "-o", "out", "--to", "potree1", "--leaf-capacity", "100"]);
    let said = ended.stderr();
    assert!(said.contains("out: 2,000 points in ") && said.contains("all integers come back"), "{said}");
    assert!(said.contains("potree1: colours of 16 bits are stored in 8"), "{said}");
    assert!(said.contains("gps-time (not part of the usual record; --attributes adds it)"), "{said}");
    let metadata: Value = serde_json::from_slice(&fs::read(dir.path("out/cloud.js")).unwrap()).unwrap();
    assert_eq!(metadata["version"], "1.7");
    assert_eq!(metadata["pointAttributes"], json!(["POSITION_CARTESIAN", "COLOR_PACKED"]));
    assert_eq!(metadata["hierarchyStepSize"], 5);
    assert_eq!(metadata["points"], 2000);
    let report = &dir.report("out")["outputs"][0];
    assert_eq!(report["format"], "potree1");
    assert_eq!(report["details"]["step"], metadata["scale"]);
    let files = dataset(&dir.path("out"));
    assert_eq!(report["bytes"], files.values().map(Vec::len).sum::<usize>());
    assert_eq!(points(&dir, "out"), 2000);
}

#[test]
fn attributes_that_version_1_7_has_no_place_for_are_named_with_what_has() {
    let dir = with_scans();
    let args =
        ["convert", "a.las", "-o", "out", "--to", "potree1", "--attributes", "classification,intensity,gps-time"];
    let said = dir.succeed(args).stderr();
    assert!(said.contains("gps-time (version 1.7 has no place for it; --potree1-version 1.8 has)"), "{said}");
    assert!(said.contains("BA_PointCloud does not know the number of bytes of CLASSIFICATION"), "{said}");
    let metadata: Value = serde_json::from_slice(&fs::read(dir.path("out/cloud.js")).unwrap()).unwrap();
    let words = json!(["POSITION_CARTESIAN", "COLOR_PACKED", "CLASSIFICATION", "INTENSITY"]);
    assert_eq!(metadata["pointAttributes"], words);
    let said = dir.succeed(args.iter().chain(&["--overwrite", "--potree1-version", "1.8"])).stderr();
    assert!(!said.contains("no place") && said.contains("do not read version 1.8"), "{said}");
}

#[test]
fn it_replaces_others_and_is_replaced_and_nothing_is_left() {
    let dir = with_scans();
    let octree: &[&str] = &["--to", "potree1", "--leaf-capacity", "50"];
    let kinds =
        [octree, &["--to", "batches"], &["--to", "potree1", "--to", "potree2"], octree, octree, &["--to", "bintree"]];
    for (i, kind) in kinds.iter().enumerate() {
        let scan = ["a.las", "b.las"][i % 2];
        dir.succeed([&["convert", scan, "-o", "out", "--overwrite", "-q"], *kind].concat());
        if *kind == octree {
            assert_eq!(points(&dir, "out"), [2000, 3000][i % 2]);
        }
        assert_eq!(dir.names(), ["a.las", "b.las", "out"]);
    }
}

#[test]
fn what_is_not_part_of_it_is_not_deleted() {
    for name in ["data/r/notes.txt", "data/mine/x.bin", "notes.txt", "data/r/r01234567.bin", "sources.json"] {
        let dir = with_scans();
        dir.succeed(["convert", "a.las", "-o", "out", "-q", "--to", "potree1"]);
        dir.write(&format!("out/{name}"), b"years");
        let last = name.rsplit('/').next().unwrap();
        let shown = if name.contains("mine") { "mine" } else { last };
        dir.run(["convert", "b.las", "-o", "out", "--overwrite"]).failed_with(2, &["out", shown]);
        assert_eq!(fs::read(dir.path("out").join(name)).unwrap(), b"years");
        assert_eq!(points(&dir, "out"), 2000);
    }
    let dir = with_scans();
    dir.write("mine/cloud.js", br#"{"version": "1.7", "octreeDir": "data"}"#);
    dir.run(["convert", "b.las", "-o", "mine", "--overwrite"]).failed_with(2, &["mine"]);
}

#[test]
fn options_are_for_the_octrees_that_have_them() {
    let dir = with_scans();
    let line = ["--potree1-version", "--to potree1"];
    dir.run(["convert", "a.las", "-o", "out", "--potree1-version", "1.8"]).failed_with(2, &line);
    let most = ["convert", "a.las", "-o", "out", "--max-node-points", "65000"];
    dir.run(most).failed_with(2, &["--max-node-points", "--to potree1"]);
    dir.run(most.iter().take(5).chain(&["9", "--to", "potree1"]))
        .failed_with(2, &["--max-node-points '9'", "from 100"]);
    let grid = ["convert", "a.las", "-o", "out", "--to", "bintree", "--sampling", "grid"];
    dir.run(grid).failed_with(2, &["--sampling", "--to potree2 or potree1"]);
    dir.succeed(["convert", "a.las", "-o", "out", "-q", "--to", "potree1", "--sampling", "grid", "--spacing", "0.5"]);
    assert_eq!(dir.report("out")["options"]["sampling"], "grid");
    dir.succeed(["convert", "a.las", "-o", "out", "-q", "--overwrite", "--to", "potree1", "--max-node-points", "150"]);
    dir.validate("out", &["a.las"]);
    let octree = Dataset::open(dir.path("out")).unwrap();
    assert!(octree.read_hierarchy().unwrap().iter().all(|node| node.declared <= 150));
    let ended = dir.run(["convert", "a.las", "-o", "out2", "--to", "potree1", "--potree1-version", "1.6"]);
    ended.failed_with(2, &["--potree1-version '1.6'", "1.7, 1.8"]);
}

#[test]
fn an_archive_is_made_told_of_validated_and_replaced() {
    let dir = with_scans();
    let args = ["convert", "a.las", "-o", "out", "--to", "potree1", "--leaf-capacity", "100", "--archive"];
    dir.succeed(args);
    assert_eq!(dataset(&dir.path("out")).keys().collect::<Vec<_>>(), ["potree1.zip"]);
    for path in ["out", "out/potree1.zip"] {
        let text = dir.succeed(["validate", path, "--against", "a.las"]).stdout();
        assert!(text.contains("ok       node-counts") && text.contains("ok       report"), "{path}: {text}");
        let text = dir.succeed(["info", path]).stdout();
        assert!(text.contains("2,000"), "{path}: {text}");
    }
    assert_eq!(dir.run(args).code(), 2, "it is there");
    dir.succeed(args.iter().chain(&["--overwrite"]));
    // a folder takes its place, and an archive that of a folder
    dir.succeed(["convert", "a.las", "-o", "out", "--to", "potree1", "--overwrite"]);
    assert!(dir.path("out/cloud.js").exists() && !dir.path("out/potree1.zip").exists());
    dir.succeed(args.iter().chain(&["--overwrite"]));
    assert!(!dir.path("out/cloud.js").exists());
    // another number of points
    let mut bytes = fs::read(dir.path("out/potree1.zip")).unwrap();
    let at = bytes.windows(8).position(|w| w == b"\"points\"").unwrap();
    let digit = at + bytes[at..].iter().position(|b| *b == b'2').unwrap();
    bytes[digit] = b'3';
    dir.write("broken.zip", &bytes);
    let ended = dir.run(["validate", "broken.zip"]);
    assert_eq!(ended.code(), 7);
    assert!(ended.stdout().contains("point-count"), "{}", ended.stdout());
    // an archive of something else stays
    dir.write("other/potree1.zip", b"PK\x03\x04 and more");
    let ended = dir.run(["convert", "a.las", "-o", "other", "--to", "potree1", "--archive", "--overwrite"]);
    assert_eq!(ended.code(), 2, "{}", ended.stderr());
    let ended = dir.run(["convert", "a.las", "-o", "new", "--archive"]);
    assert!(ended.code() == 2 && ended.stderr().contains("--archive requires --to potree1"), "{}", ended.stderr());
}
