//! Coordinates keep the precision of their scans, and where they cannot, the user is asked.

use pointmill_testkit::las::{Las, Point};
use serde_json::{Value, json};

use crate::support::Dir;

fn report(dir: &Dir, out: &str, args: &[&str]) -> Value {
    let all: Vec<&str> = ["convert", "-o", out, "-q"].into_iter().chain(args.iter().copied()).collect();
    dir.succeed(all);
    dir.report(out)
}

/// A scene of a kilometre in millimetres, as text.
fn scene() -> String {
    (0..2000).map(|i| format!("{}.{:03} {}.5 {}.125\n", i % 997, i % 1000, i * 7 % 991, i % 13)).collect()
}

#[test]
fn an_outlier_that_costs_precision_ends_the_run_unless_something_is_said_of_it() {
    let dir = Dir::new();
    dir.write("far.xyz", (scene() + "1e18 0 0\n").as_bytes());
    let words = ["1 point lies so far", "the step of x", "not 0.001", "--outliers drop", "--outliers keep"];
    dir.run(["convert", "far.xyz", "-o", "out", "-q"]).failed_with(3, &words);
    assert_eq!(dir.names(), ["far.xyz"], "nothing is left behind");

    let dropped = report(&dir, "dropped", &["far.xyz", "--outliers", "drop"]);
    assert_eq!(dropped["points"]["outliers"], 1);
    assert_eq!(dropped["points"]["kept"], 2000);
    assert_eq!(dropped["grid"]["scale"], json!([0.001, 0.001, 0.001]));
    dir.validate("dropped", &["far.xyz"]);

    let kept = report(&dir, "kept", &["far.xyz", "--outliers", "keep"]);
    assert_eq!(kept["points"]["kept"], 2001);
    assert!(kept["grid"]["scale"][0].as_f64().unwrap() > 1e8);
    dir.validate("kept", &["far.xyz"]);
}

#[test]
fn the_bounds_that_are_named_give_the_precision_back() {
    let dir = Dir::new();
    let mut text = scene();
    for power in 4..=15 {
        text += &format!("1e{power} 0 0\n-1e{power} 5 5\n");
    }
    dir.write("far.xyz", text.as_bytes());
    let ended = dir.run(["convert", "far.xyz", "-o", "out", "-q"]);
    ended.failed_with(3, &["--bounds"]);
    let stderr = ended.stderr();
    let bounds = stderr.split("--bounds ").nth(1).unwrap().split(' ').next().unwrap();
    let cut = report(&dir, "out", &["far.xyz", &format!("--bounds={bounds}")]);
    assert_eq!(cut["grid"]["scale"], json!([0.001, 0.001, 0.001]), "{bounds}");
    assert!(cut["points"]["kept"].as_u64().unwrap() >= 2000);
    dir.validate("out", &["far.xyz"]);
}

#[test]
fn coordinates_that_are_none_can_be_dropped_as_outliers() {
    let dir = Dir::new();
    dir.write("far.xyz", (scene() + "1 2 1e300\n").as_bytes());
    dir.run(["convert", "far.xyz", "-o", "out", "-q"]).failed_with(3, &["--bounds", "--outliers drop"]);
    assert_eq!(report(&dir, "out", &["far.xyz", "--outliers", "drop"])["points"]["outliers"], 1);
    dir.run(["convert", "far.xyz", "-o", "kept", "-q", "--outliers", "keep"])
        .failed_with(3, &["cannot be coordinates"]);
}

#[test]
fn scans_whose_offset_is_wrong_are_outliers_where_they_are_the_smaller_part() {
    let dir = Dir::new();
    dir.write("scans/a.las", &Las::terrain(3000, 1).bytes());
    let mut lost = Las::terrain(30, 2);
    lost.offset[0] += 5e7;
    dir.write("scans/b.las", &lost.bytes());
    dir.run(["convert", "scans", "-o", "out", "-q"]).failed_with(3, &["30 or more points", "--outliers drop"]);
    let dropped = report(&dir, "out", &["scans", "--outliers", "drop"]);
    assert_eq!(dropped["points"]["outliers"], 30);
    dir.validate("out", &["scans"]);
    // halves are no outliers: a coarser step, said
    let mut half = Las::terrain(3000, 2);
    half.offset[0] += 5e7;
    dir.write("halves/a.las", &Las::terrain(3000, 1).bytes());
    dir.write("halves/b.las", &half.bytes());
    let halves = dir.succeed(["convert", "halves", "-o", "halves.out"]).stderr();
    assert!(halves.contains("31 bits do not hold the extent"), "{halves}");
    dir.validate("halves.out", &["halves"]);
}

#[test]
fn outliers_that_cost_levels_alone_are_dropped_on_request_only() {
    let dir = Dir::new();
    dir.write("far.xyz", (scene() + "500000 0 0\n").as_bytes());
    let kept = report(&dir, "kept", &["far.xyz"]);
    assert_eq!((&kept["points"]["outliers"], &kept["points"]["kept"]), (&json!(0), &json!(2001)));
    assert_eq!(kept["grid"]["scale"], json!([0.001, 0.001, 0.001]));
    let dropped = report(&dir, "dropped", &["far.xyz", "--outliers", "drop"]);
    assert_eq!((&dropped["points"]["outliers"], &dropped["points"]["kept"]), (&json!(1), &json!(2000)));
    dir.validate("dropped", &["far.xyz"]);
}

