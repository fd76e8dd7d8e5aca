//! What a run says of the accuracy of each dataset, and whether that is so.

use pointmill_testkit::las::{Las, Point};
use serde_json::{Value, json};

use crate::support::{Dir, Ended};

/// Points in steps of a millimetre, without attributes to speak of.
fn millimetres(points: &[[i32; 3]]) -> Las {
    let mut las = Las::new(points.iter().map(|xyz| Point::at(*xyz)).collect());
    (las.scale, las.offset) = ([0.001; 3], [0.0; 3]);
    las
}

fn convert(las: &Las, options: &[&str]) -> (Dir, Ended) {
    let dir = Dir::new();
    dir.write("a.las", &las.bytes());
    let ended = dir.succeed(["convert", "a.las", "-o", "out"].iter().chain(options));
    (dir, ended)
}

fn accuracy(dir: &Dir) -> Value {
    dir.report("out")["outputs"][0]["accuracy"].clone()
}

fn near(value: &Value, expected: f64) -> bool {
    (value.as_f64().unwrap() - expected).abs() <= 1e-9
}

/// Changes the accuracy in the report.
fn edit(dir: &Dir, change: impl FnOnce(&mut Value)) {
    let mut report = dir.report("out");
    change(&mut report["outputs"][0]["accuracy"]);
    dir.write("out/report.json", report.to_string().as_bytes());
}

/// The validator finds the report wrong, and nothing else; the subjects of what it found.
fn found(dir: &Dir) -> String {
    let ended = dir.run(["validate", "out", "--against", "a.las", "-q"]);
    assert_eq!(ended.code(), 7, "{}", ended.stderr());
    let lines = ended.stdout();
    let mut errors = lines.lines().filter(|line| line.starts_with("error"));
    assert!(errors.all(|line| line.starts_with("error accuracy: ")), "{lines}");
    lines
}

/// A kilometre in cells of a metre.
fn kilometre() -> Las {
    millimetres(&[[0; 3], [333_333, 333_333, 0], [1_000_000, 1_000_000, 0]])
}

#[test]
fn planes_that_are_left_out_cost_what_is_said() {
    let (dir, ended) = convert(&kilometre(), &["--to", "batches", "--planes", "10"]);
    let line = "batches: decoded coordinates are off by at most 0.691 (by axis 0.489 0.489 0)";
    assert!(ended.stderr().contains(line), "{}", ended.stderr());
    assert!(ended.stderr().contains("integers of 3 of 3 points do not come back"), "{}", ended.stderr());
    let found = accuracy(&dir);
    // half a cell at both ends, a sixth of one at 333.333
    let errors = [0.488_281_25, 0.163_093_75, -0.488_281_25];
    assert!(near(&found["format"]["max"][0], 0.488_281_25), "{found}");
    assert!(near(&found["format"]["mean"][1], errors.iter().sum::<f64>() / 3.0), "{found}");
    let squares: f64 = errors.iter().map(|e| e * e).sum();
    assert!(near(&found["format"]["rms"][0], (squares / 3.0).sqrt()), "{found}");
    assert!(near(&found["format"]["rms_3d"], (squares * 2.0 / 3.0).sqrt()), "{found}");
    assert_eq!((&found["total"], &found["format"]["how"]), (&found["format"], &json!("measured")));
    assert_eq!(found["lattice"]["max"], json!([0.0, 0.0, 0.0]));
    assert_eq!(found["integers"], json!({"points": 3, "same": 0}));
    let errors = &dir.report("out")["outputs"][0]["details"]["errors"];
    assert_eq!(errors.as_object().unwrap().keys().collect::<Vec<_>>(), ["10"], "bits that are in the file");
    dir.validate("out", &["a.las"]);
}

#[test]
fn single_precision_in_a_long_leaf_costs_what_is_said() {
    let las = millimetres(&[[0; 3], [123_456_789, 987_654_321, 0], [i32::MAX - 1, i32::MAX - 1, 0]]);
    let (dir, ended) = convert(&las, &["--to", "bintree"]);
    let line = "bintree: decoded coordinates are off by at most 0.0736 (by axis 0.052 0.052 0)";
    assert!(ended.stderr().contains(line), "{}", ended.stderr());
    let found = accuracy(&dir);
    assert!(near(&found["format"]["max"][0], 0.052), "{found}");
    assert!(near(&found["format"]["mean"][0], -0.0095), "{found}");
    assert_eq!(found["integers"], json!({"points": 3, "same": 0}));
    assert_eq!(found["merged"], json!({"lattice": 0, "format": 0}));
    dir.validate("out", &["a.las"]);
    edit(&dir, |a| a["format"]["max"][0] = json!(0.0519));
    assert!(self::found(&dir).contains("max of the format in the report"));
}

