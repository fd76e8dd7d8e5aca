//! The golden dataset, which a script wrote from the format page alone.

use std::path::Path;

use pointmill_format::bintree::{Bintree, Header, IndexWriter, Layout, NodeKind, RecordLayout};
use pointmill_format::{Attribute, AttributeType, Column, Lattice, NodePoints};

use crate::build::{Builder, Point};
use crate::util::{golden, load, open};

/// X, Y, Z, class, (r, g, b), intensity, Amplitude, gps-time, as in the script.
type Row = ([i32; 3], u8, [u16; 3], u16, i16, f64);

const POINTS: [Row; 17] = [
    ([-3000, 0, 0], 2, [1, 2, 3], 10, -5, 0.5),
    ([-2999, 1, 0], 2, [65535, 256, 1], 11, 5, -1.25),
    ([-2500, -7, 3], 6, [0, 0, 0], 12, 32767, 1e-300),
    ([-1000, 40, 100], 255, [9, 9, 9], 65535, -32768, 4.0),
    ([-999, 800, -100], 0, [4, 5, 6], 13, 0, 5.0),
    ([-998, 801, 50], 3, [7, 8, 9], 14, 1, 6.0),
    ([0, 0, 0], 1, [257, 514, 771], 15, 2, 123456789.125),
    ([3, 0, 0], 1, [257, 514, 771], 16, 3, 8.0),
    ([1, 2, 1], 5, [1, 1, 1], 17, 4, 9.0),
    ([2, 1, 1], 4, [1, 1, 2], 18, 5, 10.0),
    ([7000, -500, 12], 17, [40, 0, 0], 5, 6, 11.0),
    ([7000, -500, 12], 17, [40, 0, 0], 3, 6, 11.0),
    ([7000, -500, 12], 2, [40, 0, 0], 9, 6, 11.0),
    ([7000, -500, 12], 17, [0, 1, 0], 9, 6, 11.0),
    ([7000, -500, 12], 17, [40, 0, 0], 4, 6, 11.0),
    ([8191, 77, -1], 18, [2, 2, 2], 19, 7, 12.0),
    ([8192, 78, -2], 19, [3, 3, 3], 20, 8, 13.0),
];

fn header(layout: Layout) -> Header {
    let mut amplitude = Attribute::new("Amplitude", AttributeType::Int16, 1);
    (amplitude.scale, amplitude.offset) = (vec![0.01], vec![-10.0]);
    let columns = [
        Attribute::new("rgb", AttributeType::UInt16, 3),
        Attribute::new("intensity", AttributeType::UInt16, 1),
        amplitude,
        Attribute::new("gps-time", AttributeType::Float64, 1),
    ];
    let own = serde_json::json!({"duplicates": "keep", "rgbDepth": "auto"});
    let lattice = Lattice { scale: [0.001, 0.001, 0.01], offset: [1000.0, 2000.0, -5.0] };
    let mut header = Header::new(lattice, 3, layout);
    header.generator = "bintree.py".into();
    header.name = "tiny \"17\"".into();
    header.points = 17;
    header.origin = [997.0, 1999.0, -6.0];
    header.pointmill = own.as_object().unwrap().clone();
    header.record = RecordLayout::new(columns).unwrap();
    header
}

fn extras(id: u32, bytes: &mut [u8]) {
    let (_, _, rgb, intensity, amplitude, time) = POINTS[id as usize];
    for (i, channel) in rgb.into_iter().enumerate() {
        bytes[2 * i..2 * i + 2].copy_from_slice(&channel.to_le_bytes());
    }
    bytes[6..8].copy_from_slice(&intensity.to_le_bytes());
    bytes[8..10].copy_from_slice(&amplitude.to_le_bytes());
    bytes[16..24].copy_from_slice(&time.to_le_bytes());
}

#[test]
fn the_writer_makes_the_files_of_the_script_byte_for_byte_whatever_the_order_of_the_points() {
    for (layout, name) in [(Layout::Files, "files"), (Layout::Packed, "packed")] {
        let class = |id: u32| f64::from(POINTS[id as usize].1);
        let builder = Builder { header: header(layout), class: &class, extras: &extras };
        let mut points: Vec<Point> = (0..17).map(|id| Point { q: POINTS[id as usize].0, id }).collect();
        let expected = load(name);
        assert_eq!(builder.files(&mut points), expected, "{name}");
        points.reverse();
        assert_eq!(builder.files(&mut points), expected, "{name}");
    }
}

