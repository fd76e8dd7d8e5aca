//! Places that very many points share, points where the scanner stood, borders of boxes, and points that repeat.

use std::fmt::Write as _;

use pointmill_testkit::las::{self, Las};
use serde_json::json;

use crate::support::Dir;

/// Little-endian PLY of doubles.
fn ply(points: impl IntoIterator<Item = [f64; 3]>) -> Vec<u8> {
    let body: Vec<u8> = points.into_iter().flatten().flat_map(f64::to_le_bytes).collect();
    let head = "ply\nformat binary_little_endian 1.0\nelement vertex";
    let properties = "property double x\nproperty double y\nproperty double z\nend_header\n";
    [format!("{head} {}\n{properties}", body.len() / 24).into_bytes(), body].concat()
}

/// A grid of one scanner: rows of local x, y, z and intensity.
fn ptx(matrix: &str, points: &[[f64; 3]]) -> String {
    let mut text = format!("{}\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n{matrix}\n", points.len());
    points.iter().for_each(|[x, y, z]| writeln!(text, "{x} {y} {z} 0.5").unwrap());
    text
}

#[test]
fn a_mass_of_points_in_one_place_is_told_and_the_only_other_point_is_no_outlier() {
    let dir = Dir::new();
    let zeros = std::iter::repeat_n([0.0; 3], 9_999);
    dir.write("a.ply", &ply(std::iter::once([12.25, -7.5, 3.0]).chain(zeros)));
    let ended = dir.succeed(["convert", "a.ply", "-o", "out"]).stderr();
    assert!(ended.contains("9,999 of 10,000 points share the position (0, 0, 0); --origin-points skip"), "{ended}");
    assert!(!ended.contains("--bounds"), "{ended}");
    let report = dir.report("out");
    assert_eq!(report["shared_places"], json!([{ "position": [0.0, 0.0, 0.0], "points": 9_999 }]));
    assert_eq!((&report["points"]["kept"], &report["inputs"][0]["points_at_origin"]), (&json!(10_000), &json!(9_999)));
    dir.validate("out", &["a.ply"]);

    dir.succeed(["convert", "a.ply", "-o", "out2", "--origin-points", "skip", "--to", "batches", "--to", "bintree"]);
    let points = &dir.report("out2")["points"];
    assert_eq!((&points["read"], &points["kept"], &points["at_origin"]), (&json!(10_000), &json!(1), &json!(9_999)));
    dir.validate("out2/batches", &["a.ply"]);
    dir.validate("out2/bintree", &["a.ply"]);
}

#[test]
fn masses_elsewhere_are_found_in_small_and_large_clouds_beside_a_surface() {
    let dir = Dir::new();
    let surface = |n: i32| (0..n).map(|i| [i % 211, i / 211 * 7, i * 31 % 97]);
    for (n, mass) in [(100, 20), (60_000, 3_000)] {
        let points = surface(n).chain((0..mass).map(|_| [12_345, 67, -89])).chain((0..mass - 1).map(|_| [-5, 0, 0]));
        let las = Las { scale: [0.01; 3], offset: [500_000.0, 0.0, 0.0], ..Las::numbered(points) };
        dir.write("a.las", &las.bytes());
        let ended = dir.succeed(["convert", "a.las", "-o", "out", "--overwrite"]).stderr();
        assert!(ended.contains("points share the position (500123.45, 0.67, -0.89), and one more place"), "{ended}");
        let report = dir.report("out");
        let counts: Vec<_> = report["shared_places"].as_array().unwrap().iter().map(|p| p["points"].clone()).collect();
        assert_eq!(counts, [json!(mass), json!(mass - 1)]);
    }
    let scattered = surface(60_000).chain((0..500).map(|_| [12_345, 67, -89]));
    dir.write("a.las", &Las::numbered(scattered).bytes());
    dir.succeed(["convert", "a.las", "-o", "out", "--overwrite"]);
    assert_eq!(dir.report("out")["shared_places"], json!([]), "less than one in a hundred");
}

#[test]
fn points_where_a_scanner_stood_are_counted_and_skipped_on_request() {
    let dir = Dir::new();
    let (here, there) = ("1 0 0 0\n0 1 0 0\n0 0 1 0\n100.5 200.25 3 1", "0 1 0 0\n-1 0 0 0\n0 0 1 0\n-7 2 0.125 1");
    let mut scan = vec![[1.0, 2.0, 3.0], [0.001, 0.0, 0.0], [4.0, 5.0, 6.0]];
    // the other scanner stands at −7 2 0.125; here that is a place like any other
    scan.push([-107.5, -200.25, -2.875]);
    let near_zero = [[1e-9, 0.0, 0.0]; 3];
    let text = ptx(here, &scan) + &ptx(there, &[&scan[..], &near_zero].concat());
    dir.write("plain.ptx", text.as_bytes());
    assert!(!dir.succeed(["convert", "plain.ptx", "-o", "out0"]).stderr().contains("origin"));
    assert_eq!(dir.report("out0")["inputs"][0]["points_at_origin"], 0);

    // rows of zeros are cells without a point, so origins come as a rounded nothing
    let tiny = [[1e-300, 0.0, 0.0]; 4];
    let text = ptx(here, &[&scan[..], &tiny].concat()) + &ptx(there, &[&tiny[..2], &scan].concat());
    dir.write("origin.ptx", text.as_bytes());
    let ended = dir.succeed(["convert", "origin.ptx", "-o", "out"]).stderr();
    assert!(ended.contains("6 of 14 points lie exactly at the origin of their scan"), "{ended}");
    assert_eq!(dir.report("out")["points"]["kept"], 14);
    let ended = dir.succeed(["convert", "origin.ptx", "-o", "out2", "--origin-points", "skip"]).stderr();
    assert!(ended.contains("6 at the scanner's origin"), "{ended}");
    let report = dir.report("out2");
    assert_eq!((&report["points"]["kept"], &report["points"]["at_origin"]), (&json!(8), &json!(6)));
    assert_eq!(report["options"]["originPoints"], "skip");
    dir.validate("out2", &["origin.ptx"]);
}

