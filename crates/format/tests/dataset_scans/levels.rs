//! Some levels of an octree.

use std::collections::BTreeMap;

use pointmill_format::copc::Dataset;
use pointmill_format::{ErrorKind, OpenOptions, Wanted, open_scan};
use pointmill_testkit::files::fixture;
use pointmill_testkit::reader::{keeps_promises, read};

use crate::util::{open, refused};

fn points(name: &str, options: &OpenOptions) -> usize {
    let scan = open(name, options);
    keeps_promises(&*scan, &Wanted::all(scan.info()), u64::MAX);
    let cloud = read(&*scan, &Wanted::all(scan.info()));
    assert_eq!(scan.info().points_declared, cloud.len() as u64, "{name}");
    assert!(scan.info().warnings.is_empty(), "{name}: {:?}", scan.info().warnings);
    cloud.len()
}

#[test]
fn levels_are_cut_by_number_or_by_spacing() {
    // points of the levels 0 to 5: 3, 3, 1, 1, 1, 4; the spacing of the root is 0.128
    for name in ["potree2/default", "potree2/brotli", "potree1/words", "potree1/objects", "potree1/flat"] {
        for (level, expected) in [(0, 3), (1, 6), (2, 7), (4, 9), (5, 13), (31, 13)] {
            assert_eq!(points(name, &OpenOptions::default().max_level(level)), expected, "{name}, level {level}");
        }
        for (spacing, expected) in [(1.0, 3), (0.128, 3), (0.065, 3), (0.064, 6), (0.032, 7), (0.001, 13)] {
            assert_eq!(points(name, &OpenOptions::default().min_spacing(spacing)), expected, "{name}, {spacing}");
        }
        let both = OpenOptions::default().min_spacing(0.032).max_level(1);
        assert_eq!(points(name, &both), 6, "{name}");
    }
}

#[test]
fn copc_files_are_cut_by_level_too() {
    let name = "copc/pages.copc.laz";
    let mut levels = BTreeMap::new();
    for node in Dataset::open(fixture(name)).unwrap().read_hierarchy().unwrap() {
        *levels.entry(node.key.level).or_insert(0) += node.points as usize;
    }
    assert!(levels.len() > 2, "{levels:?}");
    for level in 0..levels.len() as u8 {
        let expected: usize = levels.range(..=level).map(|(_, points)| points).sum();
        assert_eq!(points(name, &OpenOptions::default().max_level(level)), expected, "level {level}");
    }
}

#[test]
fn what_has_no_levels_is_refused() {
    let options = OpenOptions::default().max_level(2);
    for name in ["las/format7.laz", "bintree/packed", "batches/example.qbatch"] {
        let error = refused(&fixture(name), &options);
        assert!(matches!(error.kind(), ErrorKind::Unsupported), "{error}");
        assert!(error.to_string().contains("no levels to choose from"), "{error}");
    }
    let error = open_scan(fixture("nothing"), &options).err().unwrap();
    assert!(error.is_io(), "{error}");
}
