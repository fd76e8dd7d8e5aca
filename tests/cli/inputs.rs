//! Scans of every kind: converted, described, mixed; files that state too little or state it wrongly.

use std::fs;
use std::path::Path;

use pointmill_testkit::files::{corpus, entries, fixture};
use pointmill_testkit::las::Las;
use pointmill_testkit::scans::scan_fixtures;
use serde_json::{Value, json};

use crate::support::Dir;

/// Converts a file and proves its points; one without points must say so. The points read.
fn converts(path: &Path) -> u64 {
    let dir = Dir::new();
    let text = path.to_str().unwrap();
    let ended = dir.run(["convert", text, "-o", "out", "-q"]);
    if ended.code() == 3 && ended.stderr().contains("holds no points") {
        assert!(dir.names().is_empty(), "{text}");
        return 0;
    }
    assert_eq!(ended.code(), 0, "{}", ended.stderr());
    dir.validate("out", &[text]);
    dir.report("out")["points"]["read"].as_u64().unwrap()
}

#[test]
fn every_fixture_converts_and_holds_its_points() {
    for fixture in ["e57", "rows"].iter().flat_map(|folder| scan_fixtures(folder)) {
        assert_eq!(converts(&fixture.path), fixture.points, "{}", fixture.name);
    }
}

#[test]
fn scans_of_others_convert_and_hold_their_points() {
    for folder in ["e57", "ply", "pcd", "text", "las/permutations"] {
        let Some(folder) = corpus(folder) else { return };
        // a PLY without vertices has nothing to convert
        let scans = entries(&folder).into_iter().filter(|p| p.is_file() && !p.ends_with("no_vertex.ply"));
        scans.for_each(|path| {
            converts(&path);
        });
    }
}

#[test]
fn mixed_inputs_have_the_union_of_their_attributes() {
    let dir = Dir::new();
    dir.write("in/a.las", &Las::terrain(3000, 1).bytes());
    for name in ["e57/scans.e57", "rows/all_little.ply", "rows/two_scans.ptx", "rows/open3d_f8_compressed.pcd"] {
        let to = dir.path("in").join(Path::new(name).file_name().unwrap());
        fs::copy(fixture(name), to).unwrap();
    }
    dir.write("in/readme.txt", b"no scan");
    // the frames of these scans are far apart
    dir.run(["convert", "in", "-o", "out"]).failed_with(3, &["--outliers keep"]);
    let ended = dir.succeed(["convert", "in", "-o", "out", "--outliers", "keep"]);
    assert!(ended.stderr().contains("1 other file skipped"), "{}", ended.stderr());
    let report = dir.report("out");
    let names: Vec<&str> =
        report["outputs"][0]["attributes"].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect();
    for name in ["rgb", "intensity", "gps-time", "point source id", "NormalX", "scalar_Quality", "timestamp"] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
    let read = report["points"]["read"].as_u64().unwrap();
    assert_eq!(read, report["outputs"][0]["points"].as_u64().unwrap() + report["points"]["invalid"].as_u64().unwrap());
    dir.validate("out", &["in"]);
}

#[test]
fn one_name_with_two_types_is_one_attribute_that_holds_both() {
    let dir = Dir::new();
    dir.write("a.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nproperty uchar quality\nend_header\n1 2 3 4\n2 3 4 5\n");
    dir.write("b.xyz", b"# x y z quality\n1.5 2 3 0.25\n2.5 3 4 0.5\n");
    dir.succeed(["convert", "a.ply", "b.xyz", "-o", "out", "-q"]);
    let report = dir.report("out");
    assert_eq!(report["outputs"][0]["attributes"], json!(["position", "quality"]));
    assert_eq!(report["attributes"], json!([{ "name": "quality", "type": "double", "elements": 1 }]));
    dir.validate("out", &["a.ply", "b.xyz"]);
}