#[test]
fn boxes_end_where_they_were_said_to_end() {
    let dir = Dir::new();
    let las = Las { scale: [0.1; 3], offset: [0.0; 3], ..Las::numbered((0..10).map(|i| [i, 2 * i, -i])) };
    dir.write("a.las", &las.bytes());
    dir.write(
        "a.txt",
        (0..10).map(|i| format!("0.{i} {} -0.{i}\n", f64::from(2 * i) / 10.0)).collect::<String>().as_bytes(),
    );
    let single = |i: i32| [i as f32 / 10.0, (2 * i) as f32 / 10.0, -i as f32 / 10.0];
    let body: Vec<u8> = (0..10).flat_map(single).flat_map(f32::to_le_bytes).collect();
    let head = "ply\nformat binary_little_endian 1.0\nelement vertex 10\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    dir.write("a.ply", &[head.as_bytes(), &body].concat());
    for file in ["a.las", "a.txt", "a.ply"] {
        for (bounds, kept) in [("0,0,-1..0.3,9,9", 4), ("0.3,0,-0.7..9,9,9", 5), ("0.31,0.6,-9..9,9,-0.6", 4)] {
            dir.succeed(["convert", file, "-o", "out", "--overwrite", "-q", "--bounds", bounds]);
            assert_eq!(dir.report("out")["points"]["kept"], kept, "{file} {bounds}");
            dir.validate("out", &[file]);
        }
    }
}

#[test]
fn points_that_only_the_step_makes_equal_are_no_duplicates() {
    let dir = Dir::new();
    // a thousand places, the first hundred twice
    let row = |i: u32| format!("{}.{:03} {}.5 0.125\n", i / 100, i % 100, i % 7);
    dir.write("a.txt", (0..1_100).map(|i| row(i % 1_000)).collect::<String>().as_bytes());
    let las = Las {
        scale: [0.001; 3],
        offset: [0.0; 3],
        ..Las::new((0..1_100).map(|i: i32| las::Point::at([i % 1_000, 3, 0])).collect())
    };
    dir.write("a.las", &las.bytes());
    for file in ["a.txt", "a.las"] {
        for step in ["auto", "1", "0.25"] {
            dir.succeed(["convert", file, "-o", "out", "--overwrite", "-q", "--duplicates", "drop", "--scale", step]);
            let report = dir.report("out");
            let output = &report["outputs"][0];
            assert_eq!(
                (&output["points"], &output["duplicates_dropped"]),
                (&json!(1_000), &json!(100)),
                "{file} {step}"
            );
            dir.validate("out", &[file]);
        }
    }
    // a dataset that has lost one of the points which are equal on its lattice
    dir.succeed(["convert", "a.las", "-o", "coarse", "-q", "--duplicates", "drop", "--scale", "1"]);
    let points = (0..1_100).filter(|i| i % 1_000 != 501).map(|i: i32| las::Point::at([i % 1_000, 3, 0]));
    let las = Las { scale: [0.001; 3], offset: [0.0; 3], ..Las::new(points.collect()) };
    dir.write("less.las", &las.bytes());
    let ended = dir.run(["validate", "coarse", "--against", "less.las"]);
    assert_eq!(ended.code(), 7, "{}", ended.stdout());
    assert!(ended.stdout().contains("surplus point"), "{}", ended.stdout());
}

#[test]
fn the_same_place_in_files_of_several_kinds_is_one_place() {
    let dir = Dir::new();
    let points: Vec<las::Point> = (0..50).map(|i| las::Point::at([7 * i, -i, 3])).collect();
    let fine = |p: &las::Point| las::Point::at(p.xyz.map(|v| 10 * v));
    let finer = points.iter().map(fine).collect();
    dir.write("a.las", &Las { scale: [0.01; 3], offset: [0.0; 3], ..Las::new(points) }.bytes());
    dir.write("b.las", &Las { scale: [0.001; 3], offset: [0.0; 3], ..Las::new(finer) }.bytes());
    for step in ["auto", "0.5", "0.003"] {
        let files = ["a.las", "b.las"];
        dir.succeed(
            [&["convert"], &files[..], &["-o", "out", "--overwrite", "-q", "--duplicates", "drop", "--scale", step]]
                .concat(),
        );
        assert_eq!(dir.report("out")["outputs"][0]["points"], 50, "{step}");
        dir.validate("out", &files);
    }
}
