//! `--precision`: no written coordinate is off by more, what lies beneath is dropped, and both are in the report.

use std::fs;

use pointmill_testkit::las::{Las, Point};
use serde_json::Value;

use crate::support::Dir;

/// A scene of `points` points in millimetres.
fn millimetres(points: usize) -> Vec<u8> {
    let mut las = Las::terrain(points, 7);
    (las.scale, las.offset) = ([0.001; 3], [500.0, -200.0, 0.0]);
    las.bytes()
}

fn convert(dir: &Dir, input: &str, out: &str, args: &[&str]) -> Value {
    let all: Vec<&str> = ["convert", input, "-o", out, "-q"].into_iter().chain(args.iter().copied()).collect();
    dir.succeed(all);
    dir.report(out)
}

fn numbers(value: &Value) -> [f64; 3] {
    std::array::from_fn(|a| value[a].as_f64().unwrap())
}

#[test]
fn octrees_attain_the_precision_and_never_exceed_it() {
    let dir = Dir::new();
    dir.write("a.las", &millimetres(5_000));
    let args = ["--to", "potree2", "--to", "copc", "--crs", "EPSG:25832", "--precision", "2mm"];
    let report = convert(&dir, "a.las", "out", &args);
    assert_eq!(numbers(&report["grid"]["scale"]), [0.005; 3], "5 steps move a coordinate by 0, 1 or 2");
    assert_eq!(report["options"]["precision"], "2mm");
    assert!(report["grid"]["why"].as_str().unwrap().contains("5 times coarser, because the requested precision"));
    for output in report["outputs"].as_array().unwrap() {
        let precision = &output["precision"];
        assert_eq!(numbers(&precision["allowed"]), [0.002; 3]);
        // 2 mm in doubles of coordinates below 1000
        assert!(numbers(&precision["max"]).iter().all(|max| (max - 0.002).abs() < 1e-12), "{precision}");
        // of five neighbours two move by 2, two by 1, one by 0
        assert!(numbers(&precision["rms"]).iter().all(|rms| (rms - 0.001 * 2f64.sqrt()).abs() < 1e-4), "{precision}");
        assert!((numbers(&precision["bits_dropped"])[0] - 5f64.log2()).abs() < 1e-9);
    }
    let saved = |i: usize| &report["outputs"][i]["precision"]["saved"];
    assert_eq!(saved(0)["bytes"], 0, "4 bytes an axis whatever the step");
    assert!(saved(1)["bytes"].is_null(), "compressed");
    let warnings = report["warnings"].as_array().unwrap();
    assert!(warnings.iter().all(|w| w["kind"] != "coarser_step"), "a step that was requested is no news: {warnings:?}");
    dir.validate("out/potree2", &["a.las"]);
    dir.validate("out/copc", &["a.las"]);
}

#[test]
fn formats_with_errors_of_their_own_keep_it_as_well() {
    let dir = Dir::new();
    dir.write("a.las", &millimetres(30_000));
    let formats = ["potree2", "potree1", "bintree", "batches", "copc"];
    let to = formats.iter().flat_map(|format| ["--to", format]);
    let args: Vec<&str> = to.chain(["--precision", "0.01"]).collect();
    let report = convert(&dir, "a.las", "out", &args);
    assert_eq!(numbers(&report["grid"]["scale"]), [0.01; 3], "half of it: 5 mm");
    for output in report["outputs"].as_array().unwrap() {
        let max = numbers(&output["precision"]["max"]);
        assert!(max.iter().all(|max| (0.005 - 1e-12..=0.01).contains(max)), "{}: {max:?}", output["format"]);
    }
    for format in formats {
        dir.validate(&format!("out/{format}"), &["a.las"]);
    }
}

#[test]
fn batches_drop_the_planes_that_nobody_needs() {
    let dir = Dir::new();
    dir.write("a.las", &millimetres(30_000));
    let of = |out: &str, args: &[&str]| {
        let report = convert(&dir, "a.las", out, &[&["--to", "batches"], args].concat());
        (report["outputs"][0].clone(), report)
    };
    let (all, _) = of("all", &[]);
    let (few, report) = of("few", &["--precision", "0.05"]);
    assert_eq!((&all["details"]["planes"], &few["details"]["planes"]), (&20.into(), &10.into()));
    assert_eq!(few["precision"]["saved"]["bytes"], 4 * 30_000);
    assert!(all["precision"].is_null());
    assert!(numbers(&few["accuracy"]["format"]["max"])[0] > 0.001, "10 bits of boxes of metres: {report}");
    assert!(numbers(&few["precision"]["max"]).iter().all(|max| *max <= 0.05));
    dir.validate("few", &["a.las"]);
    // the step is coarser than a thousandth of a millimetre and stays; the planes must be finer than it
    let (fine, report) = of("fine", &["--precision", "1e-7"]);
    assert_eq!((numbers(&report["grid"]["scale"]), &fine["details"]["planes"]), ([0.001; 3], &30.into()));
    assert_eq!(fine["precision"]["saved"]["bytes"], 0);
    dir.run(["convert", "a.las", "-o", "no", "-q", "--to", "batches", "--planes", "10", "--precision", "0.001"])
        .failed_with(4, &["batches: ", "would be off by up to", "--precision"]);
    assert!(!dir.names().contains(&"no".to_owned()), "nothing is written: {:?}", dir.names());
}