#[test]
fn a_far_point_is_named_with_the_bounds_that_leave_it_out() {
    let dir = Dir::new();
    let mut text: String = (0..4000).map(|i| format!("{}.25 {}.5 {}\n", i % 61, i % 67, i % 7)).collect();
    text += "9000000 0 0\n";
    dir.write("a.xyz", text.as_bytes());
    let ended = dir.succeed(["convert", "a.xyz", "-o", "out"]).stderr();
    let line = ended.lines().find(|l| l.contains("--bounds")).unwrap_or_else(|| panic!("{ended}"));
    assert!(line.contains("1 point is far from all others"), "{line}");
    let bounds = line.split("--bounds ").nth(1).unwrap().split(' ').next().unwrap();
    let step = |out: &str| dir.report(out)["grid"]["scale"][0].as_f64().unwrap();
    dir.succeed(["convert", "a.xyz", "-o", "out2", "-q", "--bounds", bounds]);
    let report = dir.report("out2");
    assert_eq!((&report["points"]["outside_bounds"], &report["outputs"][0]["points"]), (&json!(1), &json!(4000)));
    assert_eq!((step("out"), step("out2")), (0.01, 0.01), "31 bits hold both; the tree has fewer levels");
    dir.validate("out2", &["a.xyz"]);
}

#[test]
fn points_without_a_position_are_counted_or_refused() {
    let dir = Dir::new();
    let path = fixture("rows/not_finite.ply");
    let path = path.to_str().unwrap();
    dir.succeed(["convert", path, "-o", "out", "-q"]);
    let points = dir.report("out")["points"].clone();
    let n = |name: &str| points[name].as_u64().unwrap();
    assert!(n("invalid") > 0 && n("kept") > 0, "{points}");
    assert_eq!(n("read"), n("kept") + n("invalid"));
    dir.validate("out", &[path]);
    dir.run(["convert", path, "-o", "out2", "--invalid", "fail"]).failed_with(3, &["not_finite.ply", "--invalid skip"]);
    assert_eq!(dir.names(), ["out"]);
}

#[test]
fn invalid_columns_are_reported_with_advice() {
    let dir = Dir::new();
    dir.write("a.xyz", b"1 2 3 4\n2 3 4 5\n");
    let convert = |columns: &str| dir.run(["convert", "a.xyz", "-o", "out", "--columns", columns]);
    convert("x,z,y2,i").failed_with(2, &["--columns", "there is no y"]);
    convert("x,y,z,q:byte").failed_with(2, &["--columns", "byte", "uint8"]);
    convert("x,y,z").failed_with(3, &["a.xyz", "3 columns are named", "the row has 4", "(byte 0)", "- for those"]);
    convert("x,y,z,q:int8,r,g").failed_with(3, &["a.xyz", "6 columns are named"]);
    assert_eq!(dir.names(), ["a.xyz"]);
}

#[test]
fn columns_and_separators_are_what_was_typed() {
    let dir = Dir::new();
    dir.write("a.txt", b"7|1|10.5|-|20.5\n8|2|11.5|-|21.5\n");
    let options = ["--columns", "quality:uint8,c,y,-,x", "--separator", "|"];
    dir.succeed(["convert", "a.txt", "-o", "out", "-q"].iter().chain(&options));
    let report = dir.report("out");
    assert_eq!(report["outputs"][0]["attributes"], json!(["position", "classification", "quality"]));
    assert_eq!(report["inputs"][0]["bounds_measured"], json!([20.5, 10.5, 0.0, 21.5, 11.5, 0.0]));
    let validate = ["validate", "out", "-q", "--against", "a.txt"];
    assert_eq!(dir.run(validate.iter().chain(&options)).code(), 0);
    assert_ne!(dir.run(validate).code(), 0, "without them it is no scan");
}

