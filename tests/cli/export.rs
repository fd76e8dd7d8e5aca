//! From scans to LAS and LAZ: every record comes back, and what is not written is told.

use std::fs;
use std::path::Path;

use pointmill_format::{OpenOptions, open_scan};
use pointmill_testkit::damage::{put, u32_at};
use pointmill_testkit::files::{fixture, fixture_bytes};
use pointmill_testkit::las::{Las, Point};
use pointmill_testkit::las_records::{random_las, shorts, with_vlrs};
use serde_json::Value;

use crate::support::Dir;

pub(crate) const SCALE: [f64; 3] = [0.01; 3];
pub(crate) const OFFSET: [f64; 3] = [500_000.0, 5_400_000.0, 100.0];

/// The records of an uncompressed LAS file, sorted: coordinates as steps from 0, then the other fields without the wave packets.
pub(crate) fn records(las: &[u8]) -> Vec<(Vec<i64>, Vec<u8>)> {
    let double = |at: usize| f64::from_le_bytes(las[at..at + 8].try_into().unwrap());
    let (start, len) = (u32_at(las, 96) as usize, usize::from(u16::from_le_bytes([las[105], las[106]])));
    let packet = match las[104] {
        4 => 28..57,
        5 => 34..63,
        9 => 30..59,
        10 => 38..67,
        _ => 0..0,
    };
    let of = |record: &[u8]| {
        let steps = |a: usize| {
            let q = f64::from(i32::from_le_bytes(record[4 * a..4 * a + 4].try_into().unwrap()));
            let (scale, offset) = (double(131 + 8 * a), double(155 + 8 * a));
            ((q * scale + offset) / SCALE[a]).round() as i64
        };
        let mut fields = record.to_vec();
        fields.drain(packet.clone());
        ((0..3).map(steps).collect(), fields.split_off(12))
    };
    let mut all: Vec<_> = las[start..].chunks_exact(len).map(of).collect();
    all.sort_unstable();
    all
}

fn report(dir: &Dir, args: &[&str]) -> Value {
    serde_json::from_str(&dir.succeed(["export", "--json", "-q"].iter().chain(args)).stdout()).unwrap()
}

#[test]
fn records_of_every_point_format_come_back() {
    let dir = Dir::new();
    for format in 0..=10u8 {
        let las = random_las(format, 3000, SCALE, OFFSET, 100_000);
        dir.write("in.las", &las);
        let report = report(&dir, &["in.las", "-o", "out.las", "--overwrite"]);
        let out = fs::read(dir.path("out.las")).unwrap();
        assert!(records(&out) == records(&las), "{format}");
        // in the same order, on the same lattice
        if matches!(format, 0..=3 | 6..=8) {
            assert_eq!((out[104], &out[131..179]), (format, &las[131..179]));
            assert!(out[u32_at(&out, 96) as usize..] == las[u32_at(&las, 96) as usize..], "{format}");
        }
        assert_eq!((&report["points"]["read"], &report["points"]["written"]), (&3000.into(), &3000.into()));
        assert_eq!(report["positions"]["max_3d"], 0.0);
        let warned = report["warnings"].to_string();
        assert_eq!(warned.contains("wave"), matches!(format, 4 | 5 | 9 | 10), "{warned}");
        // the compressed file, written out again
        dir.succeed(["export", "in.las", "-o", "out.laz", "--overwrite", "-q", "--threads", "2"]);
        dir.succeed(["export", "out.laz", "-o", "back.las", "--overwrite", "-q"]);
        assert!(fs::read(dir.path("back.las")).unwrap() == out, "{format}");
    }
}

#[test]
fn threads_and_memory_change_no_byte() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(300_000, 1).bytes());
    dir.write("b.las", &Las::terrain(130_000, 2).bytes());
    for ending in ["las", "laz", "ply", "csv"] {
        let one = format!("one.{ending}");
        dir.succeed(["export", "a.las", "b.las", "-o", &one, "-q", "--threads", "1"]);
        for (i, options) in [["--threads", "2"], ["--threads", "7"], ["--memory", "160MiB"]].iter().enumerate() {
            let other = format!("{i}.{ending}");
            dir.succeed(["export", "b.las", "a.las", "-o", &other, "-q"].iter().chain(options));
            assert!(fs::read(dir.path(&one)).unwrap() == fs::read(dir.path(&other)).unwrap(), "{ending} {options:?}");
        }
    }
}

