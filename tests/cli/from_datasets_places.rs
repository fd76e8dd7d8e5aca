//! Datasets as inputs: where they are found, and what is never read or replaced.

use std::collections::BTreeMap;
use std::fs;

use pointmill_testkit::damage::put;
use pointmill_testkit::files::{dataset, fixture};
use pointmill_testkit::las::Las;
use serde_json::Value;

use crate::support::Dir;

/// Two scans, and the dataset of the first.
fn with_dataset() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(1000, 1).bytes());
    dir.write("b.las", &Las::terrain(500, 2).bytes());
    dir.succeed(["convert", "a.las", "-o", "in/octree", "-q"]);
    dir
}

fn points(dir: &Dir, dataset: &str) -> u64 {
    dir.report(dataset)["points_written"].as_u64().or(dir.report(dataset)["outputs"][0]["points"].as_u64()).unwrap()
}

#[test]
fn a_folder_brings_its_datasets_along_and_not_their_files() {
    let dir = with_dataset();
    dir.succeed(["convert", "b.las", "-o", "in/deep/old", "--to", "potree1", "-q"]);
    fs::copy(dir.path("b.las"), dir.path("in/b.las")).unwrap();
    fs::write(dir.path("in/notes.txt"), "notes").unwrap();
    let ended = dir.succeed(["convert", "in", "-o", "out"]);
    let report = dir.report("out");
    assert_eq!(points(&dir, "out"), 1000 + 500 + 500);
    assert_eq!(report["inputs"].as_array().unwrap().len(), 3, "{}", report["inputs"]);
    assert_eq!(report["other_files"]["count"], 1, "{}", ended.stderr());
    let described = dir.succeed(["info", "in", "--json"]).stdout();
    let described: Value = serde_json::from_str(&described).unwrap();
    assert_eq!(described.as_array().unwrap().len(), 3, "{described}");
    // the same dataset by its folder, its file and a glob
    dir.succeed(["convert", "in/octree", "in/octree/metadata.json", "in/oct*", "-o", "once", "-q"]);
    assert_eq!(points(&dir, "once"), 1000);
}

#[test]
fn what_a_run_makes_is_none_of_its_inputs() {
    let dir = with_dataset();
    fs::copy(dir.path("b.las"), dir.path("in/b.las")).unwrap();
    for options in [&["--to", "potree2"][..], &["--to", "batches"], &["--to", "potree2", "--to", "potree1"]] {
        for _ in 0..2 {
            dir.succeed([&["convert", "in", "-o", "in/out", "--overwrite", "-q"], options].concat());
            assert_eq!(points(&dir, "in/out"), 1500, "{options:?}");
        }
    }
    // what a killed run has left
    let unfinished = dir.path("in/.out.unfinished-abcdef");
    fs::create_dir(&unfinished).unwrap();
    fs::write(unfinished.join("lock"), "of a run").unwrap();
    dir.succeed(["convert", "a.las", "-o", "in/.out.unfinished-abcdef/new", "-q"]);
    dir.succeed(["convert", "in", "-o", "in/out", "--overwrite", "-q"]);
    assert_eq!(points(&dir, "in/out"), 1500);
    dir.validate("in/out", &["in"]);
}

#[test]
fn an_input_is_never_replaced() {
    let dir = with_dataset();
    let before = dataset(&dir.path("in/octree"));
    for args in [
        &["convert", "in/octree", "-o", "in/octree", "--overwrite"][..],
        &["convert", "a.las", "in/octree/metadata.json", "-o", "in/octree", "--overwrite"],
        &["convert", "in/octree", "-o", "in", "--overwrite"],
    ] {
        dir.run(args).failed_with(2, &["the output would replace the input in/octree"]);
    }
    assert!(dataset(&dir.path("in/octree")) == before);
    // made of itself under another name, it may
    dir.succeed(["convert", "in/octree", "-o", "copy", "-q"]);
    dir.succeed(["convert", "copy", "-o", "in/octree", "--overwrite", "-q"]);
    assert_eq!(points(&dir, "in/octree"), 1000);
}

