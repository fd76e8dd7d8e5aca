//! Datasets as scans: `decode_bytes` is what a decode of their nodes takes, and not much more.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use pointmill_format::batches::{self, Cloud, WriteOptions};
use pointmill_format::potree2::{AttributeStats, BrotliScratch, Encoding, Metadata, encode_brotli};
use pointmill_format::{Aabb, Attribute, AttributeType, Lattice, OpenOptions, Wanted, open_scan};

use crate::decode::taken;

const POINTS: usize = 20_000;
/// What decompressors of other libraries take, which is not counted here.
const ELSEWHERE: u64 = 8 << 20;

fn attributes() -> Vec<Attribute> {
    vec![
        Attribute::new("position", AttributeType::Int32, 3),
        Attribute::new("rgb", AttributeType::UInt16, 3),
        Attribute::new("gps-time", AttributeType::Float64, 1),
    ]
}

/// What a dataset is called here, and what makes it in a folder.
type Made<'a> = (&'a str, &'a dyn Fn(&Path));

/// Records of positions, colours and times.
fn records() -> Vec<u8> {
    let mut bytes = Vec::new();
    for i in 0..POINTS as u32 {
        bytes.extend([i, i * 7 % 20_000, i % 50].map(u32::to_le_bytes).concat());
        bytes.extend([i as u16, 1, 2].map(u16::to_le_bytes).concat());
        bytes.extend(f64::from(i).to_le_bytes());
    }
    bytes
}

fn potree2(folder: &Path, encoding: Encoding) {
    let mut payload = records();
    if encoding == Encoding::Brotli {
        let mut stream = Vec::new();
        encode_brotli(&attributes(), &payload, 6, &mut BrotliScratch::default(), &mut stream).unwrap();
        payload = stream;
    }
    let lattice = Lattice { scale: [0.001; 3], offset: [0.0; 3] };
    let cube = Aabb { min: [0.0; 3], max: [32.0; 3] };
    let stats = attributes().into_iter().map(AttributeStats::new).collect();
    let mut metadata = Metadata::new(lattice, cube, 1.0, stats);
    (metadata.points, metadata.first_chunk_size, metadata.encoding) = (POINTS as u64, 22, encoding);
    let mut record = vec![1, 0];
    record.extend((POINTS as u32).to_le_bytes());
    record.extend([0, payload.len() as u64].map(u64::to_le_bytes).concat());
    fs::write(folder.join("metadata.json"), metadata.to_json()).unwrap();
    fs::write(folder.join("hierarchy.bin"), record).unwrap();
    fs::write(folder.join("octree.bin"), payload).unwrap();
}

fn potree1(folder: &Path) {
    let text = format!(
        r#"{{"version": "1.7", "octreeDir": "data", "points": {POINTS}, "spacing": 1, "scale": 0.001, "hierarchyStepSize": 5,
        "boundingBox": {{"lx": 0, "ly": 0, "lz": 0, "ux": 32, "uy": 32, "uz": 32}},
        "pointAttributes": ["POSITION_CARTESIAN", "COLOR_PACKED", "GPS_TIME"]}}"#
    );
    let nodes = folder.join("data/r");
    fs::create_dir_all(&nodes).unwrap();
    fs::write(folder.join("cloud.js"), text).unwrap();
    fs::write(nodes.join("r.hrc"), [&[0][..], &(POINTS as u32).to_le_bytes()].concat()).unwrap();
    fs::write(nodes.join("r.bin"), vec![1; 24 * POINTS]).unwrap();
}

fn bintree(folder: &Path) {
    let text = format!(
        r#"{{"format": "pointmill-bintree", "version": 1, "generator": "", "name": "", "points": {POINTS}, "capacity": {POINTS},
        "layout": "files", "split": "mean", "origin": [0, 0, 0], "projection": "",
        "lattice": {{"scale": [0.001, 0.001, 0.001], "offset": [0, 0, 0]}}, "pointmill": {{}},
        "attributes": [{{"name": "x", "type": "float", "elements": 1, "offset": 0}},
        {{"name": "y", "type": "float", "elements": 1, "offset": 4}}, {{"name": "z", "type": "float", "elements": 1, "offset": 8}},
        {{"name": "classification", "type": "float", "elements": 1, "offset": 12}},
        {{"name": "gps-time", "type": "double", "elements": 1, "offset": 16}}], "stride": 24,
        "nodes": [{{"min": [0, 0, 0], "max": [1, 1, 1], "count": {POINTS}, "center": [0, 0, 0], "file": "n.bin"}}]}}"#
    );
    fs::write(folder.join("index.json"), text).unwrap();
    fs::write(folder.join("n.bin"), vec![0; 24 * POINTS]).unwrap();
}

fn qbatch(folder: &Path) -> Vec<u8> {
    let lattice = Lattice { scale: [0.001; 3], offset: [0.0; 3] };
    let x: Vec<i64> = (0..POINTS as i64).collect();
    let y: Vec<i64> = x.iter().map(|x| x * 7 % 20_000).collect();
    let colours: Vec<u32> = (0..POINTS as u32).collect();
    let mut out = Cursor::new(Vec::new());
    batches::write(&mut out, &Cloud::new(lattice, [&x, &y, &x], &colours), &WriteOptions::new(lattice)).unwrap();
    let bytes = out.into_inner();
    fs::write(folder.join("points.qbatch"), &bytes).unwrap();
    bytes
}

#[cfg(feature = "zstd")]
fn compressed(folder: &Path) {
    let bytes = qbatch(folder);
    let source = batches::Batches::from_bytes(batches::AlignedBytes::from(&bytes[..]), "plain").unwrap();
    let mut out = Cursor::new(Vec::new());
    batches::compress(&source, &mut out, 3, 4).unwrap();
    fs::write(folder.join("points.qbatch"), out.into_inner()).unwrap();
}

#[test]
fn what_decoding_a_dataset_takes_is_known_beforehand() {
    let made: [Made<'_>; 6] = [
        ("potree2", &|folder| potree2(folder, Encoding::Default)),
        ("brotli", &|folder| potree2(folder, Encoding::Brotli)),
        ("potree1", &potree1),
        ("bintree", &bintree),
        ("batches", &|folder| drop(qbatch(folder))),
        #[cfg(feature = "zstd")]
        ("compressed", &compressed),
        #[cfg(not(feature = "zstd"))]
        ("batches again", &|folder| drop(qbatch(folder))),
    ];
    for (name, make) in made {
        let dir = tempfile::tempdir().unwrap();
        let folder: PathBuf = dir.path().to_path_buf();
        make(&folder);
        let scan = open_scan(&folder, &OpenOptions::default()).unwrap();
        assert_eq!(scan.info().points_declared, POINTS as u64, "{name}");
        for wanted in [Wanted::positions(scan.info()), Wanted::all(scan.info())] {
            let (said, taken) = (scan.decode_bytes(&wanted), taken(scan.as_ref(), &wanted));
            println!("{name}: {taken} bytes of {said}");
            assert!(taken <= said, "{name}: {taken} bytes are taken, {said} should be enough");
            assert!(said <= 4 * taken + ELSEWHERE, "{name}: {said} bytes are said, {taken} are taken");
        }
    }
}
