//! What is written is read: by the reader of scans, by the reader of octrees, and by the crates `las` and `laz`.

use std::collections::BTreeMap;
use std::io::Cursor;

use laz::LazVlr;
use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::record::{LayeredPointRecordCompressor, RecordCompressor};
use pointmill_format::copc::{Dataset, Heading, Info, Summary};
use pointmill_format::octree::Octree;
use pointmill_format::potree2::NodeEntry;
use pointmill_format::{
    Aabb, Attribute, AttributeType, Lattice, NodeKey, OpenOptions, ReadError, Wanted, WriteError, open_scan,
};
use pointmill_testkit::Random;
use pointmill_testkit::files::temporary;

use crate::oracle::assert_same;
use crate::util::{open, read_all, walk};

const LATTICE: Lattice = Lattice { scale: [0.001, 0.001, 0.01], offset: [500_000.0, 4_000_000.0, 0.0] };
const WKT: &str = "PROJCS[\"Höhe\",UNIT[\"metre\",1]]";

fn info() -> Info {
    Info {
        center: [500_008.0, 4_000_008.0, 8.0],
        half_size: 8.0,
        spacing: 0.125,
        root_page_offset: 0,
        root_page_size: 0,
        gps_time: [0.0; 2],
    }
}

fn heading(point_format: u8) -> Heading {
    let mut heading = Heading::new(point_format, LATTICE).unwrap();
    let mut amplitude = Attribute::new("Amplitude", AttributeType::UInt16, 1);
    (amplitude.scale, amplitude.offset, amplitude.no_data) = (vec![0.01], vec![-5.0], Some(vec![65_535.0]));
    amplitude.description = "of the echo".into();
    let mut beam = Attribute::new("beam", AttributeType::Float32, 3);
    beam.description = "direction".into();
    heading.extra_bytes = if point_format == 6 { Vec::new() } else { vec![amplitude, beam] };
    heading.wkt = Some(WKT.into());
    heading
}

/// Nodes of a tree with their records: the root, all its children but one, and a deep branch with a node without points.
fn nodes(heading: &Heading, random: &mut Random) -> BTreeMap<String, Vec<u8>> {
    let names = ["r", "r0", "r1", "r2", "r3", "r5", "r6", "r7", "r34", "r347", "r3470", "r34701"];
    let counts = [3000, 1, 2, 600, 0, 513, 7, 1024, 90, 1, 70_000, 12];
    names.iter().zip(counts).map(|(name, count)| ((*name).into(), records(heading, name, count, random))).collect()
}

/// Records of random fields inside of their node.
fn records(heading: &Heading, name: &str, count: usize, random: &mut Random) -> Vec<u8> {
    let cube = info().cube().octant(name.parse().unwrap());
    let mut out = Vec::new();
    for i in 0..count {
        let start = out.len();
        for axis in 0..3 {
            let side = cube.max[axis] - cube.min[axis];
            let place = cube.min[axis] + side * (random.index(1000) as f64 / 1000.0);
            out.extend((LATTICE.quantize(axis, place) as i32).to_le_bytes());
        }
        out.extend(
            (0..heading.record_len() - 12).map(|_| if i % 50 == 0 { random.index(256) as u8 } else { i as u8 / 9 }),
        );
        // a time, not whatever
        out[start + 22..start + 30].copy_from_slice(&(i as f64 * 0.25 + 1000.0).to_le_bytes());
    }
    out
}

fn compress(vlr: &LazVlr, records: &[u8]) -> Vec<u8> {
    let mut encoder = LayeredPointRecordCompressor::new(Cursor::new(Vec::new()));
    encoder.set_fields_from(vlr.items()).unwrap();
    encoder.compress_many(records).unwrap();
    encoder.done().unwrap();
    Box::new(encoder).box_into_inner().into_inner()
}

/// The file, with the chunks of its nodes in the order of `order`.
struct Made {
    bytes: Vec<u8>,
    entries: Vec<NodeEntry>,
    table: Vec<u8>,
    summary: Summary,
}