#[test]
fn decimals_that_the_sample_does_not_show_are_kept() {
    let dir = Dir::new();
    // three places of the file are looked at; the odd row is in none of them
    let mut text: String = (0..800_000).map(|i| format!("{}.25 {} {}\n", i % 500, i % 333, i % 7)).collect();
    let middle = text.len() / 4;
    let row = text[..middle].rfind('\n').unwrap() + 1;
    text.insert_str(row, "1.2345678 2.5 3\n");
    dir.write("odd.xyz", text.as_bytes());
    let ended = dir.succeed(["convert", "odd.xyz", "-o", "out", "--to", "batches", "--no-originals"]).stderr();
    assert!(ended.contains("finer than bounds or a sample showed"), "{ended}");
    let scale = dir.report("out")["grid"]["scale"][0].as_f64().unwrap();
    assert!(scale <= 1e-6, "{scale}");
}

#[test]
fn integers_that_share_a_divisor_take_no_finer_step_and_odd_ones_do() {
    let dir = Dir::new();
    let mut las = Las::terrain(3000, 1);
    las.points.iter_mut().for_each(|p| p.xyz = p.xyz.map(|v| v * 100));
    las.scale = las.scale.map(|s| s / 100.0);
    dir.write("fine.las", &las.bytes());
    let step = las.scale[0] * 100.0;
    let coarse = report(&dir, "out", &["fine.las"]);
    assert_eq!(coarse["grid"]["scale"][0].as_f64().unwrap(), step);
    dir.validate("out", &["fine.las"]);
    las.points.push(Point::at([1, 1, 1]));
    dir.write("odd.las", &las.bytes());
    let odd = report(&dir, "odd", &["odd.las"]);
    assert_eq!(odd["grid"]["scale"][0].as_f64().unwrap(), las.scale[0]);
    dir.validate("odd", &["odd.las"]);
}

#[test]
fn points_that_fall_together_are_counted_where_the_step_is_coarser_than_the_scan() {
    let dir = Dir::new();
    // 0, 1, 2, … mm; steps of 5 mm take 0–2, 3–7, …; one place is there twice
    let mut las = Las::terrain(1, 1);
    (las.scale, las.offset) = ([0.001; 3], [0.0; 3]);
    las.points = [0, 1, 2, 10, 10, 15, 16].map(|x| Point::at([x, 0, 0])).to_vec();
    dir.write("a.las", &las.bytes());
    dir.write("a.xyz", b"0 0 0\n0.001 0 0\n0.002 0 0\n0.01 0 0\n0.01 0 0\n0.015 0 0\n0.016 0 0\n");
    for input in ["a.las", "a.xyz"] {
        for to in ["potree2", "bintree", "batches"] {
            let report = report(&dir, "out", &[input, "--scale", "0.005", "--to", to, "--overwrite"]);
            assert_eq!(report["outputs"][0]["accuracy"]["merged"]["lattice"], 5, "{input} {to}: 0–2 and 15–16");
            dir.validate("out", &[input]);
        }
        let own = report(&dir, "own", &[input, "--overwrite"]);
        assert_eq!(own["outputs"][0]["accuracy"]["merged"]["lattice"], 0);
    }
    // held back by the extent
    dir.write("wide.xyz", b"0.001 0 0\n0.002 0 0\n0.003 0 0\n5000000.001 0 0\n5000000.002 0 0\n5000000.003 0 0\n");
    let wide = report(&dir, "wide", &["wide.xyz"]);
    assert_eq!(wide["grid"]["scale"][0], 0.005);
    assert!(wide["outputs"][0]["accuracy"]["merged"]["lattice"].as_u64().unwrap() >= 4, "{wide}");
    dir.validate("wide", &["wide.xyz"]);
    // a report that hides it
    let path = dir.path("wide/report.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let mut lie: Value = serde_json::from_str(&text).unwrap();
    lie["outputs"][0]["accuracy"]["merged"]["lattice"] = json!(0);
    std::fs::write(&path, lie.to_string()).unwrap();
    assert_eq!(dir.run(["validate", "wide", "-q", "--against", "wide.xyz"]).code(), 7);
}

#[test]
fn ties_of_a_doubled_step_have_no_bias() {
    let dir = Dir::new();
    let mut las = Las::terrain(1000, 1);
    las.scale = [0.001; 3];
    las.points = (0..1000).map(|i| Point::at([i, i * 3, i])).collect();
    dir.write("a.las", &las.bytes());
    for (scale, out) in [("0.002", "two"), ("0.005", "five")] {
        report(&dir, out, &["a.las", "--scale", scale]);
        dir.validate(out, &["a.las"]);
    }
}
