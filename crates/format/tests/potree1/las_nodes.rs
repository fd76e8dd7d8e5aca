//! Datasets whose nodes are LAS or LAZ files.

use std::fs;
use std::path::Path;

use pointmill_format::potree1::{Dataset, METADATA_FILE};
use pointmill_format::{NodePoints, OpenOptions, open_scan};
use pointmill_testkit::files::fixture_bytes;
use tempfile::TempDir;

use crate::util::{golden, load};

/// The tree of a golden dataset, all of whose nodes are copies of one LAS or LAZ file.
fn with_nodes(word: &str, fixture: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in load(&golden("words")) {
        let (name, bytes) = match name.strip_suffix(".bin") {
            Some(node) => (format!("{node}.{}", word.to_lowercase()), fixture_bytes(fixture)),
            None => (name, bytes),
        };
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    change(&folder.path().join(METADATA_FILE), |text| {
        let (before, list) = text.split_once("\"pointAttributes\": [").unwrap();
        let (_, after) = list.split_once(']').unwrap();
        format!("{before}\"pointAttributes\": \"{word}\"{after}")
    });
    folder
}

fn change(path: &Path, change: impl Fn(&str) -> String) {
    let text = fs::read_to_string(path).unwrap();
    fs::write(path, change(&text)).unwrap();
}

#[test]
fn nodes_are_read_as_the_scans_that_they_are() {
    for (word, fixture) in [("LAS", "las/format2.las"), ("LAZ", "las/format2.laz")] {
        let folder = with_nodes(word, fixture);
        let dataset = Dataset::open(folder.path()).unwrap();
        let scan = open_scan(pointmill_testkit::files::fixture(fixture), &OpenOptions::default()).unwrap();
        let points = scan.info().points_declared;
        assert!(points > 100);
        let mut node = NodePoints::default();
        for found in dataset.read_hierarchy().unwrap() {
            assert_eq!(dataset.count(found.key).unwrap(), points);
            dataset.read_points(found.key, &mut node).unwrap();
            assert_eq!(node.len() as u64, points);
            assert_eq!(Some(*node.lattice()), scan.info().lattice);
            assert!(node.names().eq(scan.info().attributes.iter().map(|a| a.name.as_str())));
            assert_eq!(node.column::<u16>("rgb").unwrap().len() as u64, 3 * points);
        }
    }
}

#[test]
fn nodes_of_other_attributes_or_none_are_told() {
    let folder = with_nodes("LAS", "las/format2.las");
    let node = folder.path().join("data/r/r7.las");
    fs::write(&node, fixture_bytes("las/format3.las")).unwrap();
    let dataset = Dataset::open(folder.path()).unwrap();
    let mut points = NodePoints::default();
    let error = dataset.read_points("r7".parse().unwrap(), &mut points).unwrap_err();
    assert!(error.to_string().ends_with("r7.las: node r7 has other attributes than the root"), "{error}");
    fs::remove_file(node).unwrap();
    assert!(dataset.count("r7".parse().unwrap()).unwrap_err().is_io());
    fs::remove_file(folder.path().join("data/r/r.las")).unwrap();
    assert!(Dataset::open(folder.path()).is_err());
}

#[test]
fn a_compressed_node_has_no_more_points_than_memory_allows() {
    let folder = with_nodes("LAZ", "las/format2.laz");
    let mut dataset = Dataset::open(folder.path()).unwrap();
    dataset.set_max_node_bytes(2_000);
    let error = dataset.read_points("r7".parse().unwrap(), &mut NodePoints::default()).unwrap_err();
    assert!(error.to_string().contains("bytes of memory, 2000 are allowed"), "{error}");
}