fn write(heading: &Heading, nodes: &BTreeMap<String, Vec<u8>>) -> Made {
    let vlr = LazVlr::from_buffer(heading.laszip_record().unwrap()).unwrap();
    let start = heading.chunks_start().unwrap();
    let (mut chunks, mut table, mut entries) = (Vec::new(), ChunkTable::with_capacity(nodes.len()), Vec::new());
    // the last names first: any order will do
    for (name, records) in nodes.iter().rev() {
        let (key, points) = (name.parse().unwrap(), records.len() / heading.record_len());
        if points == 0 {
            entries.push(NodeEntry::new(key, 0, 0, 0));
            continue;
        }
        let chunk = compress(&vlr, records);
        entries.push(NodeEntry::new(key, points as u32, start + chunks.len() as u64, chunk.len() as u64));
        table.push(ChunkTableEntry { point_count: points as u64, byte_count: chunk.len() as u64 });
        chunks.extend(chunk);
    }
    let mut table_bytes = Vec::new();
    table.write_to(&mut table_bytes, &vlr).unwrap();
    let points = entries.iter().map(|e| u64::from(e.points)).sum();
    let bounds = Aabb { min: [500_000.0, 4_000_000.0, 0.0], max: [500_016.0, 4_000_016.0, 16.0] };
    let mut points_by_return = [0; 15];
    points_by_return[0] = points;
    let summary = Summary { points, points_by_return, bounds, gps_time: [1000.0, 18_499.75] };
    let ending = heading.finish(info(), &summary, &mut entries.clone(), &table_bytes).unwrap();
    assert_eq!((ending.head.len() as u64, ending.tail_start), (start, start + chunks.len() as u64));
    let bytes = [&ending.head[..], &chunks, &ending.tail].concat();
    Made { bytes, entries, table: table_bytes, summary }
}

#[test]
fn every_node_comes_back_with_all_its_records_in_every_format() {
    for point_format in [6, 7, 8] {
        let heading = heading(point_format);
        let nodes = nodes(&heading, &mut Random::new(u64::from(point_format)));
        let Made { bytes, .. } = write(&heading, &nodes);
        let dataset = open(&bytes).unwrap();
        assert_eq!(dataset.warnings(), []);
        assert_eq!(
            (dataset.crs().wkt.as_deref(), dataset.lattice(), dataset.point_format()),
            (Some(WKT), LATTICE, point_format)
        );
        let extra: Vec<Attribute> =
            dataset.info().attributes.iter().rev().take(heading.extra_bytes.len()).rev().cloned().collect();
        assert_eq!(extra, heading.extra_bytes);
        assert_eq!((dataset.copc_info().cube(), dataset.copc_info().gps_time), (info().cube(), [1000.0, 18_499.75]));
        assert_eq!(walk(&dataset).unwrap(), nodes.keys().cloned().collect::<Vec<_>>());
        for (name, points) in read_all(&dataset).unwrap() {
            let len = heading.record_len();
            let records = &nodes[&name];
            assert_eq!(points.len(), records.len() / len, "{name}");
            let [x, _, z] = points.quantized().unwrap();
            let (flags, times) =
                (points.column::<u8>("classification").unwrap(), points.column::<f64>("gps-time").unwrap());
            for (i, record) in records.chunks_exact(len).enumerate() {
                assert_eq!(
                    (x[i].to_le_bytes(), z[i].to_le_bytes()),
                    (record[..4].try_into().unwrap(), record[8..12].try_into().unwrap())
                );
                assert_eq!((flags[i], times[i].to_le_bytes()), (record[16], record[22..30].try_into().unwrap()));
                if point_format > 6 {
                    let amplitude = points.column::<u16>("Amplitude").unwrap()[i].to_le_bytes();
                    let blue = points.column::<u16>("rgb").unwrap()[3 * i + 2].to_le_bytes();
                    assert_eq!((&amplitude[..], &blue[..]), (&record[len - 14..len - 12], &record[34..36]));
                }
            }
        }
    }
}

#[test]
fn the_scan_reader_and_the_las_crate_read_the_same() {
    for point_format in [6, 7, 8] {
        let heading = heading(point_format);
        let Made { bytes, summary, .. } = write(&heading, &nodes(&heading, &mut Random::new(3)));
        let file = temporary(&bytes);
        let scan = open_scan(&file, &OpenOptions::default()).unwrap();
        assert_eq!((scan.info().points_declared, &scan.info().warnings[..]), (summary.points, &[][..]));
        assert_eq!(scan.info().bounds_declared, Some(summary.bounds));
        assert_eq!(scan.info().format, format!("COPC, LAZ 1.4, point format {point_format}"));
        let batches: Result<Vec<_>, ReadError> = scan.batches(Wanted::all(scan.info())).collect();
        assert_eq!(batches.unwrap().iter().map(|b| b.len() as u64).sum::<u64>(), summary.points);
        assert_eq!(assert_same(&file) as u64, summary.points);
    }
}

