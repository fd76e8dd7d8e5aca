//! The golden files, whose values another reader has read.

use pointmill_format::copc::{Dataset, detect, is_copc};
use pointmill_format::octree::Octree;
use pointmill_format::{Column, DatasetKind, NodePoints, OpenOptions, open_octree, open_scan, with_column};
use pointmill_testkit::files::{fixture, fixture_bytes};

use crate::util::{FIXTURES, golden, load, open, read_all, walk};

const NAMES: [&str; 7] = ["r", "r0", "r2", "r5", "r07", "r075", "r0754"];
const COUNTS: [u64; 7] = [7, 0, 1, 3, 4, 5, 2];

/// The values of a column as text, as the script writes them.
fn text(points: &NodePoints, column: &str) -> Vec<String> {
    if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == column) {
        return points.quantized().unwrap()[axis].iter().map(ToString::to_string).collect();
    }
    let index = points.names().position(|name| name == column).unwrap_or_else(|| panic!("no {column}"));
    match &points.columns()[index] {
        // as the float that it is, in double precision
        Column::Float32(values) => values.iter().map(|v| format!("{:?}", f64::from(*v))).collect(),
        Column::Float64(values) => values.iter().map(|v| format!("{v:?}")).collect(),
        other => with_column!(other, values => values.iter().map(ToString::to_string).collect()),
    }
}

#[test]
fn every_value_of_every_node_is_that_of_another_reader() {
    let expected = String::from_utf8(fixture_bytes("copc/expected.tsv")).unwrap();
    let (mut rows, mut columns) = (0, 0);
    for name in FIXTURES {
        let nodes = read_all(&Dataset::open(golden(name)).unwrap()).unwrap();
        for row in expected.lines().filter(|row| row.starts_with(name)) {
            let [_, node, column, values] = row.split('\t').collect::<Vec<_>>()[..] else { panic!("{row}") };
            let (_, points) = nodes.iter().find(|(name, _)| name == node).unwrap();
            assert_eq!(text(points, column), values.split(' ').collect::<Vec<_>>(), "{name} {node} {column}");
            rows += 1;
        }
        columns += 3 + nodes[0].1.columns().len();
    }
    // nothing is read that was not compared: six nodes have points
    assert_eq!((rows, columns), (6 * columns, 15 + 18 + 17));
}

#[test]
fn nodes_have_their_pages_children_counts_and_boxes() {
    for name in FIXTURES {
        let dataset = Dataset::open(golden(name)).unwrap();
        let nodes = dataset.read_hierarchy().unwrap();
        let keys: Vec<String> = nodes.iter().map(|node| node.key.to_string()).collect();
        assert_eq!(keys, NAMES, "{name}");
        assert!(nodes.iter().map(|node| node.points).eq(COUNTS), "{name}");
        assert!(nodes.iter().map(|node| node.child_mask).eq([0b10_0101, 0x80, 0, 0, 1 << 5, 1 << 4, 0]), "{name}");
        assert_eq!(walk(&dataset).unwrap(), ["r", "r0", "r07", "r075", "r0754", "r2", "r5"]);
        for (node, points) in nodes.iter().zip(read_all(&dataset).unwrap()) {
            let node_box = dataset.info().node_box(node.key);
            assert!((0..points.1.len()).all(|i| node_box.contains(points.1.world(i).unwrap())), "{name} {}", node.key);
        }
    }
    let dataset = Dataset::open(golden("pages")).unwrap();
    let page: Vec<(String, bool)> =
        dataset.read_root_page().unwrap().iter().map(|n| (n.key.to_string(), n.is_proxy)).collect();
    assert_eq!(page, [("r", false), ("r0", true), ("r2", false), ("r5", false)].map(|(n, p)| (n.to_owned(), p)));
}

