//! Datasets that PotreeConverter 2.1.1 wrote, with its faults, against the scans that they were made from.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::Path;

use pointmill_format::potree2::{
    BrotliScratch, CHUNK_RECORDS, Dataset, Encoding, NodeEntry, encode_brotli, encode_hierarchy,
};
use pointmill_format::{Attribute, Column, NodeKey, NodePoints, with_column};
use pointmill_testkit::files::corpus;

use crate::util::memory;

/// What distinguishes points of a scan, nearly: bits of the GPS time, intensity, return number.
type Label = (u64, u16, u8);

/// Points as X, Y, Z in units of the LAS file.
type Points = HashMap<Label, Vec<[i64; 3]>>;

fn dataset_points(dataset: &Dataset, las: &las::Header) -> Points {
    let metadata = dataset.metadata();
    let column = |name| metadata.attributes.iter().skip(1).position(|a| a.attribute.name == name).unwrap();
    let columns = ["gps-time", "intensity", "return number"].map(column);
    let transforms = [las.transforms().x, las.transforms().y, las.transforms().z];
    let mut all = Points::new();
    let mut points = NodePoints::default();
    for node in dataset.read_hierarchy().unwrap() {
        dataset.read_points(&node, &mut points).unwrap();
        let [Column::Float64(time), Column::UInt16(intensity), Column::UInt8(number)] =
            columns.map(|c| &points.columns()[c])
        else {
            panic!("columns of other types");
        };
        for i in 0..points.len() {
            let world = points.world(i).unwrap();
            let units = |a: usize| ((world[a] - transforms[a].offset) / transforms[a].scale).round() as i64;
            all.entry((time[i].to_bits(), intensity[i], number[i])).or_default().push([0, 1, 2].map(units));
        }
    }
    all
}

fn las_points(path: &Path) -> (las::Header, Points) {
    let mut reader = las::Reader::from_path(path).unwrap();
    let header = reader.header().clone();
    let points = reader.read_all().unwrap();
    let labels = points.gps_time().unwrap().zip(points.intensity()).zip(points.return_number());
    let positions = points.x_raw().zip(points.y_raw()).zip(points.z_raw());
    let mut all = Points::new();
    for (((x, y), z), ((time, intensity), number)) in positions.zip(labels) {
        all.entry((time.to_bits(), intensity, number)).or_default().push([x, y, z].map(i64::from));
    }
    (header, all)
}

/// Every point of the dataset has its own in the scan, off by a number of units in `off` on each axis, and both ends of
/// `off` are met.
fn compare(dataset: &str, source: &str, points: usize, off: RangeInclusive<i64>) {
    let (Some(dataset), Some(source)) = (corpus(&format!("potree2/{dataset}")), corpus(&format!("las/{source}")))
    else {
        return;
    };
    let dataset = Dataset::open(&dataset).unwrap();
    let (header, mut source) = las_points(&source);
    let found = dataset_points(&dataset, &header);
    assert_eq!(found.values().map(Vec::len).sum::<usize>(), points);
    assert_eq!(source.values().map(Vec::len).sum::<usize>(), points);
    let mut met = [0; 2];
    for (label, positions) in found {
        let candidates = source.get_mut(&label).unwrap_or_else(|| panic!("no point {label:?} in the scan"));
        for position in positions {
            let fits = |c: &[i64; 3]| (0..3).all(|a| off.contains(&(position[a] - c[a])));
            let fit =
                candidates.iter().position(fits).unwrap_or_else(|| panic!("{position:?} not among {candidates:?}"));
            let candidate = candidates.swap_remove(fit);
            for (met, end) in met.iter_mut().zip([off.start(), off.end()]) {
                *met += usize::from((0..3).any(|a| position[a] - candidate[a] == *end));
            }
        }
    }
    assert!(met.iter().all(|n| *n > 0), "{met:?}");
}

/// PotreeConverter cuts the fraction off when it quantises, which moves most of these points down by a unit.
#[test]
fn a_default_dataset_holds_every_point_of_its_scan() {
    compare("color_1065_DEFAULT", "1.2-with-color.las", 1065, -1..=0);
}

/// In BROTLI, PotreeConverter adds a unit to every coordinate. That is in the bytes; the reader gives them as they are.
#[test]
fn a_brotli_dataset_holds_every_point_of_its_scan_one_unit_further_up() {
    compare("color_1065_BROTLI", "1.2-with-color.las", 1065, 0..=1);
    compare("autzen_trim_BROTLI", "autzen_trim.laz", 110_000, 0..=1);
}