#[test]
fn several_lattices_become_one_that_holds_all() {
    let dir = Dir::new();
    let at = |xyz, scale, offset| Las { scale, offset, ..Las::new(vec![Point::at(xyz)]) }.bytes();
    dir.write("a.las", &at([1, 2, 3], [0.01; 3], [500_000.0, 5_400_000.0, 0.0]));
    dir.write("b.las", &at([10, 20, 30], [0.005; 3], [499_000.0, 5_400_000.0, 0.0]));
    let out = report(&dir, &["a.las", "b.las", "-o", "out.las"]);
    assert_eq!((&out["scale"][0], &out["positions"]["moved"]), (&0.005.into(), &false.into()));
    let scan = open_scan(dir.path("out.las"), &OpenOptions::default()).unwrap();
    let bounds = scan.info().bounds_declared.unwrap();
    assert_eq!((bounds.min, bounds.max), ([499_000.05, 5_400_000.02, 0.03], [500_000.01, 5_400_000.1, 0.15]));
    // far coordinates with an offset of zero
    dir.write("far.las", &at([5, 5, 5], [0.001; 3], [0.0, 5_400_000.0, 0.0]));
    dir.write("zero.las", &at([7, 7, 7], [0.001; 3], [1.0, 5_400_001.0, 0.0]));
    let out = report(&dir, &["far.las", "zero.las", "-o", "far2.las"]);
    assert_eq!((&out["offset"], &out["scale"][1]), (&serde_json::json!([0.0, 5_400_000.0, 0.0]), &0.001.into()));
}

#[test]
fn a_header_that_lies_about_bounds_costs_a_second_pass_and_no_point() {
    let dir = Dir::new();
    let las = |xyz, offset: f64| Las {
        scale: [0.001; 3],
        offset: [offset, 0.0, 0.0],
        bounds_declared: Some([[0.0; 3], [1.0; 3]]),
        ..Las::new(vec![Point::at([0; 3]), Point::at(xyz)])
    };
    dir.write("a.las", &las([2_000_000_000, 0, 0], 3_000_000.0).bytes());
    dir.write("b.las", &las([5, 0, 0], 3_000_000.5).bytes());
    let out = report(&dir, &["a.las", "b.las", "-o", "out.las"]);
    assert_eq!((&out["points"]["written"], &out["scale"][0]), (&4.into(), &0.001.into()));
    let bounds = open_scan(dir.path("out.las"), &OpenOptions::default()).unwrap().info().bounds_declared.unwrap();
    assert_eq!((bounds.min[0], bounds.max[0]), (3_000_000.0, 5_000_000.0));
}

#[test]
fn points_that_are_not_written_are_counted_by_cause() {
    let dir = Dir::new();
    let points = (0..100).map(|i| Point { class: [2, 5, 6][i % 3], ..Point::at([i as i32, 0, 0]) }).collect();
    dir.write("in.las", &Las { scale: [1.0; 3], offset: [0.0; 3], ..Las::new(points) }.bytes());
    let out = report(&dir, &["in.las", "-o", "out.las", "--class", "2,6", "--bounds", "10,-1,-1..89,1,1"]);
    let p = &out["points"];
    let counts = ["read", "written", "outsideBounds", "otherClass"].map(|name| p[name].as_u64().unwrap());
    assert_eq!(counts, [100, 53, 20, 27]);
    let scan = open_scan(dir.path("out.las"), &OpenOptions::default()).unwrap();
    assert_eq!(scan.info().points_declared, 53);
    let every = report(&dir, &["in.las", "-o", "every.las", "--every", "10", "--attributes", "classification"]);
    assert_eq!((&every["points"]["written"], &every["points"]["thinned"]), (&10.into(), &90.into()));
    assert_eq!(every["attributes"].as_array().unwrap().len(), 1);
    let nothing = dir.run(["export", "in.las", "-o", "nothing.las", "--class", "99"]);
    nothing.failed_with(3, &["no points left", "100 of other"]);
    dir.run(["export", "in.las", "-o", "x.las", "--attributes", "hue"]).failed_with(2, &["hue", "--attributes"]);
    assert_eq!(dir.names(), ["every.las", "in.las", "out.las"]);
}

