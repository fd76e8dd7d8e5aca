//! Points that are moved on the way in: units, axes, matrices, projections.

use pointmill_format::NodePoints;
use pointmill_format::potree2::Dataset;
use pointmill_testkit::files::fixture;
use pointmill_testkit::las::{Las, Point};

use crate::support::Dir;

/// World coordinates and normals (if there are any) of all points of an octree, in no particular order.
fn points_of(dir: &Dir, dataset: &str) -> Vec<([f64; 3], Option<[f32; 3]>)> {
    let dataset = Dataset::open(dir.path(dataset)).unwrap();
    let (mut points, mut all) = (NodePoints::default(), Vec::new());
    for node in dataset.read_hierarchy().unwrap() {
        dataset.read_points(&node, &mut points).unwrap();
        let normals = ["NormalX", "NormalY", "NormalZ"].map(|name| points.column::<f32>(name));
        for i in 0..points.len() {
            let normal = match normals {
                [Some(x), Some(y), Some(z)] => Some([x[i], y[i], z[i]]),
                _ => None,
            };
            all.push((points.world(i).unwrap(), normal));
        }
    }
    all
}

/// Asserts that these points, and no others, are in the dataset, each to a tenth of a millimetre.
fn holds(dir: &Dir, dataset: &str, expected: &[[f64; 3]]) {
    let found = points_of(dir, dataset);
    assert_eq!(found.len(), expected.len());
    for point in expected {
        let near = |p: &[f64; 3]| p.iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(found.iter().any(|(p, _)| near(p)), "{point:?} is not in {found:?}");
    }
}

const TEXT: &[u8] = b"10.5 20 3\n11 -21 4.25\n12 22 5\n";

#[test]
fn y_up_turns_points_and_normals_a_quarter_about_x() {
    let dir = Dir::new();
    let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double z\n\
                property float nx\nproperty float ny\nproperty float nz\nend_header\n";
    dir.write("a.ply", format!("{head}1 2 3 0 1 0\n-4 5 -6 0 0 1\n").as_bytes());
    dir.succeed(["convert", "a.ply", "-o", "out", "-q", "--axes", "y-up"]);
    let mut found = points_of(&dir, "out");
    found.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    // the lattice of doubles rounds the last digit
    found.iter_mut().for_each(|(point, _)| *point = point.map(|v| (v * 1e9).round() / 1e9));
    let (up, north) = ([0.0, 0.0, 1.0], [0.0, -1.0, 0.0]);
    let expected = [([-4.0, 6.0, 5.0], Some(north)), ([1.0, -3.0, 2.0], Some(up))];
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.1, expected.1);
        assert!((0..3).all(|a| (found.0[a] - expected.0[a]).abs() < 1e-12), "{found:?}");
    }
    assert_eq!(found.len(), 2);
    dir.succeed(["validate", "out", "-q", "--against", "a.ply", "--axes", "y-up"]);
    dir.run(["validate", "out", "-q", "--against", "a.ply"]).failed_with(7, &[]);
}

#[test]
fn a_matrix_in_quotes_or_in_a_file_comes_after_the_axes() {
    let dir = Dir::new();
    dir.write("a.xyz", TEXT);
    // y-up: (x, -z, y); a quarter turn about z: (-y, x, z), so (z, x, y); then the shift
    dir.write("m.txt", b"0 -1 0 1000\n1 0 0 -0.5\n0 0 1.000000000000 7\n0 0 0 1\n");
    let typed = "0,-1,0,1000, 1,0,0,-0.5, 0,0,1,7, 0,0,0,1";
    let expected = [[1003.0, 10.0, 27.0], [1004.25, 10.5, -14.0], [1005.0, 11.5, 29.0]];
    for (out, matrix) in [("a", typed), ("b", "m.txt")] {
        dir.succeed(["convert", "a.xyz", "-o", out, "-q", "--axes", "y-up", "--transform", matrix]);
        holds(&dir, out, &expected);
    }
    let args = ["--axes", "y-up", "--transform", "m.txt"];
    let ended = dir.succeed(["convert", "a.xyz", "-o", "c", "--dry-run", "--json"].iter().chain(&args));
    let estimate: serde_json::Value = serde_json::from_str(&ended.stdout()).unwrap();
    assert_eq!(estimate["bounds"], serde_json::json!([1003.0, 10.0, -14.0, 1005.0, 11.5, 29.0]));
    for (to, out) in [("bintree", "d"), ("batches", "e")] {
        dir.succeed(["convert", "a.xyz", "-o", out, "-q", "--to", to].iter().chain(&args));
        dir.succeed(["validate", out, "-q", "--against", "a.xyz"].iter().chain(&args));
    }
}