#[test]
fn what_a_file_says_of_itself() {
    let dataset = Dataset::open(golden("pages")).unwrap();
    let info = dataset.info();
    assert_eq!(info.format, "COPC, LAZ 1.4, point format 7");
    assert_eq!((info.points, info.spacing, info.spacing_at(3)), (Some(22), 0.5, 0.0625));
    assert_eq!(info.cube.min, [500_000.0, 4_000_000.0, -32.0]);
    assert_eq!(info.cube.max, [500_016.0, 4_000_016.0, -16.0]);
    assert_eq!(dataset.crs().wkt.as_deref(), Some("PROJCS[\"fixture\",GEOGCS[\"WGS 84\"],UNIT[\"metre\",1]]"));
    assert_eq!(dataset.lattice().scale, [0.001; 3]);
    assert_eq!((dataset.point_format(), dataset.warnings()), (7, &[][..]));
    let amplitude = info.attributes.iter().find(|a| a.name == "Amplitude").unwrap();
    assert_eq!((&amplitude.scale[..], &amplitude.offset[..]), (&[0.5][..], &[-10.0][..]));
    let [first, last] = dataset.copc_info().gps_time;
    let times = read_all(&dataset).unwrap();
    let mut times: Vec<f64> = times.iter().flat_map(|(_, p)| p.column::<f64>("gps-time").unwrap().to_vec()).collect();
    times.sort_by(f64::total_cmp);
    assert_eq!((first, last), (times[0], times[21]));
}

#[test]
fn the_octree_has_the_columns_and_points_of_the_scan() {
    for name in FIXTURES {
        let scan = open_scan(golden(name), &OpenOptions::default()).unwrap();
        let dataset = Dataset::open(golden(name)).unwrap();
        assert_eq!(dataset.info().attributes, scan.info().attributes.to_vec());
        let points: u64 = scan.pieces().iter().map(|piece| piece.points).sum();
        assert_eq!(points, COUNTS.iter().sum::<u64>());
    }
}

#[test]
fn a_copc_file_is_known_by_its_content() {
    for name in FIXTURES {
        assert_eq!(DatasetKind::detect(golden(name)), Some(DatasetKind::Copc), "{name}");
        assert!(detect(golden(name)) && is_copc(&load(name)[..395]) && !is_copc(&load(name)[..394]), "{name}");
        assert_eq!(walk(&*open_octree(golden(name)).unwrap()).unwrap().len(), 7);
    }
    let plain = fixture("las/format7.laz");
    assert!(!detect(&plain) && !detect("nowhere.copc.laz") && !is_copc(b""));
    assert!(open_octree(&plain).is_err());
    let fault = Dataset::open(&plain).unwrap_err().to_string();
    assert!(
        fault.ends_with("LAZ 1.4, point format 7 without the info record of COPC: no octree; read it as a scan"),
        "{fault}"
    );
    let fault = Dataset::open(fixture("las/format7.las")).unwrap_err().to_string();
    assert!(fault.contains("its points are not in layered chunks"), "{fault}");
}

#[test]
fn memory_is_reused_from_node_to_node_and_file_to_file() {
    let mut points = NodePoints::default();
    for name in FIXTURES {
        let dataset = open(&load(name)).unwrap();
        for (node, fresh) in dataset.read_hierarchy().unwrap().iter().zip(read_all(&dataset).unwrap()) {
            dataset.points(node, &mut points).unwrap();
            assert_eq!((points.positions(), points.columns()), (fresh.1.positions(), fresh.1.columns()));
            assert_eq!(points.stored_bytes().len() as u64, node.byte_size);
        }
    }
}

/// The lines of §9 of the page, as `offset: bytes`.
#[test]
fn the_worked_example_of_the_page_is_in_the_file() {
    let (bytes, page) = (load("pages"), include_str!("../../../../docs/formats/copc.md"));
    let (_, example) = page.split_once("A worked example\n\n").unwrap();
    let mut lines = 0;
    for line in example.lines() {
        let Some((Ok(offset), values)) = line.split_once(": ").map(|(at, values)| (at.parse::<usize>(), values)) else {
            continue;
        };
        let values: Vec<u8> = values.split(' ').map(|b| u8::from_str_radix(b, 16).unwrap()).collect();
        assert_eq!(bytes[offset..offset + values.len()], values, "{line}");
        lines += 1;
    }
    assert_eq!(lines, 11);
}