/// The two encodings of one scan: the same nodes, columns and, but for the shift, positions.
#[test]
fn both_encodings_of_a_scan_give_the_same_columns() {
    let (Some(default), Some(brotli)) = (corpus("potree2/color_1065_DEFAULT"), corpus("potree2/color_1065_BROTLI"))
    else {
        return;
    };
    let [default, brotli] = [default, brotli].map(|path| {
        let dataset = Dataset::open(&path).unwrap();
        let shift = i32::from(dataset.metadata().encoding == Encoding::Brotli);
        let mut rows = Vec::new();
        let mut points = NodePoints::default();
        for node in dataset.read_hierarchy().unwrap() {
            dataset.read_points(&node, &mut points).unwrap();
            let columns: Vec<Vec<u64>> = points.columns().iter().map(bits).collect();
            for i in 0..points.len() {
                let position = [0, 1, 2].map(|a| points.quantized().unwrap()[a][i] - shift);
                let values: Vec<u64> = columns
                    .iter()
                    .flat_map(|c| {
                        let elements = c.len() / points.len();
                        c[i * elements..(i + 1) * elements].to_vec()
                    })
                    .collect();
                rows.push((position, values));
            }
        }
        rows.sort_unstable();
        rows
    });
    assert_eq!(default.len(), 1065);
    assert!(default == brotli, "the rows differ");
}

fn bits(column: &Column) -> Vec<u64> {
    match column {
        Column::UInt8(v) => v.iter().map(|v| u64::from(*v)).collect(),
        Column::UInt16(v) => v.iter().map(|v| u64::from(*v)).collect(),
        Column::Float64(v) => v.iter().map(|v| v.to_bits()).collect(),
        other => panic!("no such column in these datasets: {:?}", other.ty()),
    }
}

/// The faults are there (inner nodes marked as leaves, leaves without points) and do no harm.
#[test]
fn wrong_types_and_empty_nodes_of_the_reference_are_read_as_meant() {
    let Some(path) = corpus("potree2/color_1065_DEFAULT") else { return };
    let dataset = Dataset::open(&path).unwrap();
    let nodes = dataset.read_hierarchy().unwrap();
    let mistyped = nodes.iter().filter(|n| (n.record.node_type == 1) != (n.record.child_mask == 0)).count();
    let empty = nodes.iter().filter(|n| n.record.points == 0).count();
    let depth = nodes.iter().map(|n| u32::from(n.key.level)).max();
    assert!(mistyped > 0 && empty > 0, "{mistyped} {empty}");
    assert!(depth > Some(dataset.metadata().depth), "{depth:?}");
    let mut points = NodePoints::default();
    for node in nodes.iter().filter(|n| n.record.points == 0) {
        dataset.read_points(node, &mut points).unwrap();
        assert!(points.is_empty());
    }
    let has_root = nodes.first().is_some_and(|n| n.key == NodeKey::ROOT);
    assert!(has_root && nodes.iter().all(|n| !n.record.is_proxy()));
}

/// DEFAULT records of the points, `position` first as these datasets have it.
fn records(points: &NodePoints) -> Vec<u8> {
    let mut records = Vec::new();
    for i in 0..points.len() {
        records.extend(points.quantized().unwrap().iter().flat_map(|axis| axis[i].to_le_bytes()));
        for column in points.columns() {
            let elements = column.len() / points.len();
            with_column!(column, v => records.extend(v[i * elements..(i + 1) * elements].iter().flat_map(|v| v.to_le_bytes())));
        }
    }
    records
}

/// Our encoders on what the reference's files hold: the same tree, the same order of positions, the same points.
#[test]
fn nodes_of_the_reference_are_encoded_to_the_same_points_in_the_same_order() {
    let Some(path) = corpus("potree2/autzen_trim_BROTLI") else { return };
    let dataset = Dataset::open(&path).unwrap();
    let attributes: Vec<Attribute> = dataset.metadata().attributes.iter().map(|a| a.attribute.clone()).collect();
    let nodes = dataset.read_hierarchy().unwrap();
    let (mut octree, mut entries) = (Vec::new(), Vec::new());
    let mut points = NodePoints::default();
    let mut scratch = BrotliScratch::default();
    for node in &nodes {
        dataset.read_points(node, &mut points).unwrap();
        let byte_offset = octree.len() as u64;
        encode_brotli(&attributes, &records(&points), 2, &mut scratch, &mut octree).unwrap();
        let byte_size = octree.len() as u64 - byte_offset;
        entries.push(NodeEntry::new(node.key, node.record.points, byte_offset, byte_size));
    }
    let hierarchy = encode_hierarchy(&mut entries, CHUNK_RECORDS);
    let mut metadata = dataset.metadata().clone();
    metadata.first_chunk_size = hierarchy.first_chunk_size;
    let files = memory(metadata.to_json().into_bytes(), hierarchy.bytes, octree);
    let ours = Dataset::from_source(files).unwrap();

    let mut again = NodePoints::default();
    let our_nodes = ours.read_hierarchy().unwrap();
    assert_eq!(our_nodes.len(), nodes.len());
    for (node, our_node) in nodes.iter().zip(&our_nodes) {
        assert_eq!((node.key, node.record.child_mask), (our_node.key, our_node.record.child_mask));
        dataset.read_points(node, &mut points).unwrap();
        ours.read_points(our_node, &mut again).unwrap();
        assert!(points.positions() == again.positions(), "{}: another order", node.key);
        let [rows, our_rows] = [&points, &again].map(|p| {
            let bytes = records(p);
            let mut rows: Vec<Vec<u8>> = bytes.chunks_exact(metadata.record_len()).map(<[u8]>::to_vec).collect();
            rows.sort_unstable();
            rows
        });
        assert!(rows == our_rows, "{}: other points", node.key);
    }
}