#[test]
fn an_index_that_was_read_is_written_back_byte_for_byte() {
    for name in ["files", "packed"] {
        let tree = Bintree::open(golden(name)).unwrap();
        let mut index = IndexWriter::new(Vec::new(), tree.header()).unwrap();
        tree.nodes().iter().for_each(|node| index.node(node).unwrap());
        assert_eq!(index.finish().unwrap(), load(name)["index.json"]);
    }
}

#[test]
fn the_nested_form_is_the_same_tree() {
    let flat = Bintree::open(golden("packed")).unwrap();
    let mut files = load("packed");
    files.insert("index.json".into(), std::fs::read(golden("nested").join("index.json")).unwrap());
    let nested = open(&files).unwrap();
    assert_eq!(nested.nodes(), flat.nodes());
    assert_eq!(nested.header(), flat.header());
}

#[test]
fn every_value_of_every_point_is_read_in_both_layouts() {
    for name in ["files", "packed"] {
        let tree = Bintree::open(golden(name).join("index.json")).unwrap();
        assert_eq!(tree.header(), &header(if name == "files" { Layout::Files } else { Layout::Packed }));
        let (mut points, mut rows) = (NodePoints::default(), Vec::new());
        for leaf in tree.leaves() {
            tree.read_leaf(leaf, &mut points).unwrap();
            rows.extend((0..points.len()).map(|i| row(&points, i)));
        }
        let order = |row: &Row| (row.0, row.3);
        let mut expected = POINTS.to_vec();
        expected.sort_by_key(order);
        rows.sort_by_key(order);
        assert_eq!(rows, expected);
    }
}

fn row(points: &NodePoints, i: usize) -> Row {
    let [
        Column::Float32(class),
        Column::UInt16(rgb),
        Column::UInt16(intensity),
        Column::Int16(amplitude),
        Column::Float64(time),
    ] = points.columns()
    else {
        panic!("columns of other types: {:?}", points.columns());
    };
    let lattice = header(Layout::Files).lattice;
    let world = points.world(i).unwrap();
    let q = [0, 1, 2].map(|a| lattice.quantize(a, world[a]) as i32);
    let rgb = [0, 1, 2].map(|c| rgb[3 * i + c]);
    (q, class[i] as u8, rgb, intensity[i], amplitude[i], time[i])
}

#[test]
fn leaves_are_named_by_their_paths() {
    let tree = Bintree::open(golden("files")).unwrap();
    let names: Vec<String> = tree.leaves().map(|leaf| tree.leaf_name(leaf)).collect();
    let expected = ["n00", "n0100", "n01010", "n01011", "n011", "n100", "n101", "n11"];
    assert_eq!(names, expected.map(|n| format!("{n}.bin")));
    assert!(matches!(tree.nodes()[11].kind, NodeKind::Degenerate { high: 13 }));
}

/// Section 11 quotes bytes; they are those of the files.
#[test]
fn the_worked_example_of_the_page_is_what_the_files_hold() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats/bintree.md");
    let page = std::fs::read_to_string(page).unwrap();
    let (files, packed) = (load("files"), load("packed"));
    let mut quoted = 0;
    for line in page.lines() {
        if let Some(text) = line.strip_prefix("index.json: ") {
            let all = [&files, &packed].map(|f| String::from_utf8(f["index.json"].clone()).unwrap());
            assert!(all.iter().any(|index| index.lines().any(|l| l == text)), "{line}");
            quoted += 1;
        } else if let Some((place, rest)) = line.split_once(": ")
            && let Some((file, at)) = place.split_once(".bin ")
        {
            let file = format!("{file}.bin");
            let at: usize = at.parse().unwrap();
            let hex = rest.split("  ").next().unwrap().split(' ');
            let bytes: Vec<u8> = hex.map(|b| u8::from_str_radix(b, 16).unwrap()).collect();
            let found = files.get(&file).unwrap_or_else(|| &packed[&file]);
            assert_eq!(&found[at..at + bytes.len()], bytes, "{line}");
            quoted += 1;
        }
    }
    assert_eq!(quoted, 19);
}
