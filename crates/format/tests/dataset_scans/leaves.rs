//! Binary trees and batches: leaves and slots are decoded like nodes.

use std::fs;

use pointmill_format::{DatasetNote, ErrorKind, Lattice, OpenOptions, ScanWarning};
use pointmill_testkit::damage::put;
use pointmill_testkit::files::{fixture, fixture_bytes, temporary};
use pointmill_testkit::reader::columns_are_independent;

use crate::util::{READER, changed, open, records, refused};

/// X, Y, Z, class, red, green, blue, intensity, Amplitude, time of the golden trees, as their script lists them.
#[rustfmt::skip]
const TREE: [[f64; 10]; 17] = [
    [-3000.0, 0.0, 0.0, 2.0, 1.0, 2.0, 3.0, 10.0, -5.0, 0.5],
    [-2999.0, 1.0, 0.0, 2.0, 65_535.0, 256.0, 1.0, 11.0, 5.0, -1.25],
    [-2500.0, -7.0, 3.0, 6.0, 0.0, 0.0, 0.0, 12.0, 32_767.0, 1e-300],
    [-1000.0, 40.0, 100.0, 255.0, 9.0, 9.0, 9.0, 65_535.0, -32_768.0, 4.0],
    [-999.0, 800.0, -100.0, 0.0, 4.0, 5.0, 6.0, 13.0, 0.0, 5.0],
    [-998.0, 801.0, 50.0, 3.0, 7.0, 8.0, 9.0, 14.0, 1.0, 6.0],
    [0.0, 0.0, 0.0, 1.0, 257.0, 514.0, 771.0, 15.0, 2.0, 123_456_789.125],
    [1.0, 2.0, 1.0, 5.0, 1.0, 1.0, 1.0, 17.0, 4.0, 9.0],
    [2.0, 1.0, 1.0, 4.0, 1.0, 1.0, 2.0, 18.0, 5.0, 10.0],
    [3.0, 0.0, 0.0, 1.0, 257.0, 514.0, 771.0, 16.0, 3.0, 8.0],
    [7000.0, -500.0, 12.0, 2.0, 40.0, 0.0, 0.0, 9.0, 6.0, 11.0],
    [7000.0, -500.0, 12.0, 17.0, 0.0, 1.0, 0.0, 9.0, 6.0, 11.0],
    [7000.0, -500.0, 12.0, 17.0, 40.0, 0.0, 0.0, 3.0, 6.0, 11.0],
    [7000.0, -500.0, 12.0, 17.0, 40.0, 0.0, 0.0, 4.0, 6.0, 11.0],
    [7000.0, -500.0, 12.0, 17.0, 40.0, 0.0, 0.0, 5.0, 6.0, 11.0],
    [8191.0, 77.0, -1.0, 18.0, 2.0, 2.0, 2.0, 19.0, 7.0, 12.0],
    [8192.0, 78.0, -2.0, 19.0, 3.0, 3.0, 3.0, 20.0, 8.0, 13.0],
];

/// X, Y, Z, red, green, blue before averaging, intensity, classification of the worked example of the page.
#[rustfmt::skip]
const EXAMPLE: [[f64; 8]; 6] = [
    [100.0, 100.0, 100.0, 255.0, 0.0, 0.0, 2.0, 2.0],
    [500.0, 500.0, 500.0, 100.0, 200.0, 50.0, 1.0, 1.0],
    [500.0, 500.0, 500.0, 200.0, 100.0, 50.0, 1.0, 2.0],
    [900.0, 200.0, 100.0, 0.0, 255.0, 0.0, 3.0, 5.0],
    [1500.0, 700.0, 300.0, 0.0, 0.0, 255.0, 4.0, 6.0],
    [2250.0, 250.0, 1000.0, 10.0, 20.0, 30.0, 5.0, 6.0],
];

#[test]
fn every_value_of_a_tree_comes_back_in_both_layouts() {
    for layout in ["bintree/files", "bintree/packed"] {
        let cloud = READER.check(&fixture(layout), layout).unwrap();
        assert_eq!(records(&cloud), TREE, "{layout}");
        columns_are_independent(&*open(layout, &OpenOptions::default()));
        let info = &cloud.info;
        assert_eq!(info.lattice, Some(Lattice { scale: [0.001, 0.001, 0.01], offset: [1000.0, 2000.0, -5.0] }));
        assert_eq!((info.points_declared, info.bounds_declared.unwrap().min), (17, [997.0, 1999.5, -6.0]));
        assert!(info.rgb_is_16_bit && info.warnings.is_empty(), "{:?}", info.warnings);
        assert_eq!(
            cloud.attributes(),
            "classification uint8x1, rgb uint16x3, intensity uint16x1, Amplitude int16x1, gps-time doublex1"
        );
        let (_, amplitude) = info.attribute("Amplitude").unwrap();
        assert_eq!((&amplitude.scale, &amplitude.offset), (&vec![0.01], &vec![-10.0]));
    }
}