#[test]
fn a_large_hierarchy_is_cut_into_pages_of_a_usual_size() {
    let heading = heading(6);
    let mut nodes = BTreeMap::new();
    let mut names = vec!["r".to_owned()];
    for level in 0..5 {
        let children: Vec<String> = names
            .iter()
            .filter(|n| n.len() == level + 1)
            .flat_map(|n| (0..8).map(move |c| format!("{n}{c}")))
            .collect();
        names.extend(children.into_iter().take(6000));
    }
    let record = records(&heading, "r", 1, &mut Random::new(1));
    names.iter().for_each(|name| drop(nodes.insert(name.clone(), record.clone())));
    let dataset = open(&write(&heading, &nodes).bytes).unwrap();
    let root = dataset.read_root_page().unwrap();
    assert!(root.len() <= 4681 && root.iter().any(|node| node.is_proxy), "{}", root.len());
    assert_eq!(dataset.read_hierarchy().unwrap().len(), names.len());
    names.sort();
    assert_eq!(walk(&dataset).unwrap(), names);
}

#[test]
fn what_cannot_be_written_is_refused() {
    let heading = heading(7);
    let Made { entries, table, summary, .. } = write(&heading, &nodes(&heading, &mut Random::new(5)));
    let finish = |info: Info, summary: &Summary, mut entries: Vec<NodeEntry>, table: &[u8]| {
        heading.finish(info, summary, &mut entries, table).unwrap_err().to_string()
    };
    let changed = |change: fn(&mut Vec<NodeEntry>)| {
        let mut entries = entries.clone();
        change(&mut entries);
        entries
    };
    for (entries, part) in [
        (changed(|e| e[0].byte_offset += 1), "is not at byte"),
        (changed(|e| e[0].points += 1), "the chunk table is not that of the nodes"),
        (changed(|e| e[0].key = NodeKey::ROOT), "no tree"),
        (changed(|e| e.truncate(e.len() - 1)), "the chunk table is not that of the nodes"),
        (changed(|e| e.retain(|node| node.points > 0)), "no tree"),
    ] {
        let fault = finish(info(), &summary, entries, &table);
        assert!(fault.contains(part), "{fault}");
    }
    assert!(finish(info(), &Summary { points: 1, ..summary }, entries.clone(), &table).contains("points, 1 are to be"));
    assert!(finish(Info { spacing: 0.0, ..info() }, &summary, entries.clone(), &table).contains("spacing"));
    assert!(finish(info(), &summary, entries.clone(), &table[..12]).contains("chunk table"));
    assert!(matches!(Heading::new(3, LATTICE), Err(WriteError::Input(_))));
    let mut wide = heading.clone();
    wide.extra_bytes[1].elements = 4;
    assert!(wide.chunks_start().unwrap_err().to_string().contains("three"));
}

#[test]
fn what_a_record_cannot_hold_is_in_an_extended_one() {
    let mut heading = heading(7);
    let start = heading.chunks_start().unwrap();
    let long = WKT.replacen("PROJCS[\"", &format!("PROJCS[\"{}", "x".repeat(70_000)), 1);
    (heading.wkt, heading.making) = (Some(long.clone()), "{\"version\":\"1\"}".into());
    assert!(heading.chunks_start().unwrap() < start, "the record is behind the chunks");
    let nodes = nodes(&heading, &mut Random::new(9));
    let Made { bytes, .. } = write(&heading, &nodes);
    let dataset = open(&bytes).unwrap();
    assert_eq!((dataset.crs().wkt.as_deref(), dataset.warnings()), (Some(&*long), &[][..]));
    assert_eq!(walk(&dataset).unwrap(), nodes.keys().cloned().collect::<Vec<_>>());
    assert!(bytes.ends_with(heading.making.as_bytes()));
    assert_eq!(bytes[243..247], 3u32.to_le_bytes());
}

#[test]
fn the_same_nodes_give_the_same_bytes_in_any_order() {
    let heading = heading(8);
    let Made { mut entries, table, summary, .. } = write(&heading, &nodes(&heading, &mut Random::new(7)));
    let first = heading.finish(info(), &summary, &mut entries, &table).unwrap();
    entries.reverse();
    assert_eq!(heading.finish(info(), &summary, &mut entries, &table).unwrap(), first);
    let dataset = Dataset::open(temporary(&first.head)).err();
    assert!(dataset.is_none(), "the head alone has the records: {dataset:?}");
}
