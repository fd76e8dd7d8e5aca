//! Quantised batches: every slot, every plane, every level.

use std::io::Cursor;
use std::path::PathBuf;

use pointmill_format::Lattice;
use pointmill_format::batches::{
    AlignedBytes, BATCH_POINTS, Batches, Cloud, Precision, WriteOptions, compress, lod_of, write,
};
use pointmill_testkit::files::fixture;

use super::client::serve;
use super::decode::{batch_points, rows, units};

const FILES: [&str; 4] = ["example", "coarse", "far", "empty"];

/// Three batches in a file, the last one short.
pub(crate) fn three_batches(folder: &tempfile::TempDir, is_compressed: bool) -> PathBuf {
    let lattice = Lattice { scale: [0.01; 3], offset: [500_000.0, 0.0, 0.0] };
    let count = 2 * i64::from(BATCH_POINTS) + 321;
    let x: Vec<i64> = (0..count).map(|i| i % 256 * 100).collect();
    let y: Vec<i64> = (0..count).map(|i| i / 256 * 100).collect();
    let z = vec![0; count as usize];
    let colours: Vec<u32> = (0..count as u32).collect();
    let mut file = Cursor::new(Vec::new());
    let options = WriteOptions::new(lattice).cell(8.0).precision(Precision::Thirty);
    write(&mut file, &Cloud::new(lattice, [&x, &y, &z], &colours), &options).unwrap();
    let mut bytes = file.into_inner();
    if is_compressed {
        let raw = Batches::from_bytes(AlignedBytes::from(&bytes[..]), "three").unwrap();
        let mut out = Cursor::new(Vec::new());
        compress(&raw, &mut out, 3, 1).unwrap();
        bytes = out.into_inner();
    }
    let path = folder.path().join("three.qbatch");
    std::fs::write(&path, bytes).unwrap();
    path
}

fn check(path: &std::path::Path) {
    let (served, file) = (serve(&[path]), Batches::open(path).unwrap());
    let shown = path.display();
    let mut scratch = Default::default();
    let found = rows(&served.bytes("/api/0/nodes"));
    assert_eq!(found.len(), file.records().len());
    for ((slot, record), row) in (0u32..).zip(file.records()).zip(&found) {
        let min = file.world(record.min.map(f64::from));
        assert_eq!((row.min, row.max), (min, file.world(record.max.map(f64::from))), "{shown}");
        assert_eq!((row.points, row.unit), (record.points, slot));
        let colours = file.batch_words(pointmill_format::batches::Part::Colour, slot, &mut scratch).unwrap().to_vec();
        let up_to = |level| colours.iter().filter(|word| lod_of(**word) <= level).count() as u16;
        assert_eq!(row.by_level, [up_to(0), up_to(1), up_to(2), up_to(3)], "{shown}");
        for (planes, levels) in [(1, "0-255"), (2, "0-1"), (3, "2-3"), (3, "0-255")] {
            let bytes = served.bytes(&format!("/api/0/batches?units={slot}&planes={planes}&lods={levels}"));
            let unit = units(&bytes);
            let (header, body) = &unit[0];
            let there = planes.min(file.header().precision().planes() as usize);
            assert_eq!((header.flags as usize, header.total), (there, record.points as usize));
            assert_eq!((header.origin, header.step), (min, record.sides()), "{shown}");
            let ends: Vec<u8> = levels.split('-').map(|level| level.parse().unwrap()).collect();
            let expected: Vec<usize> =
                (0..colours.len()).filter(|i| (ends[0]..=ends[1]).contains(&lod_of(colours[*i]))).collect();
            let points = batch_points(header, body);
            assert_eq!(points.iter().map(|p| usize::from(p.index)).collect::<Vec<_>>(), expected, "{shown}");
            let parts = [
                pointmill_format::batches::Part::Hi10,
                pointmill_format::batches::Part::Mid10,
                pointmill_format::batches::Part::Lo10,
            ];
            for (plane, part) in parts.into_iter().take(there).enumerate() {
                let words = file.batch_words(part, slot, &mut scratch).unwrap();
                assert!(points.iter().zip(&expected).all(|(p, i)| p.planes[plane] == words[*i]), "{shown}");
            }
            assert!(points.iter().zip(&expected).all(|(p, i)| p.colour == colours[*i]));
        }
    }
}

#[test]
fn words_are_those_of_the_file() {
    FILES.iter().for_each(|name| check(&fixture(&format!("batches/{name}.qbatch"))));
    let folder = tempfile::tempdir().unwrap();
    check(&three_batches(&folder, false));
}

#[test]
fn compressed_sections_are_decompressed() {
    check(&fixture("batches/blocks.qbatch"));
    let folder = tempfile::tempdir().unwrap();
    check(&three_batches(&folder, true));
}

#[test]
fn values_and_points_are_exact() {
    let path = fixture("batches/example.qbatch");
    let (served, file) = (serve(&[&path]), Batches::open(&path).unwrap());
    let scene = served.json("/api/0/scene");
    for (i, attribute) in file.attributes().enumerate() {
        let least = scene["attributes"][i]["min"][0].as_f64().unwrap_or(0.0);
        let bytes = served.bytes(&format!("/api/0/batches?units=0&attribute={}", attribute.name.replace(' ', "%20")));
        let unit = units(&bytes);
        for point in batch_points(&unit[0].0, unit[0].1) {
            let answer = served.json(&format!("/api/0/point?unit=0&index={}", point.index));
            let all = answer["attributes"].as_array().unwrap();
            let exact = all.iter().find(|a| a["name"] == *attribute.name).unwrap()["values"][0].as_f64().unwrap();
            assert_eq!(point.value, Some((exact - least) as f32), "{}", attribute.name);
            let position = file.position(point.index.into(), file.header().precision()).unwrap();
            assert_eq!(answer["position"], serde_json::json!(position));
        }
    }
}

#[test]
fn what_is_no_batch_is_named() {
    let served = serve(&[&fixture("batches/example.qbatch")]);
    for (target, expected) in [
        ("/api/0/batches?units=1", 404),
        ("/api/0/batches?units=4294967296", 400),
        ("/api/0/batches", 400),
        ("/api/0/points?units=0", 400),
        ("/api/0/nodes?of=r", 400),
        ("/api/0/point?unit=0&index=6", 404),
        ("/api/0/point?unit=9&index=0", 404),
        ("/api/0/batches?units=0&attribute=x", 400),
    ] {
        assert_eq!(served.refused(target).0, expected, "{target}");
    }
    let many = vec!["0"; 4097].join(",");
    assert_eq!(served.refused(&format!("/api/0/batches?units={many}")).0, 400);
}
