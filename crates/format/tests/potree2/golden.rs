//! The golden dataset, which a script wrote from the format page alone.

use pointmill_format::NodePoints;
use pointmill_format::potree2::{Dataset, HIERARCHY_FILE, Metadata, OCTREE_FILE, encode_hierarchy};
use pointmill_format::potree2::{Hierarchy, NodeEntry};
use pointmill_format::{Column, NodeKey};

use crate::util::{golden, load};

type Row = ([i32; 3], [u16; 3], u16, u8, i16, f64, u16);

/// Node, then its points as stored: X Y Z, r g b, intensity, classification, scan angle, gps-time, Amplitude.
const POINTS: [(&str, &[Row]); 7] = [
    (
        "r",
        &[
            ([0, 0, 0], [0, 0, 0], 0, 0, -30_000, 0.5, 0),
            ([8000, 0, 1], [65_535, 256, 1], 65_535, 2, 30_000, -1.25, 1000),
            ([16_383; 3], [257, 514, 65_278], 7, 255, 0, 123_456_789.125, 65_535),
        ],
    ),
    ("r0", &[([1, 2, 3], [1, 2, 3], 100, 6, -1, 1e-300, 1)]),
    ("r7", &[([8192; 3], [4096, 0, 0], 8, 17, 1, 2.0, 2), ([8192; 3], [4096, 0, 0], 9, 17, 1, 2.0, 2)]),
    ("r00", &[([5, 0, 0], [0, 5, 0], 1, 1, 5, 5.0, 5)]),
    ("r000", &[([0, 6, 0], [0, 6, 0], 2, 1, 6, 6.0, 6)]),
    ("r0000", &[([0, 0, 7], [0, 7, 0], 3, 1, 7, 7.0, 7)]),
    (
        "r00007",
        &[
            ([512, 512, 512], [0, 8, 0], 4, 1, 8, 8.0, 8),
            ([513, 512, 512], [8, 0, 8], 7, 1, 11, 11.0, 11),
            ([1023, 600, 700], [0, 9, 0], 5, 1, 9, 9.0, 9),
            ([700, 1000, 512], [9, 9, 9], 6, 1, 10, 10.0, 10),
        ],
    ),
];

fn rows(points: &NodePoints) -> Vec<Row> {
    let [Column::UInt16(rgb), Column::UInt16(intensity), Column::UInt8(class), rest @ ..] = points.columns() else {
        panic!("columns of other types: {:?}", points.columns());
    };
    let [Column::Int16(angle), Column::Float64(time), Column::UInt16(amplitude)] = rest else {
        panic!("columns of other types: {rest:?}");
    };
    let positions = points.quantized().unwrap();
    let row = |i: usize| {
        let rgb = [0, 1, 2].map(|c| rgb[3 * i + c]);
        let position = [0, 1, 2].map(|a| positions[a][i]);
        (position, rgb, intensity[i], class[i], angle[i], time[i], amplitude[i])
    };
    (0..points.len()).map(row).collect()
}

#[test]
fn every_value_of_every_point_is_read_in_both_encodings() {
    for encoding in ["default", "brotli"] {
        let dataset = Dataset::open(golden(encoding)).unwrap();
        let nodes = dataset.read_hierarchy().unwrap();
        let mut points = NodePoints::default();
        let mut read = |node| {
            dataset.read_points(node, &mut points).unwrap();
            rows(&points)
        };
        let found: Vec<(String, Vec<Row>)> = nodes.iter().map(|n| (n.key.to_string(), read(n))).collect();
        let expected = POINTS.map(|(name, rows)| (name.to_string(), rows.to_vec()));
        assert_eq!(found, expected, "{encoding}");
    }
}