#[test]
fn doubles_and_degrees_are_kept_in_their_own_units() {
    let dir = Dir::new();
    let text =
        |i: u32| format!("{} {} {}\n", f64::from(i).sin() * 300.0, f64::from(i).cos() * 7.0, f64::from(i).sqrt());
    dir.write("doubles.xyz", (0..4000).map(text).collect::<String>().as_bytes());
    let report = convert(&dir, "doubles.xyz", "doubles", &["--precision", "0.05"]);
    assert_eq!(numbers(&report["grid"]["scale"]), [0.1; 3]);
    let max = numbers(&report["outputs"][0]["precision"]["max"]);
    assert!(max.iter().all(|max| (0.04..0.05 + 1e-12).contains(max)), "{max:?}");
    dir.validate("doubles", &["doubles.xyz"]);

    let place = |i: u32| format!("{:.9} {:.9} {}\n", 13.0 + f64::from(i).sin(), 52.0 + f64::from(i).cos(), i % 90);
    dir.write("degrees.xyz", (0..4000).map(place).collect::<String>().as_bytes());
    let report = convert(&dir, "degrees.xyz", "degrees", &["--crs", "EPSG:4326", "--precision", "5cm"]);
    let max = numbers(&report["outputs"][0]["accuracy"]["metres"]["total"]["max"]);
    assert!(max[0] > 0.005 && max[1] > 0.03 && max.iter().all(|max| *max <= 0.05), "{max:?} m");
    dir.validate("degrees", &["degrees.xyz"]);
    // single precision of leaves that are a degree wide
    dir.run([
        "convert",
        "degrees.xyz",
        "-o",
        "no",
        "-q",
        "--to",
        "bintree",
        "--crs",
        "EPSG:4326",
        "--precision",
        "1mm",
    ])
    .failed_with(4, &["bintree: ", "would be off by up to", "--precision"]);
}

#[test]
fn what_cannot_be_kept_or_understood_is_refused_in_one_line() {
    let dir = Dir::new();
    dir.write("a.las", &millimetres(100));
    let run = |args: &[&str]| {
        let all: Vec<&str> = ["convert", "a.las", "-o", "out", "-q"].into_iter().chain(args.iter().copied()).collect();
        dir.run(all)
    };
    run(&["--precision", "1mm", "--scale", "0.01"]).failed_with(2, &["--precision", "--scale"]);
    run(&["--precision", "1mm"]).failed_with(2, &["--precision", "unit", "--crs"]);
    run(&["--precision", "1mm", "--dry-run"]).failed_with(2, &["--precision", "unit", "--crs"]);
    run(&["--precision", "1 furlong"]).failed_with(2, &["--precision", "1mm"]);
    run(&["--precision=-1mm"]).failed_with(2, &["--precision", "above 0"]);
    // two points so far apart that 31 bits have no finer step than a metre
    dir.write("far.xyz", b"0.123456 0 0\n1e9 1 1\n2e9 5 0.5\n");
    dir.run(["convert", "far.xyz", "-o", "out", "-q", "--outliers", "keep", "--precision", "0.001"])
        .failed_with(4, &["the step of x is", "--precision"]);
    assert_eq!(dir.names(), ["a.las", "far.xyz"], "nothing is left behind");
    // a precision beyond the scene puts all points into one place, and says so
    let report = convert(&dir, "a.las", "coarse", &["--precision", "1e5"]);
    assert_eq!(report["points"]["kept"], 100);
    dir.validate("coarse", &["a.las"]);
}

#[test]
fn a_dry_run_tells_the_step_and_why() {
    let dir = Dir::new();
    dir.write("a.las", &millimetres(1000));
    let args = ["convert", "a.las", "-o", "out", "--dry-run", "--crs", "EPSG:25832", "--precision", "1cm"];
    let told = dir.succeed(args).stdout();
    assert!(told.contains("0.02") && told.contains("20 times coarser"), "{told}");
    assert!(fs::metadata(dir.path("out")).is_err());
}

/// With few steps the cube reaches far beyond the points, and the doubles there are coarser than those of the points.
#[test]
fn a_lattice_that_was_chosen_for_the_precision_is_never_refused() {
    let dir = Dir::new();
    let points = (0..3000).map(|i| Point::numbered(i, [i as i32 * 16, i as i32 * 7919 % 50_000, i as i32 % 10_000]));
    dir.write("in.las", &Las { scale: [0.001; 3], ..Las::new(points.collect()) }.bytes());
    for precision in ["0.1", "0.3", "3", "7"] {
        dir.succeed(["convert", "in.las", "-o", "out", "--overwrite", "--precision", precision]);
        dir.validate("out", &["in.las"]);
    }
}