#[test]
fn neighbours_that_fall_together_are_counted() {
    // eight millimetres around points 600 km apart: singles are 31 mm apart there
    let near = |at: i32| (0..8).map(move |i| [at + i, 0, 0]);
    let las = millimetres(&near(0).chain(near(600_000_000)).collect::<Vec<_>>());
    let (dir, ended) = convert(&las, &["--to", "bintree"]);
    let found = accuracy(&dir);
    assert_eq!(found["merged"], json!({"lattice": 0, "format": 16}));
    assert!(ended.stderr().contains("16 points fell together with others"), "{}", ended.stderr());
    dir.validate("out", &["a.las"]);
    let (dir, _) = convert(&las, &["--to", "batches", "--planes", "20"]);
    assert_eq!(accuracy(&dir)["merged"], json!({"lattice": 0, "format": 16}));
    dir.validate("out", &["a.las"]);
}

#[test]
fn an_octree_is_unchanged_to_the_rounding_of_doubles() {
    let (dir, ended) = convert(&Las::terrain(5000, 1), &["--to", "potree2"]);
    let line = "potree2: coordinates are unchanged to the rounding of doubles, at most ";
    assert!(ended.stderr().contains(line) && ended.stderr().contains("all integers come back"), "{}", ended.stderr());
    let found = accuracy(&dir);
    assert_eq!((&found["format"]["how"], &found["integers"]["same"]), (&json!("rounding"), &json!(5000)));
    assert!(found["total"]["max_3d"].as_f64().unwrap() < 5e-9);
    dir.validate("out", &["a.las"]);
    let mut binary = Las::terrain(100, 1);
    (binary.scale, binary.offset) = ([0.25; 3], [1000.0; 3]);
    let (_, ended) = convert(&binary, &["--to", "potree2"]);
    assert!(ended.stderr().contains("potree2: coordinates are unchanged; step 0.25"), "{}", ended.stderr());
}

#[test]
fn degrees_are_told_in_metres_too() {
    let dir = Dir::new();
    dir.write("a.txt", b"10.004 48.006 0\n10.5 48.5 500\n11 49 1000\n");
    dir.succeed(["convert", "a.txt", "-o", "out", "--scale", "0.01", "--crs", "EPSG:4326", "-q"]);
    let metres = accuracy(&dir)["metres"]["total"].clone();
    // a degree of longitude at 48.01, where the lattice has the southernmost point, and of latitude at 49
    assert!((metres["max"][0].as_f64().unwrap() - 0.004 * 74_610.93).abs() < 0.01, "{metres}");
    assert!((metres["max"][1].as_f64().unwrap() - 0.004 * 111_209.74).abs() < 0.01, "{metres}");
    dir.validate("out", &["a.txt"]);
}

#[test]
fn a_report_that_lies_is_found() {
    let (dir, _) = convert(&kilometre(), &["--to", "batches", "--planes", "10", "-q"]);
    let right = dir.report("out").to_string();
    type Lie = fn(&mut Value);
    let lies: [(Lie, &str); 6] = [
        (|a| a["format"] = a["lattice"].clone(), "max of the format in the report"),
        (|a| a["lattice"]["mean"][2] = json!(0.001), "mean of the lattice in the report"),
        (|a| a["format"]["rms"][1] = json!(0.3), "rms of the format in the report"),
        (|a| a["total"]["max"][0] = json!(0.1), "max of the total in the report"),
        (|a| a["integers"]["same"] = json!(3), "points whose integers come back, in the report"),
        (|a| a["merged"]["format"] = json!(2), "points merged by the format, in the report"),
    ];
    for (lie, subject) in lies {
        edit(&dir, lie);
        assert!(found(&dir).contains(subject), "{subject}");
        dir.write("out/report.json", right.as_bytes());
    }
    dir.validate("out", &["a.las"]);
    std::fs::remove_file(dir.path("out/report.json")).unwrap();
    dir.validate("out", &["a.las"]);
}

#[test]
fn each_of_several_datasets_has_its_own_figures_in_the_report_above() {
    let (dir, _) = convert(&kilometre(), &["--to", "potree2", "--to", "batches", "--planes", "10", "-q"]);
    let report = dir.report("out");
    let max = |i: usize| report["outputs"][i]["accuracy"]["format"]["max"][0].as_f64().unwrap();
    assert!(max(0) < 1e-9 && max(1) > 0.4);
    dir.validate("out", &["a.las"]);
    let mut report = dir.report("out");
    report["outputs"][1]["accuracy"]["format"]["max"] = json!([0.0, 0.0, 0.0]);
    dir.write("out/report.json", report.to_string().as_bytes());
    dir.validate("out/potree2", &["a.las"]);
    let ended = dir.run(["validate", "out/batches", "--against", "a.las", "-q"]);
    assert!(ended.stdout().contains("max of the format in the report"), "{}", ended.stdout());
}
