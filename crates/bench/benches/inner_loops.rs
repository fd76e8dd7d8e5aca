//! The loops in which the time goes, one thread each: reading, Morton sort, sampling, encoding.
//!
//! Data: the generated aerial scene of this crate. What the numbers do not show: disks (the files are in the page
//! cache), page faults of a whole run, and how the parts share memory bandwidth. Compare with another run on the same
//! machine only.

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use pointmill_bench::scene::{Random, Scene};
use pointmill_bench::{las_file, las_layout};
use pointmill_converter::Sampling;
use pointmill_converter::bench_api::{Chunk, Sample};
use pointmill_format::potree2::{BrotliScratch, encode_brotli};
use pointmill_format::scan::las;
use pointmill_format::{Attribute, AttributeType, Scratch, Wanted};

/// Every point of a scan into columns, piece by piece.
fn las_parse(c: &mut Criterion) {
    let dir = tempfile::tempdir().expect("a folder for temporary files");
    let mut group = c.benchmark_group("las_parse");
    for (ending, points) in [("las", 1_000_000), ("laz", 200_000)] {
        let path = dir.path().join(format!("scene.{ending}"));
        las_file::write(Scene::Aerial, las_layout::LasLayout::COLOUR, points, 7, &path)
            .expect("a scene can be written");
        let scan = match las::open(&path) {
            Ok(scan) => scan,
            Err(error) => {
                eprintln!("las_parse/{ending} is omitted: {error}");
                continue;
            }
        };
        group.throughput(Throughput::Elements(points));
        let all = Wanted::all(scan.info());
        for (columns, wanted) in [("all", all), ("positions", Wanted::positions(scan.info()))] {
            let mut scratch = Scratch::default();
            group.bench_function(format!("{ending}_{columns}"), |b| {
                b.iter(|| {
                    let mut seen = 0;
                    for piece in 0..scan.pieces().len() {
                        let mut sink = |batch: &_| {
                            seen += positions_of(black_box(batch));
                            ControlFlow::Continue(())
                        };
                        scan.decode(piece, &wanted, &mut scratch, &mut sink).expect("a whole scan");
                    }
                    assert_eq!(seen as u64, points);
                });
            });
        }
    }
    group.finish();
}

fn positions_of(batch: &pointmill_format::PointBatch) -> usize {
    batch.positions.len()
}

/// One node's records under BROTLI; 5 is pointmill's default quality, 6 what PotreeConverter uses.
fn brotli_encode(c: &mut Criterion) {
    const POINTS: u64 = 10_000;
    let attributes = attributes();
    let records = node_records(POINTS);
    let mut group = c.benchmark_group("brotli_encode");
    group.throughput(Throughput::Elements(POINTS));
    for quality in [1, 2, 4, 5, 6] {
        let (mut scratch, mut out) = (BrotliScratch::default(), Vec::new());
        group.bench_function(format!("quality_{quality}"), |b| {
            b.iter(|| {
                out.clear();
                encode_brotli(&attributes, black_box(&records), quality, &mut scratch, &mut out).expect("valid");
            });
        });
        eprintln!("brotli_encode/quality_{quality}: {:.2} bytes/point", out.len() as f64 / POINTS as f64);
    }
    group.finish();
}

/// A chunk of the scene in acquisition order: its Morton sort, the sample of an inner node above all of it, and its
/// records gathered into DEFAULT payloads.
fn chunk(c: &mut Criterion) {
    const POINTS: u64 = 40_000;
    let mut attributes = attributes();
    attributes.remove(0); // the position
    let mut chunk = Chunk::new(node_records(POINTS), attributes).expect("a scene has points");
    let points = chunk.sort();
    let candidates = chunk.trees();
    let mut group = c.benchmark_group("chunk");
    group.throughput(Throughput::Elements(points as u64));
    group.bench_function("morton_sort", |b| b.iter(|| chunk.sort()));
    let kinds = [("poisson", Sampling::Poisson), ("grid", Sampling::Grid), ("random", Sampling::Random { seed: 0 })];
    for (name, sampling) in kinds {
        let mut sample = Sample::new(sampling);
        group.bench_function(format!("sample_{name}"), |b| b.iter(|| sample.choose(0, black_box(&candidates))));
        eprintln!("chunk/sample_{name}: {} of {points} taken", sample.choose(0, &candidates));
    }
    let mut out = Vec::new();
    group.bench_function("encode_default", |b| b.iter(|| chunk.encode_default(&mut out)));
    group.finish();
}

/// Point format 3 as pointmill lays it out in a node, 35 bytes.
fn attributes() -> Vec<Attribute> {
    use AttributeType::{Float64, Int8, Int32, UInt8, UInt16};
    [
        ("position", Int32, 3),
        ("rgb", UInt16, 3),
        ("intensity", UInt16, 1),
        ("return number", UInt8, 1),
        ("number of returns", UInt8, 1),
        ("classification", UInt8, 1),
        ("scan angle rank", Int8, 1),
        ("user data", UInt8, 1),
        ("point source id", UInt16, 1),
        ("gps-time", Float64, 1),
    ]
    .into_iter()
    .map(|(name, ty, elements)| Attribute::new(name, ty, elements))
    .collect()
}

/// Records of the points of an aerial scene in a square that holds about `points`, as a leaf would have them.
fn node_records(points: u64) -> Vec<u8> {
    const TOTAL: u64 = 1_000_000;
    let side = (points as f64 / 20.0).sqrt();
    let mut random = Random::new(7);
    let mut out = Vec::new();
    for index in 0..TOTAL {
        let point = Scene::Aerial.point(index, TOTAL, &mut random);
        let inside = (0..2).all(|a| (0.0..side).contains(&(point.position[a] - Scene::Aerial.offset()[a] - 60.0)));
        if inside && (out.len() as u64) < points * 35 {
            let las = las_layout::record(Scene::Aerial, index, &point);
            // Positions of a node are never negative: shift the lattice by a whole number of steps.
            for (a, shift) in [0i32, 0, 1 << 16].into_iter().enumerate() {
                let q = i32::from_le_bytes([las[4 * a], las[4 * a + 1], las[4 * a + 2], las[4 * a + 3]]);
                out.extend((q + shift).to_le_bytes());
            }
            out.extend(&las[28..34]); // rgb
            out.extend(&las[12..14]); // intensity
            out.extend([las[14] & 7, las[14] >> 3 & 7, las[15] & 31, las[16], las[17]]);
            out.extend(&las[18..28]); // point source id, gps-time
        }
    }
    out
}

criterion_group! { name = benches; config = Criterion::default().sample_size(20); targets = las_parse, chunk, brotli_encode }
criterion_main!(benches);
