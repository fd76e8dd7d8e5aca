//! From scans to PLY and CSV: what our readers read of them is what the scans had.

use std::fs;

use pointmill_format::{AttributeType, Column, OpenOptions, Positions, ReadError, Wanted, open_scan, with_column};
use pointmill_testkit::las::{Las, Point};
use pointmill_testkit::las_records::random_las;

use crate::export::OFFSET;
use crate::support::Dir;

/// World coordinates of all points, and the values of columns by name and element.
struct Table {
    world: Vec<[f64; 3]>,
    columns: Vec<(String, Vec<f64>)>,
}

impl Table {
    fn column(&self, name: &str) -> &[f64] {
        let found = self.columns.iter().find(|(n, _)| n == name);
        &found.unwrap_or_else(|| panic!("no {name} in {:?}", self.columns.iter().map(|c| &c.0).collect::<Vec<_>>())).1
    }
}

#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn read(dir: &Dir, file: &str) -> Table {
    let scan = open_scan(dir.path(file), &OpenOptions::default()).unwrap();
    let info = scan.info().clone();
    let mut world = Vec::new();
    let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
    let batches: Result<Vec<_>, ReadError> = scan.batches(Wanted::all(&info)).collect();
    for batch in batches.unwrap() {
        for i in 0..batch.len() {
            world.push(match &batch.positions {
                Positions::World(p) => [0, 1, 2].map(|a| p[a][i]),
                Positions::Quantized(p) => info.lattice.unwrap().world([0, 1, 2].map(|a| i64::from(p[a][i]))),
            });
        }
        let mut at = 0;
        for (a, column) in info.attributes.iter().zip(&batch.columns) {
            let values: Vec<f64> = with_column!(column, v => v.iter().map(|n| *n as f64).collect());
            for element in 0..a.elements {
                let name = if a.elements == 1 { a.name.clone() } else { format!("{} {element}", a.name) };
                if columns.len() == at {
                    columns.push((name, Vec::new()));
                }
                columns[at].1.extend(values.iter().skip(element).step_by(a.elements));
                at += 1;
            }
        }
    }
    Table { world, columns }
}

#[test]
fn every_value_comes_back_from_ply_and_text() {
    let dir = Dir::new();
    for format in [3, 8] {
        dir.write("in.las", &random_las(format, 700, [0.001, 0.01, 0.25], OFFSET, 1_000_000));
        let scan = read(&dir, "in.las");
        for ending in ["ply", "csv"] {
            let out = format!("out.{ending}");
            dir.succeed(["export", "in.las", "-o", &out, "-q", "--overwrite"]);
            let found = read(&dir, &out);
            assert_eq!(found.world.len(), 700);
            for (a, b) in found.world.iter().zip(&scan.world) {
                assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-9), "{out}: {a:?} {b:?}");
            }
            let names =
                ["rgb 0", "rgb 1", "rgb 2", "intensity", "return number", "classification", "user data", "gps-time"];
            for name in names {
                assert_eq!(found.column(name), scan.column(name), "{out} {name}");
            }
            // what stored values mean
            let amplitude: Vec<f64> = scan.column("Amplitude").iter().map(|v| v * 0.01).collect();
            assert_eq!(found.column("Amplitude"), amplitude, "{out}");
            // text has as many digits as single precision needs
            let single = |table: &Table, name: &str| table.column(name).iter().map(|v| *v as f32).collect::<Vec<_>>();
            assert_eq!(single(&found, "beam_2"), single(&scan, "beam 2"), "{out}");
            if format == 8 {
                let degrees: Vec<f64> = scan.column("scan angle").iter().map(|v| v * 0.006).collect();
                assert_eq!(found.column("scan angle"), degrees, "{out}");
            }
        }
    }
    let text = fs::read_to_string(dir.path("out.csv")).unwrap();
    let first = text.lines().nth(1).unwrap();
    let decimals = |i: usize| first.split(',').nth(i).unwrap().split('.').nth(1).map_or(0, str::len);
    assert_eq!([0, 1, 2].map(decimals), [3, 2, 2]);
}