#[test]
fn bounds_are_in_the_coordinates_after_the_move() {
    let dir = Dir::new();
    dir.write("a.xyz", TEXT);
    let shift = "1 0 0 100 0 1 0 0 0 0 1 0 0 0 0 1";
    dir.succeed(["convert", "a.xyz", "-o", "out", "-q", "--transform", shift, "--bounds", "110.9,-50,0..111.1,0,9"]);
    holds(&dir, "out", &[[111.0, -21.0, 4.25]]);
    dir.succeed(["validate", "out", "-q", "--against", "a.xyz", "--transform", shift]);
}

#[test]
fn integers_of_las_stay_as_they_are_under_a_quarter_turn_and_a_shift() {
    let dir = Dir::new();
    let points = [[100, 250, -7], [-5, 3, 2_000_000_000]].map(Point::at).to_vec();
    let las = Las { scale: [0.001; 3], offset: [500_000.0, 5_400_000.0, 0.0], ..Las::new(points) };
    dir.write("a.las", &las.bytes());
    let matrix = "0 -1 0 5500000  1 0 0 -400000  0 0 1 12.5  0 0 0 1";
    dir.succeed(["convert", "a.las", "-o", "out", "-q", "--transform", matrix]);
    holds(&dir, "out", &[[99_999.75, 100_000.1, 12.493], [99_999.997, 99_999.995, 2_000_012.5]]);
    let report = dir.report("out");
    assert_eq!(report["grid"]["scale"], serde_json::json!([0.001, 0.001, 0.001]));
    let moved = &report["outputs"][0]["accuracy"]["lattice"]["max"];
    assert!(moved.as_array().unwrap().iter().all(|v| v.as_f64().unwrap() < 1e-8), "{moved}");
}

#[test]
fn every_fixture_turns_and_still_holds_its_points() {
    let dir = Dir::new();
    let matrix = "0.6 -0.8 0 100  0.8 0.6 0 -50  0 0 1 3  0 0 0 1";
    for name in ["e57/scans.e57", "e57/normals.e57", "rows/two_scans.ptx", "rows/not_finite.ply", "las/format7.laz"] {
        let path = fixture(name);
        let path = path.to_str().unwrap();
        dir.succeed(["convert", path, "-o", "out", "-q", "--overwrite", "--transform", matrix]);
        dir.succeed(["validate", "out", "-q", "--against", path, "--transform", matrix]);
    }
}

#[test]
fn a_matrix_that_cannot_be_undone_is_a_usage_error() {
    let dir = Dir::new();
    dir.write("a.xyz", TEXT);
    dir.write("words.txt", b"1 0 0 a");
    let table = [
        ("1 0 0 0  0 1 0 0  0 0 0 0  0 0 0 1", "singular"),
        ("1 0 0 0  0 1 0 0  0 0 1 0  0 0 1 1", "last row"),
        ("1 0 0", "3 numbers"),
        ("words.txt", "holds more than numbers"),
        ("-1 0 0 inf  0 1 0 0  0 0 1 0  0 0 0 1", "not finite"),
    ];
    for (matrix, reason) in table {
        dir.run(["convert", "a.xyz", "-o", "out", "--transform", matrix]).failed_with(2, &["--transform", reason]);
    }
}

