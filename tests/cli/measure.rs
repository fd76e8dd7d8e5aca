//! Speed against accuracy on the user's own scene.

use std::fs;

use pointmill_testkit::files::fixture;
use pointmill_testkit::las::{Las, Point};
use serde_json::Value;

use crate::support::Dir;

const SMALL: [&str; 4] = ["--size", "96x72", "--threads", "2"];

fn measured(dir: &Dir, input: &str, options: &[&str]) -> Value {
    let command = ["measure", input, "-o", "out", "-q"];
    dir.succeed(command.iter().chain(&SMALL).chain(options));
    serde_json::from_slice(&fs::read(dir.path("out/measure.json")).unwrap()).unwrap()
}

#[test]
fn every_setting_has_a_row_with_its_figures_and_each_profile_converts() {
    let dir = Dir::new();
    let scan = fixture("las/autzen_trim.laz");
    let axes = "output=potree2+bintree+batches,encoding,planes=auto+10";
    let result = measured(&dir, scan.to_str().unwrap(), &["--axes", axes]);
    assert_eq!(result["is_complete"], true);
    let rows = result["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 2 + 1 + 4);
    let row = |name: &str| rows.iter().find(|row| row["name"] == name).unwrap_or_else(|| panic!("{name}"));
    for row in rows {
        assert!(row["failed"].is_null(), "{row}");
        assert!(
            row["cost"]["bytes_per_point"].as_f64().unwrap() > 1.0
                && row["cost"]["cpu_seconds"].as_f64().unwrap() > 0.0
        );
        assert_eq!(row["views"].as_array().unwrap().len(), 4);
    }
    // an octree keeps the integers of the scan: what is left is the rounding of doubles
    let largest = |name: &str| {
        let axes = row(name)["position"].as_array().unwrap();
        axes.iter().map(|axis| axis["max"].as_f64().unwrap()).fold(0.0, f64::max)
    };
    assert!(largest("potree2") < 1e-8, "{}", largest("potree2"));
    // ten bits in boxes of some hundred metres are decimetres, and no more than half a step of the largest box
    assert!(largest("batches, 10 bits") > 0.01 && largest("batches, 10 bits") < 1.0);
    let bytes = |name: &str| row(name)["cost"]["output_bytes"].as_u64().unwrap();
    assert!(bytes("potree2, compressed") < bytes("potree2") / 2);
    assert_eq!(row("potree2, compressed")["same_points_as"], "potree2");
    // the cloud itself has no holes in the picture of all its points
    assert!(row("bintree")["views"][0]["error"]["holes"].as_f64().unwrap() < 0.05);
    // without colours of their own, trees are held against the cloud by depth
    for (name, is_by_depth) in [("potree2", false), ("bintree", true), ("batches, 10 bits", false)] {
        assert_eq!(row(name)["is_shaded_by_depth"], is_by_depth, "{name}");
    }
    let by_depth = row("bintree")["views"].as_array().unwrap();
    // null is no difference
    assert!(by_depth.iter().all(|v| v["error"]["psnr"].as_f64().is_none_or(|psnr| psnr > 15.0)), "{by_depth:?}");
    let deltas = row("potree2")["levels"].as_array().unwrap();
    assert_eq!(deltas.last().unwrap()["delta_e"], 0.0, "all points of all levels are the cloud");
    assert!(deltas[0]["delta_e"].as_f64().unwrap() > 0.0);

    let table = fs::read_to_string(dir.path("out/measure.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + rows.len());
    let page = fs::read_to_string(dir.path("out/report.html")).unwrap();
    assert!(page.contains("<svg") && page.matches("data:image/jpeg").count() == 4 * (1 + 4));
    assert!(page.contains("bintree (by depth): ") && page.contains("geometry alone"));
    assert_eq!(fs::read_dir(dir.path("out")).unwrap().count(), 3, "temporary files are removed");
    for (name, output) in [("fast", "potree2"), ("balanced", "batches"), ("exact", "bintree")] {
        let scan = scan.to_str().unwrap();
        let ended = dir.succeed(["convert", scan, "-o", name, "--to", output, "--profile", name, "--measured", "out"]);
        assert!(ended.stderr().contains(&format!("profile {name}: ")), "{}", ended.stderr());
        dir.validate(name, &[scan]);
    }
}

#[test]
fn of_a_large_scene_whole_columns_are_measured() {
    let dir = Dir::new();
    let points = (0..40_000).map(|i| Point::numbered(i, [i as i32 % 200, i as i32 / 200, i as i32 % 7]));
    dir.write("in.las", &Las::new(points.collect()).bytes());
    let result = measured(&dir, "in.las", &["--axes", "output", "--sample", "10k"]);
    let scene = &result["scene"];
    assert_eq!(scene["points_declared"], 40_000);
    let points = scene["points"].as_u64().unwrap();
    assert!((8_000..=12_000).contains(&points), "{scene}");
    assert!(scene["chunks"][0].as_u64().unwrap() < scene["chunks"][1].as_u64().unwrap());
    assert_eq!(result["rows"].as_array().unwrap().len(), 4);
}

#[test]
fn a_point_far_away_makes_the_sample_no_larger() {
    let dir = Dir::new();
    let points = (0..40_000).map(|i| Point::numbered(i, [i as i32 % 200, i as i32 / 200, i as i32 % 7]));
    let points = points.chain([Point::numbered(40_000, [2_000_000_000, -2_000_000_000, 0])]);
    dir.write("in.las", &Las::new(points.collect()).bytes());
    let result = measured(&dir, "in.las", &["--axes", "output=bintree", "--sample", "10k"]);
    let points = result["scene"]["points"].as_u64().unwrap();
    assert!((8_000..=12_000).contains(&points), "{}", result["scene"]);
}

#[test]
fn samples_of_scans_without_bounds_and_without_colours_are_measured() {
    let dir = Dir::new();
    let rows = (0..20_000).map(|i| format!("{} {} {}\n", i % 141, i / 141, f64::from(i % 9) * 0.5));
    dir.write("in.xyz", rows.collect::<String>().as_bytes());
    let result = measured(&dir, "in.xyz", &["--axes", "output=potree2+batches", "--sample", "5k"]);
    let points = result["scene"]["points"].as_u64().unwrap();
    assert!((4_000..=6_000).contains(&points), "{}", result["scene"]);
    for row in result["rows"].as_array().unwrap() {
        assert!(row["failed"].is_null() && row["levels"][0]["delta_e"].is_null(), "{row}");
        // drawn alike: shaded by depth, whatever colours a renderer would take
        assert!(row["views"][0]["error"]["psnr"].as_f64().is_none_or(|psnr| psnr > 15.0), "{row}");
        assert_eq!(row["levels"].as_array().unwrap().last().unwrap()["points"], points);
    }
}

#[test]
fn scenes_of_one_point_are_measured_and_of_none_are_not() {
    let dir = Dir::new();
    dir.write("one.las", &Las::new(vec![Point::numbered(0, [5, 6, 7])]).bytes());
    let result = measured(&dir, "one.las", &["--axes", "output"]);
    assert!(result["rows"].as_array().unwrap().iter().all(|row| row["failed"].is_null()), "{result}");
    dir.write("none.las", &Las::new(Vec::new()).bytes());
    dir.run(["measure", "none.las", "-o", "none/deep"]).failed_with(3, &["no point"]);
    assert!(!dir.path("none").exists(), "nothing was measured");
}

#[test]
fn a_setting_that_fails_is_a_row_that_says_why() {
    let dir = Dir::new();
    dir.write("in.las", &Las::new(vec![Point::numbered(0, [5, 6, 7]), Point::numbered(1, [9, 9, 9])]).bytes());
    let result = measured(&dir, "in.las", &["--axes", "output=potree2,attributes=all+rainbow"]);
    let rows = result["rows"].as_array().unwrap();
    assert!(rows[0]["failed"].is_null() && rows[1]["failed"].as_str().unwrap().contains("rainbow"), "{result}");
    assert!(fs::read_to_string(dir.path("out/report.html")).unwrap().contains("rainbow"));
}

#[test]
fn mistakes_are_one_line_before_anything_is_measured() {
    let dir = Dir::new();
    dir.write("in.las", &Las::new(vec![Point::numbered(0, [5, 6, 7])]).bytes());
    for (options, code, words) in [
        (&["--axes", "colour"][..], 2, &["no axis is called 'colour'"][..]),
        (&["--size", "0x5"], 2, &["--size"]),
        (&["--size", "1000000x5"], 2, &["--size"]),
        (&["--sample", "none"], 2, &["--sample", "number of points"]),
        (&["--budget", "0"], 2, &["--budget"]),
        (&["--temp-dir", "nowhere"], 5, &["nowhere"]),
    ] {
        dir.run(["measure", "in.las", "-o", "out"].iter().chain(options)).failed_with(code, words);
    }
    dir.run(["measure", "in.las", "-o", "in.las"]).failed_with(2, &["in.las"]);
    dir.write("taken/measure.json", b"{}");
    dir.run(["measure", "in.las", "-o", "taken"]).failed_with(2, &["measure.json", "--overwrite"]);
    dir.run(["measure", "in.las", "-o", "taken", "--overwrite"]).failed_with(2, &["of no measurement"]);
    assert_eq!(fs::read(dir.path("taken/measure.json")).unwrap(), b"{}");
    dir.run(["measure", "in.las", "-o", "failed", "--axes", "attributes=rainbow"]).failed_with(2, &["rainbow"]);
    dir.run(["convert", "in.las", "-o", "x", "--measured", "out"]).failed_with(2, &["--measured requires --profile"]);
    assert!(!dir.path("out").exists(), "a mistake makes no folder");
}

#[cfg(unix)]
#[test]
fn an_interrupted_measurement_keeps_what_it_has() {
    use std::time::{Duration, Instant};
    let dir = Dir::new();
    let points = (0..60_000).map(|i| Point::numbered(i, [i as i32 % 300, i as i32 / 300, i as i32 % 11]));
    dir.write("in.las", &Las::new(points.collect()).bytes());
    let mut command = dir.command(["measure", "in.las", "-o", "out"].iter().chain(&SMALL));
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
    let begun = Instant::now();
    while !dir.path("out/measure.json").exists() {
        assert!(begun.elapsed() < Duration::from_secs(120) && child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(20));
    }
    crate::signals::send(&child, nix::sys::signal::Signal::SIGINT);
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("were measured until then"), "{said}");
    let result: Value = serde_json::from_slice(&fs::read(dir.path("out/measure.json")).unwrap()).unwrap();
    assert_eq!(result["is_complete"], false);
    assert!(!result["rows"].as_array().unwrap().is_empty());
    assert!(fs::read_to_string(dir.path("out/report.html")).unwrap().contains("interrupted"));
    assert_eq!(fs::read_dir(dir.path("out")).unwrap().count(), 3, "temporary files are removed");
}

#[cfg(unix)]
#[test]
fn what_a_killed_measurement_leaves_the_next_one_removes() {
    let dir = Dir::new();
    let points = (0..60_000).map(|i| Point::numbered(i, [i as i32 % 300, i as i32 / 300, i as i32 % 11]));
    dir.write("in.las", &Las::new(points.collect()).bytes());
    let measure = ["measure", "in.las", "-o", "out", "--axes", "output=bintree", "--overwrite"];
    let mut child = dir.command(measure.iter().chain(&SMALL)).stderr(std::process::Stdio::null()).spawn().unwrap();
    let names =
        || fs::read_dir(dir.path("out")).into_iter().flatten().flatten().map(|e| e.file_name()).collect::<Vec<_>>();
    let has_begun = || names().iter().any(|name| name.to_string_lossy().starts_with(".measure-"));
    while !has_begun() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was killed");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(has_begun(), "{:?}", names());
    dir.succeed(measure.iter().chain(&SMALL));
    assert_eq!(names().len(), 3, "{:?}", names());
}
