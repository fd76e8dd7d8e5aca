//! The golden datasets, which a script wrote from the format page alone.

use pointmill_format::potree1::{Dataset, Field, Metadata, NodeCount, NodeFiles, encode_index};
use pointmill_format::{Aabb, NodePoints};

use crate::util::{golden, load, read_all};

type Row = ([i64; 3], [u16; 3], u16, u8, f64, u16);

/// Node, then its points: X Y Z in steps from the lower corner of the cube, r g b, intensity, classification, gps-time, Amplitude.
const POINTS: [(&str, &[Row]); 7] = [
    (
        "r",
        &[
            ([0, 0, 0], [0, 0, 0], 0, 0, 0.5, 0),
            ([8000, 0, 1], [255, 1, 2], 65_535, 2, -1.25, 1000),
            ([16_383; 3], [1, 2, 254], 7, 255, 123_456_789.125, 65_535),
        ],
    ),
    ("r0", &[([1, 2, 3], [1, 2, 3], 100, 6, 1e-300, 1)]),
    ("r7", &[([8192; 3], [40, 0, 0], 8, 17, 2.0, 2), ([8192; 3], [40, 0, 0], 9, 17, 2.0, 2)]),
    ("r00", &[([5, 0, 0], [0, 5, 0], 1, 1, 5.0, 5)]),
    ("r000", &[([0, 6, 0], [0, 6, 0], 2, 1, 6.0, 6)]),
    ("r0000", &[([0, 0, 7], [0, 7, 0], 3, 1, 7.0, 7)]),
    (
        "r00007",
        &[
            ([512, 512, 512], [0, 8, 0], 4, 1, 8.0, 8),
            ([1023, 600, 700], [0, 9, 0], 5, 1, 9.0, 9),
            ([700, 1000, 512], [9, 9, 9], 6, 1, 10.0, 10),
            ([513, 512, 512], [8, 0, 8], 7, 1, 11.0, 11),
        ],
    ),
];

/// Steps from the lower corner of the cube, and red, green, blue of 8 bits.
fn places(points: &NodePoints) -> Vec<([i64; 3], [u16; 3])> {
    let rgb = points.column::<u16>("rgb").unwrap();
    let steps = |world: [f64; 3]| [0, 1, 2].map(|a| ((world[a] - [1000.0, 2000.0, -5.0][a]) / 0.001).round() as i64);
    let colour = |i: usize| {
        let rgb = [0, 1, 2].map(|c| rgb[3 * i + c]);
        assert!(rgb.iter().all(|channel| channel % 257 == 0));
        rgb.map(|channel| channel / 257)
    };
    (0..points.len()).map(|i| (steps(points.world(i).unwrap()), colour(i))).collect()
}

fn expected_places() -> Vec<(String, Vec<([i64; 3], [u16; 3])>)> {
    POINTS.map(|(name, rows)| (name.to_owned(), rows.iter().map(|row| (row.0, row.1)).collect())).into()
}

#[test]
fn every_position_and_colour_is_read_in_every_layout() {
    for layout in ["words", "objects", "flat"] {
        let nodes = read_all(&Dataset::open(golden(layout)).unwrap()).unwrap();
        let found: Vec<_> = nodes.iter().map(|(name, points)| (name.clone(), places(points))).collect();
        assert_eq!(found, expected_places(), "{layout}");
        let (_, deep) = nodes.last().unwrap();
        // relative to the node's own box
        assert_eq!(deep.quantized().unwrap()[0], [0, 511, 188, 1], "{layout}");
    }
}

#[test]
fn further_attributes_have_the_names_and_values_of_potree_2() {
    let nodes = read_all(&Dataset::open(golden("objects")).unwrap()).unwrap();
    for ((_, points), (name, rows)) in nodes.iter().zip(POINTS) {
        assert!(points.names().eq(["rgb", "classification", "gps-time", "intensity", "Amplitude"]));
        assert!(points.column::<u16>("intensity").unwrap().iter().eq(rows.iter().map(|row| &row.2)), "{name}");
        assert!(points.column::<u8>("classification").unwrap().iter().eq(rows.iter().map(|row| &row.3)), "{name}");
        assert!(points.column::<f64>("gps-time").unwrap().iter().eq(rows.iter().map(|row| &row.4)), "{name}");
        assert!(points.column::<u16>("Amplitude").unwrap().iter().eq(rows.iter().map(|row| &row.5)), "{name}");
    }
}

#[test]
fn normals_of_two_bytes_become_three_floats_and_fillers_nothing() {
    let nodes = read_all(&Dataset::open(golden("flat")).unwrap()).unwrap();
    let (_, root) = &nodes[0];
    assert!(root.names().eq(["rgb", "NormalX", "NormalY", "NormalZ"]));
    let axis = |name| root.column::<f32>(name).unwrap().to_vec();
    let near = |found: Vec<f32>, expected: [f32; 3]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.01);
    assert!(near(axis("NormalX"), [0.0, 1.0, 0.0]) && near(axis("NormalY"), [0.0; 3]));
    assert!(near(axis("NormalZ"), [1.0, 0.0, -1.0]));
}