/// Rows of `fixtures/crs/expected.tsv`, by PROJ: points of the first system, and where they are in the second.
fn by_proj(from: &str, to: &str) -> (String, Vec<[f64; 3]>) {
    let table = std::fs::read_to_string(fixture("crs/expected.tsv")).unwrap();
    let (mut text, mut images) = (String::new(), Vec::new());
    for line in table.lines().filter(|line| line.contains(&format!("\t{from}\t{to}\t"))) {
        let fields: Vec<&str> = line.split('\t').collect();
        text += &format!("{} {} {}\n", fields[3], fields[4], fields[5]);
        images.push([6, 7, 8].map(|i: usize| fields[i].parse().unwrap()));
    }
    assert_eq!(images.len(), 5, "{from} {to}");
    (text, images)
}

fn metadata(dir: &Dir, dataset: &str) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(dir.path(dataset).join("metadata.json")).unwrap()).unwrap()
}

#[test]
fn points_are_reprojected_where_proj_puts_them_and_the_metadata_has_the_target() {
    let table = [
        ("EPSG:25832", "EPSG:25833", "+proj=utm +zone=33"),
        ("EPSG:32632", "EPSG:3857", "+proj=merc"),
        ("EPSG:2154", "EPSG:3946", "+proj=lcc"),
        ("EPSG:2227", "EPSG:26910", "+proj=utm +zone=10"),
        ("EPSG:32632", "EPSG:4978", "+proj=geocent"),
    ];
    for (from, to, projection) in table {
        let dir = Dir::new();
        let (text, images) = by_proj(from, to);
        dir.write("a.xyz", text.as_bytes());
        // millimetres, where the extent leaves no room for more
        let args = ["--crs", from, "--reproject", to];
        dir.succeed(["convert", "a.xyz", "-o", "out", "-q", "--scale", "0.005"].iter().chain(&args));
        let found = points_of(&dir, "out");
        for image in images {
            let near = |p: &[f64; 3]| p.iter().zip(image).all(|(a, b)| (a - b).abs() < 0.0026);
            assert!(found.iter().any(|(p, _)| near(p)), "{from} {to}: {image:?} is not in {found:?}");
        }
        let found = metadata(&dir, "out")["projection"].as_str().unwrap().to_owned();
        assert!(found.starts_with(projection), "{from} {to}: {found}");
        let options = &dir.report("out")["options"];
        assert_eq!(options["reproject"], to);
        dir.succeed(["validate", "out", "-q", "--against", "a.xyz"].iter().chain(&args));
    }
}

#[test]
fn a_scan_is_reprojected_from_the_system_that_it_declares() {
    let dir = Dir::new();
    let path = fixture("las/autzen_trim.laz");
    let path = path.to_str().unwrap();
    let args = ["--reproject", "EPSG:3740"]; // NAD83(HARN) / UTM zone 10N
    dir.succeed(["convert", path, "-o", "out", "-q", "--every", "50"].iter().chain(&args));
    let report = dir.report("out");
    let metadata = std::fs::read(dir.path("out/metadata.json")).unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&metadata).unwrap();
    let position = &metadata["attributes"][0];
    let measured = ["min", "max"].into_iter().flat_map(|end| position[end].as_array().unwrap());
    // by laspy and PROJ, of every 50th point; coordinates move by half a step at most
    let by_proj = [494_123.211_71, 4_877_428.847_31, 406.43, 494_476.437_02, 4_877_581.333_85, 513.98];
    for (found, by_proj) in measured.zip(by_proj) {
        assert!((found.as_f64().unwrap() - by_proj).abs() < 2e-3, "{found} for {by_proj}");
    }
    // 0.01 ft are 3 mm: no finer step is made up
    let step = report["grid"]["scale"][0].as_f64().unwrap();
    assert!((0.001..=0.003_05).contains(&step), "{step}");
    let warnings = report["warnings"].to_string();
    assert!(warnings.contains("nothing says the unit of its heights"), "{warnings}");
    // the unit of the scan is not that of the dataset, and nobody said that it was
    assert!(!warnings.contains("declare coordinates in units"), "{warnings}");
    assert!(metadata["projection"].as_str().unwrap().starts_with("+proj=utm +zone=10"), "{metadata}");
    dir.succeed(["validate", "out", "-q", "--against", path].iter().chain(&args));
}