#[test]
fn one_point_is_a_cloud_and_none_is_none() {
    let dir = Dir::new();
    dir.write("one.las", &Las::new(vec![Point::at([1, 2, 3])]).bytes());
    dir.write("none.las", &Las::new(Vec::new()).bytes());
    for ending in ["las", "laz", "ply", "csv"] {
        dir.succeed(["export", "one.las", "-o", &format!("out.{ending}"), "-q"]);
        let info = dir.succeed(["info", &format!("out.{ending}"), "--deep", "--json"]).stdout();
        let info: Value = serde_json::from_str(&info).unwrap();
        assert!(info.to_string().contains("\"points\":1") || info[0].to_string().contains(":1,"), "{info}");
        let none = dir.run(["export", "none.las", "-o", &format!("nothing.{ending}")]);
        none.failed_with(3, &["none.las", "holds no points"]);
    }
    assert_eq!(dir.names(), ["none.las", "one.las", "out.csv", "out.las", "out.laz", "out.ply"]);
}

#[test]
fn coordinate_reference_systems_come_back() {
    let dir = Dir::new();
    let las = Las::terrain(50, 1).bytes();
    let wkt = b"PROJCS[\"ETRS89 / UTM zone 32N\",GEOGCS[\"ETRS89\",DATUM[\"x\",SPHEROID[\"GRS 1980\",6378137,298.257222101]],\
        PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],UNIT[\"metre\",1],\
        AUTHORITY[\"EPSG\",\"25832\"]]";
    dir.write("wkt.las", &with_vlrs(&las, &[("LASF_Projection", 2112, wkt.to_vec())]));
    let keys = |values: &[u16]| with_vlrs(&las, &[("LASF_Projection", 34735, shorts(values))]);
    dir.write("utm.las", &keys(&[1, 1, 0, 4, 1024, 0, 1, 1, 3072, 0, 1, 25832, 3076, 0, 1, 9001, 4096, 0, 1, 5783]));
    dir.write("degrees.las", &keys(&[1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 4326, 2054, 0, 1, 9102]));
    let crs = |file: &str| open_scan(dir.path(file), &OpenOptions::default()).unwrap().info().crs.clone();
    for name in ["wkt", "utm", "degrees"] {
        for ending in ["las", "laz"] {
            let (from, to) = (format!("{name}.las"), format!("{name}-out.{ending}"));
            dir.succeed(["export", &from, "-o", &to, "-q"]);
            assert_eq!(crs(&to), crs(&from), "{to}");
        }
    }
    dir.succeed(["export", "utm.las", "-o", "named.las", "-q", "--crs", "EPSG:32632+5773"]);
    assert_eq!((crs("named.las").epsg, crs("named.las").vertical_epsg), (Some(32632), Some(5773)));
    // points of format 6 and above have WKT and nothing else
    let modern = fixture("las/format6.las");
    dir.succeed(["export", modern.to_str().unwrap(), "-o", "modern.las", "-q", "--crs", "EPSG:32632+5773"]);
    let found = crs("modern.las");
    let wkt = found.wkt.clone().unwrap();
    assert!(wkt.starts_with("COMPD_CS[\"WGS 84 / UTM zone 32N + EPSG:5773\",PROJCS["), "{wkt}");
    assert!(wkt.contains("AUTHORITY[\"EPSG\",\"32632\"]") && wkt.ends_with("AUTHORITY[\"EPSG\",\"5773\"]]]"), "{wkt}");
    assert_eq!((found.epsg, found.vertical_epsg), (None, None));
    let given = dir.succeed(["export", "utm.las", "-o", "proj.las", "--crs", "+proj=utm +zone=32 +datum=WGS84"]);
    assert!(given.stderr().contains("no place for it"), "{}", given.stderr());
    let both = dir.succeed(["export", "utm.las", "degrees.las", "-o", "both.las"]);
    assert!(both.stderr().contains("different coordinate reference systems"), "{}", both.stderr());
    assert_eq!(crs("both.las"), Default::default());
}

