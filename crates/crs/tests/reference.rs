//! Reprojected points against those of PROJ: the committed table, and PROJ itself where pyproj is installed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use pointmill_crs::Placing;
use pointmill_format::{OpenOptions, PointBatch, Positions, Wanted, open_scan};

/// The table has seven decimals, text and degrees a little less: a hundredth of a millimetre is far above their rounding,
/// and far below the millimetre that is promised.
const LARGEST: f64 = 1e-5;

/// A row of the table.
struct Row {
    projection: String,
    from: String,
    to: String,
    point: [f64; 3],
    image: [f64; 3],
}

fn fixtures(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures")).join(name)
}

fn rows(table: &str) -> Vec<Row> {
    let row = |line: &str| {
        let fields: Vec<&str> = line.split('\t').collect();
        let point = |at: usize| [0, 1, 2].map(|i| fields[at + i].parse().unwrap());
        let name = |i: usize| fields[i].to_owned();
        Row { projection: name(0), from: name(1), to: name(2), point: point(3), image: point(6) }
    };
    table.lines().filter(|line| !line.starts_with('#')).map(row).collect()
}

/// The points of a text scan that is reprojected as it is read.
fn reprojected(points: &[[f64; 3]], from: &str, to: &str) -> Vec<[f64; 3]> {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("a.xyz");
    let lines: Vec<String> = points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    fs::write(&file, lines.concat()).unwrap();
    let placing = Placing::default().with_crs(from).unwrap().with_target(to).unwrap();
    let scan = open_scan(&file, &OpenOptions::default().maps(placing)).unwrap_or_else(|e| panic!("{from} {to}: {e}"));
    let world = |batch: PointBatch| match batch.positions {
        Positions::World([x, y, z]) => x.iter().zip(&y).zip(&z).map(|((x, y), z)| [*x, *y, *z]).collect::<Vec<_>>(),
        Positions::Quantized(_) => panic!(),
    };
    scan.batches(Wanted::positions(scan.info())).flat_map(|batch| world(batch.unwrap())).collect()
}

/// How far two points are apart, flat and in height, metres.
fn apart(a: [f64; 3], b: [f64; 3], to: &str) -> [f64; 2] {
    let geographic = [
        "4326", "4269", "4314", "4277", "4171", "4313", "4242", "4284", "4289", "4150", "4742", "4258", "4156", "4979",
    ];
    let metre = if to == "EPSG:2994" { 0.3048 } else { 1.0 };
    let (mut x, mut y) = ((a[0] - b[0]) * metre, (a[1] - b[1]) * metre);
    if geographic.iter().any(|code| to.ends_with(code)) {
        (x, y) = (x * 111_320.0 * b[1].to_radians().cos(), y * 111_320.0);
    }
    [x.hypot(y), (a[2] - b[2]).abs()]
}

/// Largest distances by projection.
fn compare(rows: &[Row]) -> BTreeMap<&str, [f64; 2]> {
    let mut largest = BTreeMap::new();
    for pair in rows.chunk_by(|a, b| (&a.from, &a.to) == (&b.from, &b.to)) {
        let Row { projection, from, to, .. } = &pair[0];
        let points: Vec<_> = pair.iter().map(|row| row.point).collect();
        let found = reprojected(&points, from, to);
        assert_eq!(found.len(), pair.len());
        for (row, found) in pair.iter().zip(found) {
            let [flat, height] = apart(found, row.image, to);
            assert!(flat < LARGEST && height < LARGEST, "{from} to {to}: {found:?}, by PROJ {:?}", row.image);
            let largest = largest.entry(projection.as_str()).or_insert([0.0f64; 2]);
            *largest = [largest[0].max(flat), largest[1].max(height)];
        }
    }
    largest
}

#[test]
fn every_projection_agrees_with_the_table_of_proj() {
    let table = fs::read_to_string(fixtures("crs/expected.tsv")).unwrap();
    let rows = rows(&table);
    assert!(rows.len() >= 150);
    compare(&rows);
}

/// The table of docs/inputs.md: `cargo test -p pointmill-crs --test reference proj_itself -- --nocapture`.
#[test]
fn random_points_agree_with_proj_itself_where_it_is_installed() {
    let script = fixtures("generators/crs.py");
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python).arg(script).args(["--points", "500", "--seed", "7"]).output();
    let Some(output) = output.ok().filter(|output| output.status.success()) else {
        eprintln!("pyproj is not installed: not compared with PROJ itself");
        return;
    };
    let table = String::from_utf8(output.stdout).unwrap();
    for (projection, [flat, height]) in compare(&rows(&table)) {
        println!("{projection}: {:.1} µm, height {:.1} µm", flat * 1e6, height * 1e6);
    }
}