/// A PLY with colours of the given depth, and what type they have in it.
fn colours(values: &[[u16; 3]], from: &str) -> (Table, Table, String) {
    let dir = Dir::new();
    let points = values.iter().enumerate().map(|(i, rgb)| Point { rgb: *rgb, ..Point::at([i as i32, 0, 0]) });
    dir.write("in.las", &Las::new(points.collect()).bytes());
    if from == "tree" {
        dir.succeed(["convert", "in.las", "-o", "tree", "-q"]);
    }
    let input = if from == "tree" { "tree" } else { "in.las" };
    dir.succeed(["export", input, "-o", "out.ply", "-q"]);
    let header = fs::read(dir.path("out.ply")).unwrap();
    let header = String::from_utf8_lossy(&header[..600.min(header.len())]).into_owned();
    let ty = header.lines().find(|line| line.ends_with(" red")).unwrap().split(' ').nth(1).unwrap().to_owned();
    (read(&dir, "in.las"), read(&dir, "out.ply"), ty)
}

#[test]
fn colours_of_eight_bits_are_bytes_in_ply_and_deeper_ones_are_not() {
    let eight: Vec<_> = (0..200u16).map(|i| [i, 255 - i, 7]).collect();
    let (scan, ply, ty) = colours(&eight, "scan");
    assert_eq!((ty.as_str(), ply.column("rgb 1")), ("uchar", scan.column("rgb 1")));
    // an octree has them times 257
    let (scan, mut ply, ty) = colours(&eight, "tree");
    let mut red = scan.column("rgb 0").to_vec();
    let found = &mut ply.columns.iter_mut().find(|(name, _)| name == "rgb 0").unwrap().1;
    red.sort_by(f64::total_cmp);
    found.sort_by(f64::total_cmp);
    assert_eq!((ty.as_str(), &*found), ("uchar", &red));
    // deep from the first point on, and only in a later batch than the sample
    let deep: Vec<_> = (0..200u16).map(|i| [i * 300, 1, 7]).collect();
    let (scan, ply, ty) = colours(&deep, "scan");
    assert_eq!((ty.as_str(), ply.column("rgb 0")), ("ushort", scan.column("rgb 0")));
    let late: Vec<_> = (0..120_000u32).map(|i| [if i == 119_000 { 256 } else { (i % 200) as u16 }, 1, 7]).collect();
    let (scan, ply, ty) = colours(&late, "scan");
    assert_eq!((ty.as_str(), ply.column("rgb 0")), ("ushort", scan.column("rgb 0")));
}

#[test]
fn integers_that_ply_does_not_have_are_doubles_and_counted_where_these_round() {
    let dir = Dir::new();
    let text = "x,y,z,id,quality\n0,0,0,9007199254740993,0.5\n1,1,1,7,0.25\n";
    dir.write("in.csv", text.as_bytes());
    let scan = open_scan(dir.path("in.csv"), &OpenOptions::default()).unwrap();
    let (_, id) = scan.info().attribute("id").unwrap();
    if !matches!(id.ty, AttributeType::Int64 | AttributeType::UInt64) {
        return; // read as doubles: nothing to round
    }
    let ended = dir.succeed(["export", "in.csv", "-o", "out.ply"]);
    assert!(ended.stderr().contains("id: 1 value is rounded"), "{}", ended.stderr());
    dir.succeed(["export", "in.csv", "-o", "out.las", "-q"]);
    let las = open_scan(dir.path("out.las"), &OpenOptions::default()).unwrap();
    let batch = las.batches(Wanted::all(las.info())).next().unwrap().unwrap();
    assert!(
        matches!(&batch.columns[las.info().attribute("id").unwrap().0], Column::Int64(v) if v[0] == 9_007_199_254_740_993)
    );
}