#[test]
fn datasets_of_the_same_points_are_named_and_not_added_up() {
    let dir = with_dataset();
    dir.succeed(["convert", "a.las", "-o", "both", "--to", "potree2", "--to", "potree1", "-q"]);
    dir.run(["convert", "both", "-o", "out"]).failed_with(2, &["both", "potree2, potree1", "name one of them"]);
    dir.succeed(["convert", "both/potree1", "-o", "out", "-q"]);
    assert_eq!(points(&dir, "out"), 1000);
}

#[test]
fn scans_in_the_folder_of_a_dataset_are_told() {
    let dir = with_dataset();
    fs::copy(dir.path("a.las"), dir.path("in/octree/a.las")).unwrap();
    let said = dir.succeed(["convert", "in", "-o", "out"]).stderr();
    assert!(said.contains("1 scan in the folder of a dataset, not read (in/octree/a.las)"), "{said}");
    assert_eq!(points(&dir, "out"), 1000);
}

#[test]
fn damaged_datasets_end_the_run_or_are_skipped() {
    let dir = with_dataset();
    let hierarchy = dir.path("in/octree/hierarchy.bin");
    let mut bytes = fs::read(&hierarchy).unwrap();
    put(&mut bytes, 2, &u32::MAX.to_le_bytes());
    fs::write(&hierarchy, bytes).unwrap();
    dir.run(["convert", "in/octree", "-o", "out"]).failed_with(3, &["octree.bin", "node r has"]);
    dir.run(["convert", "in", "b.las", "-o", "out"])
        .failed_with(3, &["octree.bin", "copy or convert the dataset again"]);
    dir.succeed(["convert", "in", "b.las", "-o", "out", "--unreadable", "skip", "-q"]);
    assert_eq!(points(&dir, "out"), 500);
    fs::remove_file(&hierarchy).unwrap();
    dir.run(["convert", "in/octree", "-o", "out2"]).failed_with(3, &["hierarchy.bin", "is missing"]);
    assert!(!dir.path("out2").exists());
}

#[test]
fn counts_that_the_reference_got_wrong_do_no_harm() {
    let dir = Dir::new();
    let words = fixture("potree1/words");
    dir.succeed(["convert", words.to_str().unwrap(), "-o", "out", "-q"]);
    assert_eq!(points(&dir, "out"), 13);
    dir.validate("out", &[words.to_str().unwrap()]);
}

#[test]
fn an_archive_is_an_input_where_it_is_named_and_where_it_is_found() {
    let dir = Dir::new();
    let zip = dir.write("in/cloud.zip", &archive(&dataset(&fixture("potree1/objects"))));
    for input in [zip.to_str().unwrap(), "in", "in/*.zip"] {
        dir.succeed(["convert", input, "-o", "out", "--overwrite", "-q"]);
        assert_eq!(points(&dir, "out"), 13, "{input}");
    }
    dir.validate("out", &["in"]);
    // an archive of something else is none
    dir.write("in/other.zip", &archive(&[("notes.txt".to_owned(), b"notes".to_vec())].into()));
    dir.succeed(["convert", "in", "-o", "out", "--overwrite", "-q"]);
    assert_eq!(dir.report("out")["other_files"]["count"], 1);
    dir.run(["convert", "in/other.zip", "-o", "out2"]).failed_with(4, &["a ZIP", "unpack it"]);
}

/// An uncompressed archive by the plainest means.
fn archive(files: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let mut fields = [20u16, 0, 0, 0, 0].map(u16::to_le_bytes).concat(); // version, flags, method, time, date
        fields.extend([0, bytes.len() as u32, bytes.len() as u32].map(u32::to_le_bytes).concat()); // checksum, sizes
        fields.extend([name.len() as u16, 0].map(u16::to_le_bytes).concat()); // lengths of name and extra fields
        directory.extend(b"PK\x01\x02\x14\0");
        directory.extend(&fields);
        directory.extend([0; 10]); // comment, disk, attributes
        directory.extend((out.len() as u32).to_le_bytes());
        directory.extend(name.as_bytes());
        out.extend([&b"PK\x03\x04"[..], &fields, name.as_bytes(), bytes].concat());
    }
    let (at, count) = (out.len() as u32, files.len() as u16);
    out.extend(&directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend([count, count].map(u16::to_le_bytes).concat());
    out.extend([directory.len() as u32, at].map(u32::to_le_bytes).concat());
    out.extend([0, 0]);
    out
}
