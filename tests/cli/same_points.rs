//! The same points give the same dataset, whatever the format that brings them.

use std::fmt::Write as _;
use std::fs;

use pointmill_testkit::files::{assert_same_dataset, dataset, fixture};
use pointmill_testkit::las::{self, Las};

use crate::support::Dir;

/// A point of `fixtures/e57/same_points.e57`: millimetres, 8-bit colour, intensity.
struct Point {
    mm: [i64; 3],
    rgb: [u8; 3],
    intensity: u16,
}

/// As `same_points` of `fixtures/generators/e57.py` makes them; the last 100 share their places with the first.
fn points() -> Vec<Point> {
    let point = |i: i64| {
        let place = i % 2400;
        Point {
            mm: [
                481_000_000 + place * 7919 % 50021,
                5_400_000_000 + place * 104_729 % 30011,
                12_000 + place * 31 % 997,
            ],
            rgb: [i as u8, (i * 3) as u8, (i * 7) as u8],
            intensity: (i * 13) as u16,
        }
    };
    (0..2500).map(point).collect()
}

impl Point {
    fn world(&self) -> [f64; 3] {
        self.mm.map(|v| v as f64 / 1000.0)
    }

    fn text(&self, order: &str) -> String {
        let [x, y, z] = self.world();
        let ([r, g, b], i) = (self.rgb, self.intensity);
        match order {
            "xyzirgb" => format!("{x:.3} {y:.3} {z:.3} {i} {r} {g} {b}\n"),
            _ => format!("{x:.3},{y:.3},{z:.3},{r},{g},{b},{i}\n"),
        }
    }
}

/// Point format 2, with a lattice whose zero lies elsewhere.
fn las(points: &[Point]) -> Vec<u8> {
    let offset = [481_000i64, 5_400_000, 12];
    let point = |p: &Point| {
        let xyz = [0, 1, 2].map(|a| (p.mm[a] - offset[a] * 1000) as i32);
        las::Point { intensity: p.intensity, class: 1, rgb: p.rgb.map(u16::from), ..las::Point::at(xyz) }
    };
    let points = points.iter().map(point).collect();
    Las { point_format: 2, scale: [0.001; 3], offset: offset.map(|v| v as f64), ..Las::new(points) }.bytes()
}

fn ply(points: &[Point], encoding: &str) -> Vec<u8> {
    let n = points.len();
    let mut out = format!("ply\nformat {encoding} 1.0\nelement vertex {n}\n").into_bytes();
    for property in ["double x", "double y", "double z", "ushort intensity", "uchar red", "uchar green", "uchar blue"] {
        out.extend(format!("property {property}\n").bytes());
    }
    out.extend(b"end_header\n");
    for p in points {
        match encoding {
            "ascii" => out.extend(p.text("xyzirgb").bytes()),
            "binary_little_endian" => {
                p.world().iter().for_each(|v| out.extend(v.to_le_bytes()));
                out.extend(p.intensity.to_le_bytes());
                out.extend(p.rgb);
            }
            _ => {
                p.world().iter().for_each(|v| out.extend(v.to_be_bytes()));
                out.extend(p.intensity.to_be_bytes());
                out.extend(p.rgb);
            }
        }
    }
    out
}

/// `packed`: the colour as the bits of one number, blue lowest.
fn pcd(points: &[Point], encoding: &str) -> Vec<u8> {
    let n = points.len();
    let mut out = format!(
        "# .PCD v.7\nVERSION .7\nFIELDS x y z rgb intensity\nSIZE 8 8 8 4 2\nTYPE F F F U U\nCOUNT 1 1 1 1 1\n\
         WIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA {encoding}\n"
    )
    .into_bytes();
    for p in points {
        let [r, g, b] = p.rgb.map(u32::from);
        let packed = r << 16 | g << 8 | b;
        let [x, y, z] = p.world();
        if encoding == "ascii" {
            out.extend(format!("{x:.3} {y:.3} {z:.3} {packed} {}\n", p.intensity).bytes());
        } else {
            p.world().iter().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend(packed.to_le_bytes());
            out.extend(p.intensity.to_le_bytes());
        }
    }
    out
}

fn lines(points: &[Point], order: &str, head: &str) -> Vec<u8> {
    let mut out = head.to_owned();
    points.iter().for_each(|p| write!(out, "{}", p.text(order)).unwrap());
    out.into_bytes()
}

#[test]
fn las_e57_ply_pcd_and_text_with_the_same_points_give_the_same_bytes() {
    let dir = Dir::new();
    let points = points();
    let count = format!("{}\n", points.len());
    let files = [
        ("a.las", las(&points)),
        ("a.e57", fs::read(fixture("e57/same_points.e57")).unwrap()),
        ("ascii.ply", ply(&points, "ascii")),
        ("little.ply", ply(&points, "binary_little_endian")),
        ("big.ply", ply(&points, "binary_big_endian")),
        ("ascii.pcd", pcd(&points, "ascii")),
        ("binary.pcd", pcd(&points, "binary")),
        ("a.xyz", lines(&points, "xyzirgb", "")),
        ("a.csv", lines(&points, "xyzrgbi", "x,y,z,r,g,b,intensity\n")),
        ("a.pts", lines(&points, "xyzirgb", &count)),
    ];
    let mut first = None;
    for (name, bytes) in files {
        dir.write(name, &bytes);
        let options = ["--scale", "0.001", "--attributes", "rgb,intensity", "--name", "same", "--leaf-capacity", "100"];
        dir.succeed(["convert", name, "-o", "out", "--overwrite", "-q"].iter().chain(&options));
        dir.validate("out", &[name]);
        let report = dir.report("out");
        assert_eq!(report["outputs"][0]["points"], 2500, "{name}");
        assert!(report["outputs"][0]["tree"]["nodes"].as_u64().unwrap() > 20, "{name}");
        let bytes = dataset(&dir.path("out"));
        assert_same_dataset(&bytes, first.get_or_insert_with(|| bytes.clone()), name);
    }
    // all of them at once are ten times as many points
    let inputs =
        ["a.las", "a.e57", "ascii.ply", "little.ply", "big.ply", "ascii.pcd", "binary.pcd", "a.xyz", "a.csv", "a.pts"];
    dir.succeed(["convert", "-o", "all", "-q"].iter().chain(&inputs));
    assert_eq!(dir.report("all")["outputs"][0]["points"], 25_000);
    dir.validate("all", &inputs);
}
