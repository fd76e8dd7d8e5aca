//! Datasets that lie, or lack something.

use std::fs;

use pointmill_format::{ErrorKind, OpenOptions, ReadError, ScanWarning, Wanted, open_scan};
use pointmill_testkit::reader::{Cloud, check_error, read};

use crate::util::{changed, refused};

fn broken(error: &ReadError, words: &[&str]) {
    check_error(error);
    assert!(matches!(error.kind(), ErrorKind::Broken) && error.advice().is_some(), "{error}");
    let line = error.to_string();
    assert!(words.iter().all(|word| line.contains(word)), "{line}");
}

fn cloud(folder: &std::path::Path) -> Cloud {
    let scan = open_scan(folder, &OpenOptions::default()).unwrap();
    read(&*scan, &Wanted::all(scan.info()))
}

/// Records of `hierarchy.bin` have 22 bytes: type, mask, points, offset, size.
fn field(record: usize, at: usize) -> usize {
    22 * record + at
}

#[test]
fn a_payload_has_one_node() {
    // the records of the first chunk: the root, r0 as a proxy, r7, which takes the place of the root
    let (_kept, folder) = changed("potree2/brotli", |name, bytes| {
        if name == "hierarchy.bin" {
            let place: [u8; 16] = bytes[field(0, 6)..field(0, 22)].try_into().unwrap();
            bytes[field(2, 6)..field(2, 22)].copy_from_slice(&place);
        }
    });
    broken(&refused(&folder, &OpenOptions::default()), &["octree.bin", "payloads of nodes r and r7 overlap"]);
}

#[test]
fn a_count_that_its_payload_does_not_have_is_refused() {
    for (encoding, words) in [("default", "node r has"), ("brotli", "node r claims")] {
        let (_kept, folder) = changed(&format!("potree2/{encoding}"), |name, bytes| {
            if name == "hierarchy.bin" {
                bytes[field(0, 2)..field(0, 6)].copy_from_slice(&u32::MAX.to_le_bytes());
            }
        });
        broken(&refused(&folder, &OpenOptions::default()), &["octree.bin", words, "4294967295 points"]);
    }
}

#[test]
fn other_totals_are_told_and_the_nodes_count() {
    for (dataset, file) in [("potree2/default", "metadata.json"), ("potree1/objects", "cloud.js")] {
        let (_kept, folder) = changed(dataset, |name, bytes| {
            if name == file {
                *bytes =
                    String::from_utf8(bytes.clone()).unwrap().replace("\"points\": 13", "\"points\": 14").into_bytes();
            }
        });
        let cloud = cloud(&folder);
        assert_eq!((cloud.len(), cloud.info.points_declared), (13, 13));
        assert!(cloud.warned("declares 14 points; the 13 of its nodes are read"), "{:?}", cloud.info.warnings);
        assert!(matches!(cloud.info.warnings[..], [ScanWarning::Dataset(_)]));
    }
}

/// The index has no counts of leaves, as that of the reference: the files count.
#[test]
fn the_counts_of_potree_1_are_those_of_the_files() {
    let (_kept, folder) = changed("potree1/words", |_, _| {});
    assert_eq!(cloud(&folder).len(), 13);
    let node = folder.join("data/r/00/00/r00007.bin");
    let bytes = fs::read(&node).unwrap();
    fs::write(&node, &bytes[..48]).unwrap();
    let short = cloud(&folder);
    assert!(short.len() == 12 && short.warned("declares 13 points; the 12"), "{:?}", short.info.warnings);
    fs::write(&node, &bytes[..50]).unwrap();
    broken(&refused(&folder, &OpenOptions::default()), &["r00007.bin", "no whole number of records"]);
    fs::remove_file(&node).unwrap();
    broken(&refused(&folder, &OpenOptions::default()), &["r00007.bin", "is missing"]);
}

/// The counts of the index add up to the total, so they are believed until the node is read.
#[test]
fn a_node_with_other_points_than_its_index_says_is_an_error() {
    let (_kept, folder) = changed("potree1/objects", |name, bytes| {
        if name.ends_with("r7.bin") {
            bytes.truncate(bytes.len() / 2);
        }
    });
    let cloud = cloud(&folder);
    assert_eq!(cloud.errors.len(), 1);
    broken(&cloud.errors[0], &["node r7 has 1 points; its index says 2"]);
}