#[test]
fn row_and_column_come_when_asked_for() {
    let dir = Dir::new();
    let path = fixture("e57/scans.e57");
    let path = path.to_str().unwrap();
    let has_row = |options: &[&str]| {
        dir.succeed(["convert", path, "-o", "out", "-q", "--overwrite"].iter().chain(options));
        dir.report("out")["outputs"][0]["attributes"].as_array().unwrap().contains(&json!("rowIndex"))
    };
    assert!(!has_row(&[]));
    assert!(has_row(&["--row-column"]));
    assert_eq!(dir.run(["validate", "out", "-q", "--row-column", "--against", path]).code(), 0);
}

fn info(dir: &Dir, name: &str, options: &[&str]) -> Value {
    let path = fixture(name);
    let json = dir.succeed(["info", path.to_str().unwrap(), "--json"].iter().chain(options)).stdout();
    serde_json::from_str::<Value>(&json).unwrap()[0].clone()
}

#[test]
fn info_tells_the_scans_of_an_e57_and_their_poses() {
    let dir = Dir::new();
    let object = info(&dir, "e57/scans.e57", &["--deep"]);
    assert_eq!(object["format"], "E57 1.0, 3 scans");
    let scans = object["scans"].as_array().unwrap();
    assert_eq!((scans.len(), &scans[0]["points"]), (3, &json!(200)));
    assert_eq!(scans[0]["translation"], json!([500_000.25, -4_000_000.5, 100.0]));
    assert!(
        (scans[2]["rotation"][0][0].as_f64().unwrap() - 0.28).abs() < 1e-12,
        "a quaternion of length 2: {object:#}"
    );
    // libE57Format: 464 of the 600 have a valid position
    assert_eq!((&object["measured"]["points"], &object["measured"]["invalid"]), (&json!(600), &json!(136)));
    assert!(object["measured"]["bounds"]["min"][0].as_f64().unwrap() < -132_805.0);
    let path = fixture("e57/scans.e57");
    let text = dir.succeed(["info", path.to_str().unwrap(), "--deep"]).stdout();
    for words in ["136 of them without a valid position", "at 500000.25 -4000000.5 100", "turned by 73.7398°", "scans"]
    {
        assert!(text.contains(words), "{words} is not in {text}");
    }
}

#[test]
fn info_tells_how_finely_coordinates_are_stored() {
    let dir = Dir::new();
    assert_eq!(
        info(&dir, "rows/open3d_f4_binary.pcd", &[])["resolution"],
        json!([{ "stored": "single" }, { "stored": "single" }, { "stored": "single" }])
    );
    assert_eq!(info(&dir, "rows/open3d_f8_binary.pcd", &[])["resolution"][2]["stored"], "double or text");
    let steps = info(&dir, "e57/widths.e57", &[])["resolution"].clone();
    assert_eq!(steps[0], json!({ "stored": "steps", "step": 0.5, "offset": 0.0 }), "{steps}");
    assert_eq!(info(&dir, "las/format3.las", &[])["resolution"], Value::Null);
    let path = fixture("rows/open3d_f4_binary.pcd");
    let text = dir.succeed(["info", path.to_str().unwrap(), "--deep"]).stdout();
    assert!(text.contains("stored in single precision, steps of"), "{text}");
}

#[test]
fn info_measures_every_kind() {
    let dir = Dir::new();
    for (name, points) in
        [("rows/two_scans.ptx", None), ("rows/xyzirgb.txt", None), ("e57/same_points.e57", Some(2500))]
    {
        let object = info(&dir, name, &["--deep"]);
        assert_eq!(object["kind"], "scan");
        let measured = &object["measured"];
        assert!(measured["points"].as_u64().unwrap() > 0 && measured["bounds"]["min"][0].is_number(), "{object:#}");
        assert!(points.is_none_or(|n| measured["points"] == n), "{object:#}");
        assert!(measured["ranges"]["rgb"]["max"][2].is_number(), "{object:#}");
    }
    assert_eq!(info(&dir, "rows/two_scans.ptx", &[])["scans"].as_array().unwrap().len(), 2);
}
