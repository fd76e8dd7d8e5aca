//! The writer against files that share no code with it (`fixtures/generators/batches.py`).

use std::collections::BTreeMap;

use pointmill_format::Lattice;
use pointmill_format::batches::{Batches, Original, Precision, WriteOptions};

use crate::util::{Points, golden};

const LATTICE: Lattice = Lattice { scale: [0.001; 3], offset: [500_000.0, -4_000_000.0, 10.0] };

/// The points of the worked example.
fn example(lattice: Lattice, with_attributes: bool) -> Points {
    let mut cloud = Points::empty(lattice, with_attributes);
    for (p, rgb, intensity, class) in [
        ([500, 500, 500], [200, 100, 50], 1, 2),
        ([100, 100, 100], [255, 0, 0], 2, 2),
        ([900, 200, 100], [0, 255, 0], 259, 5),
        ([1500, 700, 300], [0, 0, 255], 4, 6),
        ([2250, 250, 1000], [10, 20, 30], 5, 6),
        ([500, 500, 500], [100, 200, 50], 65_535, 1),
    ] {
        cloud.push(p, rgb, with_attributes.then_some((intensity, class)));
    }
    cloud
}

/// Named as the script does; version 0.1.0 whatever this one is.
fn options(cloud: &Points, cell: f64, precision: Precision) -> WriteOptions {
    let mut options = cloud.options(cell);
    options.description.version = "0.1.0".into();
    options.description.name = "fixture".into();
    options.precision = Some(precision);
    options
}

fn with_own_keys(mut options: WriteOptions) -> WriteOptions {
    options.description.extra.insert("duplicates".into(), "keep".into());
    options.description.extra.insert("rgbDepth".into(), "auto".into());
    options
}

#[track_caller]
fn assert_golden(name: &str, cloud: &Points, options: &WriteOptions) {
    let expected = std::fs::read(golden(name)).unwrap();
    let (found, _) = cloud.write(options);
    let differs = found.iter().zip(&expected).position(|(a, b)| a != b);
    assert!(found == expected, "{name}: {} and {} bytes, first difference at {differs:?}", found.len(), expected.len());
}

#[test]
fn the_worked_example_is_written_byte_for_byte() {
    let cloud = example(LATTICE, true);
    assert_golden("example.qbatch", &cloud, &with_own_keys(options(&cloud, 1.0, Precision::Thirty)));
}

#[test]
fn coarse_far_and_empty_clouds_are_written_byte_for_byte() {
    let cloud = example(Lattice { scale: [0.25; 3], offset: [0.0; 3] }, false);
    assert_golden("coarse.qbatch", &cloud, &options(&cloud, 16.0, Precision::Ten));

    let mut cloud = Points::empty(Lattice { offset: [-6e6, 6.3e6, -0.5], ..LATTICE }, false);
    cloud.push([0; 3], [1, 2, 3], None);
    cloud.push([1_000_000_000, 500_000_000, 1], [4, 5, 6], None);
    cloud.push([1_000_000_000, 500_000_000, 0], [7, 8, 9], None);
    assert_golden("far.qbatch", &cloud, &options(&cloud, 1.0, Precision::Thirty));

    let cloud = Points::empty(LATTICE, true);
    assert_golden("empty.qbatch", &cloud, &options(&cloud, 1.0, Precision::Thirty));
}

/// The table of the format page.
#[test]
fn the_worked_example_is_read_as_the_page_tells_it() {
    let batches = Batches::open(golden("example.qbatch")).unwrap();
    assert_eq!((batches.header().points, batches.header().grid.exponent), (6, 2));
    assert_eq!(batches.attribute::<u16>(0).unwrap(), [2, 259, 1, 65_535, 4, 5]);
    assert_eq!(batches.attribute::<u8>(1).unwrap(), [2, 5, 2, 1, 6, 6]);
    let quantized = |i| LATTICE.world(i);
    let expected = [
        ([100, 100, 100], [255, 0, 0], 1, [255, 0, 0]),
        ([900, 200, 100], [0, 255, 0], 1, [0, 255, 0]),
        ([500, 500, 500], [139, 139, 25], 0, [200, 100, 50]),
        ([500, 500, 500], [100, 200, 50], 3, [100, 200, 50]),
        ([1500, 700, 300], [0, 0, 255], 0, [0, 0, 255]),
        ([2250, 250, 1000], [10, 20, 30], 0, [10, 20, 30]),
    ];
    for (point, (p, rgb, lod, original)) in batches.points_in_morton_order(Precision::Thirty).zip(expected) {
        let point = point.unwrap();
        assert!(point.world.iter().zip(quantized(p)).all(|(a, b)| (a - b).abs() < 2e-9), "{point:?}");
        assert_eq!((point.rgb, point.lod, batches.original_colour(point.index)), (rgb, lod, Some(original)));
    }
    assert_eq!(batches.originals(), [Original { index: 2, colour: 0x0032_64c8 }], "no other colour was changed");
}