#[test]
fn colours_for_meshes_are_those_of_8_bits() {
    let (_kept, folder) = changed("bintree/packed", |name, bytes| {
        if name == "index.json" {
            let (rgb, intensity) = ("\"name\":\"rgb\",\"type\":\"uint16\",\"elements\":3", "\"name\":\"intensity\"");
            let text = String::from_utf8(bytes.clone()).unwrap();
            assert!(text.contains(rgb) && text.contains(intensity));
            *bytes = text.replace(rgb, "\"name\":\"rgba\",\"type\":\"uint8\",\"elements\":4").into_bytes();
        }
    });
    let cloud = READER.check(&folder, "rgba").unwrap();
    assert!(cloud.attributes().contains("rgb uint16x3"), "{}", cloud.attributes());
    let rgb = cloud.values("rgb");
    assert!(rgb.iter().all(|channel| *channel <= 255.0) && rgb.contains(&255.0));
    assert!(!cloud.info.rgb_is_16_bit);
}

#[test]
fn leaves_that_are_too_large_for_single_precision_are_told() {
    let (_kept, folder) = changed("bintree/packed", |name, bytes| {
        if name == "index.json" {
            let text = String::from_utf8(bytes.clone()).unwrap();
            *bytes = text.replace("\"scale\":[0.001,0.001,0.01]", "\"scale\":[1e-9,0.001,0.01]").into_bytes();
        }
    });
    let cloud = READER.check(&folder, "fine").unwrap();
    assert!(cloud.warned("more than half a step"), "{:?}", cloud.info.warnings);
}

#[test]
fn broken_trees_are_refused_with_what_is_wrong() {
    let (_kept, folder) = changed("bintree/files", |name, bytes| {
        if name == "n00.bin" {
            bytes.truncate(40);
        }
    });
    let cloud = READER.read(&folder).unwrap();
    assert!(cloud.errors.len() == 1 && cloud.errors[0].to_string().contains("n00.bin"), "{:?}", cloud.errors);
    fs::remove_file(folder.join("index.json")).unwrap();
    assert!(matches!(refused(&folder, &OpenOptions::default()).kind(), ErrorKind::Unsupported));
}

#[test]
fn every_value_of_a_file_of_batches_comes_back_with_its_own_colour() {
    for name in ["batches/example.qbatch", "batches/blocks.qbatch"] {
        let cloud = READER.check(&fixture(name), name).unwrap();
        let mut expected = EXAMPLE.to_vec();
        let values = records(&cloud);
        // which of two points at one place has which class is in the file alone
        expected.iter_mut().zip(&values).for_each(|(e, v)| e[6..].copy_from_slice(&v[6..]));
        assert_eq!(values, expected, "{name}");
        let mut classes = cloud.values("classification");
        classes.sort_by(f64::total_cmp);
        assert_eq!(classes, [1.0, 2.0, 2.0, 5.0, 6.0, 6.0]);
        columns_are_independent(&*open(name, &OpenOptions::default()));
        let offset = [500_000.0, -4_000_000.0, 10.0];
        assert_eq!(cloud.info.lattice, Some(Lattice { scale: [0.001; 3], offset }));
        assert!(cloud.info.warnings.is_empty(), "{:?}", cloud.info.warnings);
        assert_eq!(cloud.attributes(), "rgb uint16x3, intensity uint16x1, classification uint8x1");
    }
}

#[test]
fn what_a_file_of_batches_lacks_is_told() {
    // one plane: the figures say how far positions are off
    let cloud = READER.check(&fixture("batches/coarse.qbatch"), "coarse").unwrap();
    let notes: Vec<_> = cloud.info.warnings.iter().collect();
    assert!(
        matches!(notes[..], [ScanWarning::Dataset(DatasetNote::Inexact { .. })]) && cloud.warned("up to "),
        "{notes:?}"
    );
    // no originals: flag 8, and the place of the section
    let mut bytes = fixture_bytes("batches/example.qbatch");
    put(&mut bytes, 112, &7u32.to_le_bytes());
    put(&mut bytes, 160, &0u64.to_le_bytes());
    let path = temporary(&bytes);
    let file = path.with_extension("qbatch");
    fs::copy(&path, &file).unwrap();
    let cloud = READER.check(&file, "averaged").unwrap();
    fs::remove_file(&file).unwrap();
    assert!(cloud.warned("means of their cells"), "{:?}", cloud.info.warnings);
    assert!(records(&cloud).iter().any(|record| record[3..6] == [139.0, 139.0, 25.0]));
}

#[test]
fn originals_that_belong_to_no_point_are_an_error() {
    let mut bytes = fixture_bytes("batches/example.qbatch");
    // the index of the only one
    put(&mut bytes, 2048 + 8, &6u32.to_le_bytes());
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("a.qbatch");
    fs::write(&file, bytes).unwrap();
    let error = refused(&file, &OpenOptions::default());
    assert!(error.to_string().contains("originals do not ascend, or belong to no point"), "{error}");
}

#[test]
fn an_empty_file_is_a_scan_without_points() {
    let empty = READER.check(&fixture("batches/empty.qbatch"), "empty").unwrap();
    assert!(empty.is_empty() && empty.info.warnings.is_empty());
}