#[test]
fn a_point_outside_the_domain_of_the_projection_is_counted_as_invalid() {
    let dir = Dir::new();
    dir.write("a.xyz", b"9.5 48 100\n10 95 100\n10.5 48.5 100\n");
    let args = ["convert", "a.xyz", "-o", "out", "-q", "--crs", "EPSG:4326", "--reproject", "EPSG:32632"];
    dir.succeed(args);
    let points = &dir.report("out")["points"];
    assert_eq!((&points["kept"], &points["invalid"]), (&2.into(), &1.into()));
    dir.run(args.iter().chain(&["--overwrite", "--invalid", "fail"])).failed_with(3, &["point 1"]);
}

#[test]
fn what_cannot_be_reprojected_exactly_is_refused() {
    let dir = Dir::new();
    dir.write("a.xyz", b"400000 300000 10\n");
    let table: [(&[&str], i32, &[&str]); 6] = [
        (&["--crs", "EPSG:27700", "--reproject", "EPSG:4326"], 4, &["grid", "a.xyz"]),
        (&["--crs", "EPSG:25832+5783", "--reproject", "EPSG:4936"], 4, &["ellipsoid"]),
        (&["--reproject", "EPSG:4326"], 4, &["no coordinate reference system", "--crs"]),
        (&["--reproject", "UTM 32"], 2, &["--reproject", "UTM 32"]),
        (&["--crs", "EPSG:27572", "--reproject", "EPSG:2154"], 4, &["EPSG:27572"]),
        (&["--crs", "EPSG:4326", "--units", "ft"], 4, &["degrees"]),
    ];
    for (args, code, words) in table {
        dir.run(["convert", "a.xyz", "-o", "out"].iter().chain(args)).failed_with(code, words);
    }
    assert_eq!(dir.names(), ["a.xyz"]);
    dir.run(["info", "a.xyz", "--crs", "EPSG:25832"]).failed_with(2, &["--crs"]);
}

#[test]
fn units_are_scaled_to_metres_or_to_those_of_the_system() {
    let dir = Dir::new();
    dir.write("a.xyz", TEXT);
    dir.succeed(["convert", "a.xyz", "-o", "ft", "-q", "--units", "ft"]);
    holds(&dir, "ft", &[[3.2004, 6.096, 0.9144], [3.3528, -6.4008, 1.2954], [3.6576, 6.7056, 1.524]]);
    // cm, then y up, then a shift in metres
    let shift = "1 0 0 500000 0 1 0 5400000 0 0 1 100 0 0 0 1";
    let args = ["--units", "cm", "--axes", "y-up", "--transform", shift, "--crs", "EPSG:25832"];
    dir.succeed(["convert", "a.xyz", "-o", "cm", "-q"].iter().chain(&args));
    holds(
        &dir,
        "cm",
        &[[500_000.105, 5_399_999.97, 100.2], [500_000.11, 5_399_999.957_5, 99.79], [500_000.12, 5_399_999.95, 100.22]],
    );
    let options = &dir.report("cm")["options"];
    assert_eq!(
        (&options["units"], &options["axes"], &options["transform"]),
        (&"cm".into(), &"y-up".into(), &shift.into())
    );
    dir.succeed(["validate", "cm", "-q", "--against", "a.xyz"].iter().chain(&args));
    // EPSG:2994 is in feet: the numbers stay
    dir.succeed(["convert", "a.xyz", "-o", "kept", "-q", "--units", "ft", "--crs", "EPSG:2994"]);
    holds(&dir, "kept", &[[10.5, 20.0, 3.0], [11.0, -21.0, 4.25], [12.0, 22.0, 5.0]]);
}

#[test]
fn a_unit_other_than_that_of_the_system_that_a_scan_declares_is_a_warning() {
    let dir = Dir::new();
    let path = fixture("las/autzen_trim.laz");
    let ended = dir.succeed(["convert", path.to_str().unwrap(), "-o", "out", "--every", "1000", "--units", "m"]);
    let line = "its coordinate reference system is in feet; the coordinates are taken as metres and scaled";
    assert!(ended.stderr().contains(line), "{}", ended.stderr());
    let ended = dir.succeed(["convert", path.to_str().unwrap(), "-o", "ft", "--every", "1000", "--units", "ft"]);
    assert!(!ended.stderr().contains("are taken as"), "{}", ended.stderr());
}