#[cfg(feature = "zstd")]
#[test]
fn frames_that_no_compressor_made_are_read() {
    let (raw, packed) = ["example.qbatch", "blocks.qbatch"].map(|n| Batches::open(golden(n)).unwrap()).into();
    assert!(packed.is_compressed() && packed.read_everything().unwrap() == 6);
    let points = |b: &Batches<_>| b.points_in_morton_order(Precision::Thirty).map(Result::unwrap).collect::<Vec<_>>();
    assert_eq!(points(&packed), points(&raw));
}

#[test]
fn every_golden_file_is_read_to_its_end() {
    for (name, points, precision) in
        [("coarse", 6, Precision::Ten), ("far", 3, Precision::Thirty), ("empty", 0, Precision::Thirty)]
    {
        let batches = Batches::open(golden(&format!("{name}.qbatch"))).unwrap();
        assert_eq!((batches.read_everything().unwrap(), batches.header().precision()), (points, precision));
    }
}

fn fnv1a(bytes: &[u8]) -> String {
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
    format!("{hash:016x}")
}

/// Name, seed, points, sides, scale, offset, cell, precision, with attributes: the table `CLOUDS` of the script.
type Row = (&'static str, u64, usize, [u64; 3], f64, [f64; 3], f64, Precision, bool);
const CLOUDS: [Row; 5] = [
    ("swapped", 1, 6 * 10_240 + 77, [40_000, 30_000, 9_000], 0.001, LATTICE.offset, 1.0, Precision::Thirty, true),
    ("whole", 2, 3 * 10_240, [3_000; 3], 0.01, [4_428_000.5, 1_000_000.25, -17.0], 4.0, Precision::Thirty, false),
    ("flat", 3, 10_241, [7_001, 1, 1], 0.125, [-1000.0, 0.0, 0.0], 0.5, Precision::Twenty, false),
    ("wide", 4, 10_241, [1 << 30, 1 << 30, 1 << 20], 0.001, [-500_000.0, 0.0, 0.0], 1.0, Precision::Thirty, false),
    ("dense", 5, 20_000, [90; 3], 0.007_812_5, [0.0; 3], 1.0, Precision::Ten, true),
];

#[test]
fn clouds_of_several_batches_have_the_digests_of_the_independent_encoder() {
    let table = std::fs::read_to_string(golden("expected.tsv")).unwrap();
    let mut expected: BTreeMap<&str, Vec<[&str; 3]>> = BTreeMap::new();
    for line in table.lines().skip(1) {
        let [cloud, section, bytes, digest] = line.split('\t').collect::<Vec<_>>().try_into().unwrap();
        expected.entry(cloud).or_default().push([section, bytes, digest]);
    }
    assert_eq!(expected.len(), CLOUDS.len());
    for (name, seed, points, sides, scale, offset, cell, precision, with_attributes) in CLOUDS {
        let lattice = Lattice { scale: [scale; 3], offset };
        let cloud = Points::random(seed, points, sides, with_attributes, lattice);
        let (bytes, _) = cloud.write(&options(&cloud, cell, precision));
        let mut at = 0;
        for [section, len, digest] in &expected[name] {
            let end = at + len.parse::<usize>().unwrap();
            assert_eq!(&fnv1a(&bytes[at..end.min(bytes.len())]), digest, "{name}: {section}");
            at = end;
        }
        assert_eq!(at, bytes.len(), "{name}");
    }
}

/// The bytes that the format page quotes, `qbatch offset: hex  comment`, are those of the golden file.
#[test]
fn the_worked_example_of_the_format_page_is_the_golden_file() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/formats/batches.md");
    let page = std::fs::read_to_string(page).unwrap();
    let file = std::fs::read(golden("example.qbatch")).unwrap();
    let mut quoted = 0;
    for line in page.lines() {
        let Some((offset, rest)) = line.strip_prefix("qbatch ").and_then(|rest| rest.split_once(": ")) else {
            continue;
        };
        let hex = rest.split("  ").next().unwrap();
        let expected: Vec<u8> = hex.split(' ').map(|h| u8::from_str_radix(h, 16).unwrap()).collect();
        let offset: usize = offset.trim().parse().unwrap();
        assert_eq!(file[offset..offset + expected.len()], expected, "{line}");
        quoted += expected.len();
    }
    assert_eq!(quoted, 373);
}
