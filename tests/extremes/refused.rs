//! What no dataset can hold is refused with one line and the right exit code, and nothing is left behind; points without a
//! position are skipped and counted (`cases`).

use pointmill_testkit::las::{Las, Point};

use crate::support::Dir;

fn las(scale: [f64; 3], offset: [f64; 3], points: &[[i32; 3]]) -> Vec<u8> {
    Las { scale, offset, ..Las::new(points.iter().map(|xyz| Point::at(*xyz)).collect()) }.bytes()
}

/// Name of the scan, its bytes, more options, exit code, words of the line.
type Row<'a> = (&'a str, Vec<u8>, &'a [&'a str], i32, &'a [&'a str]);

fn refused(rows: &[Row<'_>]) {
    for (name, bytes, options, code, words) in rows {
        let dir = Dir::new();
        dir.write(name, bytes);
        let ended = dir.run(["convert", name, "-o", "out", "-q"].iter().chain(*options));
        let lines = ended.stderr().lines().filter(|line| line.starts_with("error: ")).count();
        assert_eq!(lines, 1, "{name} {options:?}: {}", ended.stderr());
        ended.failed_with(*code, words);
        assert_eq!(dir.names(), [*name], "{options:?}: something is left behind");
    }
}

#[test]
fn steps_and_offsets_that_no_coordinate_has() {
    let some: &[[i32; 3]] = &[[1, 1, 1], [2, 2, 2]];
    let step = |x| {
        ("a.las", las([x, 0.001, 0.001], [0.0; 3], some), &[] as &[&str], 3, &["scale of x", "byte 131"] as &[&str])
    };
    let place =
        |x| ("a.las", las([0.001; 3], [0.0, x, 0.0], some), &[] as &[&str], 3, &["offset of y", "byte 163"] as &[&str]);
    let steps = [0.0, -0.001, 9e-16, 5e-324, 1e21, f64::NAN, f64::INFINITY].map(step);
    let places = [2e30, -2e30, f64::NAN, f64::NEG_INFINITY].map(place);
    refused(&steps.into_iter().chain(places).collect::<Vec<_>>());
}

#[test]
fn coordinates_that_are_none() {
    let text = |last: &str| format!("x,y,z\n0.5,0,0\n1,1,1.5\n{last}\n").into_bytes();
    let keep: &[&str] = &["--outliers", "keep"];
    refused(&[
        ("a.csv", text("1e31,0,0"), &[], 3, &["cannot be coordinates", "--bounds"]),
        ("a.csv", text("1e31,0,0"), keep, 3, &["cannot be coordinates"]),
        ("a.csv", text("0,-1e300,0"), keep, 3, &["cannot be coordinates"]),
        ("a.csv", text("nan,0,0"), &["--invalid", "fail"], 3, &["point 2 has no finite position", "--invalid skip"]),
        ("a.csv", text("0,1e400,0"), &["--invalid", "fail"], 3, &["point 2 has no finite position"]),
        ("a.csv", b"x,y,z\nnan,0,0\nnan,1,1\n".to_vec(), &[], 3, &["no points left", "2 without a valid position"]),
    ]);
}

#[test]
fn lattices_that_do_not_fit() {
    let flat = || las([1e-7, 1e3, 1e-7], [0.0; 3], &[[0; 3], [1001, 0, 1003], [999, 0, 1]]);
    let degrees = || las([1e-8, 1e-8, 0.01], [10.0, 48.0, 0.0], &[[0; 3], [100_000_001, 5, 100_001], [999, 0, 1]]);
    let kilometres = || las([0.001; 3], [0.0; 3], &[[0; 3], [2_000_000_001, 5, 100_003]]);
    let mut far: String = (0..2000).map(|i| format!("{}.{:03},{},1.125\n", i % 997, i % 1000, i % 991)).collect();
    far.insert_str(0, "x,y,z\n");
    far += "1e18,0,0\n";
    refused(&[
        ("a.las", flat(), &[], 4, &["too far apart for one lattice of 31 bits"]),
        ("a.las", degrees(), &["--to", "potree1"], 4, &["potree1", "one step for all axes", "--scale"]),
        ("a.las", kilometres(), &["--to", "batches", "--lod-cell", "1e-6"], 2, &["--lod-cell", "too small", "0.0037"]),
        ("a.las", kilometres(), &["--scale", "9e-16"], 2, &["no coordinate has such a step"]),
        ("a.las", kilometres(), &["--scale", "5e20"], 2, &["no coordinate has such a step"]),
        ("a.las", kilometres(), &["--transform", "1 0 0 1e31 0 1 0 0 0 0 1 0 0 0 0 1"], 2, &["--transform", "1e31"]),
        ("a.las", kilometres(), &["--transform", "1 2 3 0 2 4 6 0 0 0 1 0 0 0 0 1"], 2, &["singular"]),
        ("a.csv", far.into_bytes(), &[], 3, &["1 point lies so far", "--outliers drop", "--outliers keep"]),
    ]);
}