#[test]
fn what_stands_there_is_kept_until_the_new_file_is_complete() {
    let dir = Dir::new();
    dir.write("in.las", &Las::terrain(100, 1).bytes());
    dir.write("out.laz", b"mine");
    dir.run(["export", "in.las", "-o", "out.laz"]).failed_with(2, &["out.laz", "exists already", "--overwrite"]);
    let mut broken = fixture_bytes("las/format7.laz");
    let len = broken.len();
    broken.truncate(len / 2);
    dir.write("broken.laz", &broken);
    let failed = dir.run(["export", "broken.laz", "-o", "out.laz", "--overwrite"]);
    assert_eq!(failed.code(), 3, "{}", failed.stderr());
    assert_eq!(fs::read(dir.path("out.laz")).unwrap(), b"mine");
    dir.succeed(["export", "in.las", "-o", "out.laz", "--overwrite", "-q"]);
    assert!(fs::read(dir.path("out.laz")).unwrap().starts_with(b"LASF"));
    for (args, code, words) in [
        (vec!["in.las", "-o", "in.las", "--overwrite"], 2, "place of the input"),
        (vec!["in.las", "-o", "x.e57"], 4, "E57 is not written"),
        (vec!["in.las", "-o", "x.obj"], 2, ".las, .laz"),
        (vec!["in.las", "-o", "x"], 2, "the ending"),
        (vec!["gone.las", "-o", "x.las"], 2, "gone.las"),
        (vec!["-o", "x.las"], 2, "no input"),
        (vec!["in.las", "-o", "x.las", "--memory", "1MiB"], 6, "--memory"),
        (vec!["in.las", "-o", "x.las", "--level", "2"], 4, "in.las"),
    ] {
        dir.run(["export"].iter().chain(&args)).failed_with(code, &[words]);
    }
    fs::create_dir(dir.path("folder.las")).unwrap();
    dir.run(["export", "in.las", "-o", "folder.las", "--overwrite"]).failed_with(2, &["folder.las"]);
    assert_eq!(dir.names(), ["broken.laz", "folder.las", "in.las", "out.laz"]);
}

#[test]
fn broken_parts_can_be_left_out_and_are_counted() {
    let dir = Dir::new();
    let mut bytes = fixture_bytes("las/format3.laz");
    let start = u32_at(&bytes, 96) as usize + 8;
    let middle = start + (bytes.len() - start) / 2;
    put(&mut bytes, middle, &[0xff; 64]);
    dir.write("in.laz", &bytes);
    dir.write("good.las", &Las::terrain(100, 1).bytes());
    let failed = dir.run(["export", "in.laz", "good.las", "-o", "out.las"]);
    if failed.code() == 0 {
        return; // what was damaged decodes to other values
    }
    failed.failed_with(3, &["in.laz", "--unreadable skip"]);
    let out = report(&dir, &["in.laz", "good.las", "-o", "out.las", "--unreadable", "skip"]);
    assert!(out["points"]["unreadable"].as_u64().unwrap() > 0);
    assert!(Path::new(&dir.path("out.las")).exists());
}

#[test]
fn the_memory_ceiling_is_kept() {
    let dir = Dir::new();
    dir.write("in.las", &Las::terrain(3_000_000, 1).bytes());
    for ending in ["las", "laz"] {
        let args = ["in.las", "-o", &format!("out.{ending}"), "--memory", "100MiB", "--threads", "2"];
        let peak = report(&dir, &args)["memory_bytes"].as_u64();
        assert!(peak.is_none_or(|peak| peak <= 100 << 20), "{peak:?}");
    }
}