#[test]
fn counts_are_those_of_the_files_whatever_the_index_says() {
    let dataset = Dataset::open(golden("words")).unwrap();
    let nodes = dataset.read_hierarchy().unwrap();
    let declared: Vec<u64> = nodes.iter().map(|node| node.declared).collect();
    assert_eq!(declared, [3, 1, 0, 1, 1, 1, 0], "leaves have none");
    let counts: Vec<u64> = nodes.iter().map(|node| dataset.count(node.key).unwrap()).collect();
    assert_eq!(counts, [3, 1, 2, 1, 1, 1, 4]);
    assert!(nodes.iter().all(|node| !node.is_proxy));
}

#[test]
fn an_index_is_read_file_by_file_with_proxies_between() {
    let dataset = Dataset::open(golden("words")).unwrap();
    let index = |name: &str| {
        let nodes = dataset.read_index(name.parse().unwrap()).unwrap();
        nodes.iter().map(|n| (n.key.to_string(), n.child_mask, n.is_proxy)).collect::<Vec<_>>()
    };
    let expected = |nodes: &[(&str, u8, bool)]| nodes.iter().map(|n| (n.0.to_owned(), n.1, n.2)).collect::<Vec<_>>();
    assert_eq!(index("r"), expected(&[("r", 0x81, false), ("r0", 1, false), ("r7", 0, false), ("r00", 1, true)]));
    assert_eq!(index("r00"), expected(&[("r00", 1, false), ("r000", 1, false), ("r0000", 0x80, true)]));
    assert_eq!(index("r0000"), expected(&[("r0000", 0x80, false), ("r00007", 0, false)]));
}

#[test]
fn the_metadata_says_what_the_script_wrote_and_survives_a_round_trip() {
    let [words, objects, flat] = ["words", "objects", "flat"].map(|layout| Dataset::open(golden(layout)).unwrap());
    let m = words.metadata();
    assert_eq!((m.minor, m.points, m.step, m.scale, m.spacing), (7, Some(13), 2, 0.001, 0.128));
    assert_eq!((m.record_len(), m.octree_dir.as_str(), m.files), (16, "data", NodeFiles::Bin));
    assert_eq!(m.cube, Aabb { min: [1000.0, 2000.0, -5.0], max: [1016.384, 2016.384, 11.384] });
    assert_eq!(m.tight_box.unwrap().max, [1016.383, 2016.383, 11.383]);
    assert_eq!(objects.metadata().record_len(), 29);
    assert_eq!(objects.metadata().attributes[5].field, Field::Other);
    assert_eq!(flat.metadata().nodes.as_ref().map(Vec::len), Some(7));
    for dataset in [words, objects, flat] {
        let m = dataset.metadata();
        assert_eq!(&Metadata::from_json(m.to_json().as_bytes(), "again").unwrap(), m);
    }
}

#[test]
fn the_index_that_is_written_is_that_of_the_script() {
    let dataset = Dataset::open(golden("objects")).unwrap();
    let nodes = dataset.read_hierarchy().unwrap();
    let mut counts: Vec<NodeCount> =
        nodes.iter().map(|node| NodeCount { key: node.key, points: node.declared as u32 }).collect();
    for (layout, step) in [("objects", 5), ("words", 2)] {
        let files = load(&golden(layout));
        let metadata = Dataset::open(golden(layout)).unwrap().metadata().clone();
        let written = encode_index(&mut counts, step).unwrap();
        assert_eq!(written.len(), files.keys().filter(|name| name.ends_with(".hrc")).count(), "{layout}");
        for file in written {
            let mut bytes = files[&metadata.index_file(file.root)].clone();
            if layout == "words" {
                // the script leaves out the counts of leaves, the writer does not
                let (records, _) = bytes.as_chunks_mut::<5>();
                for (record, right) in records.iter_mut().zip(file.bytes.as_chunks::<5>().0) {
                    record[1] = right[1];
                }
            }
            assert_eq!(file.bytes, bytes, "{layout} {}", file.root);
        }
    }
}

/// The lines of §11 of the page, as `file offset: bytes`.
#[test]
fn the_worked_example_of_the_page_is_in_the_files() {
    let files = load(&golden("words"));
    let page = include_str!("../../../../docs/formats/potree1.md");
    let (_, example) = page.split_once("A worked example\n").unwrap();
    let mut lines = 0;
    for line in example.lines().filter(|line| line.starts_with("data/")) {
        let (place, bytes) = line.split_once(": ").unwrap();
        let (file, offset) = place.split_once(' ').unwrap();
        let bytes: Vec<u8> = bytes.split(' ').map_while(|b| u8::from_str_radix(b, 16).ok()).collect();
        let offset: usize = offset.trim().parse().unwrap();
        assert_eq!(files[file][offset..offset + bytes.len()], bytes, "{line}");
        lines += 1;
    }
    assert!(lines >= 8, "{lines}");
}