#[test]
fn the_metadata_says_what_the_script_wrote_and_survives_a_round_trip() {
    let dataset = Dataset::open(golden("default")).unwrap();
    let m = dataset.metadata();
    assert_eq!((m.name.as_str(), m.points, m.depth, m.step_size, m.first_chunk_size), ("tiny", 13, 5, 4, 66));
    assert_eq!((m.record_len(), m.planar_len()), (33, 39));
    assert_eq!((m.position_index(), m.rgb_index()), (Some(0), Some(1)));
    let amplitude = &m.attributes[6].attribute;
    assert_eq!((amplitude.scale[0], amplitude.offset[0]), (0.01, -10.0));
    assert_eq!(amplitude.description, "echo \"amplitude\", dB");
    assert_eq!(m.attributes[3].histogram.as_ref().map(|h| h[17]), Some(2));
    assert_eq!(m.extra["pointmill"]["wkt"], r#"LOCAL_CS["a \ b"]"#);

    let again = Metadata::from_json(m.to_json().as_bytes(), "again").unwrap();
    assert_eq!(&again, m);
}

#[test]
fn the_hierarchy_is_written_byte_for_byte_as_the_script_wrote_it() {
    let expected = load(&golden("default"));
    let dataset = Dataset::open(golden("default")).unwrap();
    let mut entries: Vec<NodeEntry> = dataset.read_hierarchy().unwrap().iter().map(NodeEntry::from).collect();
    entries.reverse();
    let encoded = encode_hierarchy(&mut entries, 6);
    assert_eq!(encoded.bytes, expected[HIERARCHY_FILE]);
    assert_eq!((encoded.first_chunk_size, encoded.depth), (66, 5));
}

#[test]
fn a_lazy_walk_loads_a_chunk_when_it_comes_to_its_proxy() {
    let dataset = Dataset::open(golden("default")).unwrap();
    let mut tree = Hierarchy::new(&dataset).unwrap();
    let border = NodeKey::from_name("r0").unwrap();
    assert_eq!(tree.len(), 3);
    assert!(tree.get(border).unwrap().record.is_proxy());
    assert_eq!(tree.children(border).count(), 0);
    assert_eq!(tree.load(&dataset, NodeKey::ROOT).unwrap(), 0);

    assert_eq!(tree.load(&dataset, border).unwrap(), 4);
    assert!(!tree.get(border).unwrap().record.is_proxy());
    assert_eq!(tree.children(border).map(|n| n.key.to_string()).collect::<Vec<_>>(), ["r00"]);
    assert_eq!(tree.load(&dataset, border).unwrap(), 0);
}

/// The bytes that the format page quotes, `file offset: hex  comment`, are those of the golden files.
#[test]
fn the_worked_example_of_the_format_page_is_the_golden_dataset() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/formats/potree2.md");
    let page = std::fs::read_to_string(page).unwrap();
    let files = load(&golden("default"));
    let brotli = Dataset::open(golden("brotli")).unwrap();
    let (mut payload, mut planar) = (Vec::new(), vec![0; 3 * 39]);
    brotli.read_payload(&brotli.read_root_chunk().unwrap()[0], &mut payload).unwrap();
    assert_eq!(brotlic::decompress(&payload, &mut planar).unwrap(), planar.len());

    let sources = [
        ("hierarchy.bin ", files[HIERARCHY_FILE].clone()),
        ("octree.bin ", files[OCTREE_FILE].clone()),
        ("brotli r ", planar),
    ];
    let mut quoted = [0; 3];
    for line in page.lines() {
        for ((name, bytes), quoted) in sources.iter().zip(&mut quoted) {
            let Some((offset, rest)) = line.strip_prefix(name).and_then(|rest| rest.split_once(": ")) else { continue };
            let hex = rest.split("  ").next().unwrap();
            let expected: Vec<u8> = hex.split(' ').map(|h| u8::from_str_radix(h, 16).unwrap()).collect();
            let offset: usize = offset.trim().parse().unwrap();
            assert_eq!(bytes[offset..offset + expected.len()], expected, "{line}");
            *quoted += expected.len();
        }
    }
    assert_eq!(quoted, [176, 33, 117]);
}
