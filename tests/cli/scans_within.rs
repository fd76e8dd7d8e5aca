//! Scans within a file: chosen with `--scan`, listed by `info`; colours and values as their scans declare them.

use pointmill_testkit::files::fixture_bytes;
use serde_json::Value;

use crate::support::Dir;

fn with(files: &[(&str, &str)]) -> Dir {
    let dir = Dir::new();
    files.iter().for_each(|(name, fixture)| drop(dir.write(name, &fixture_bytes(fixture))));
    dir
}

fn info(dir: &Dir, args: &[&str]) -> Value {
    let args = [&["info", "--json"], args].concat();
    serde_json::from_str(&dir.succeed(args).stdout()).unwrap()
}

#[test]
fn a_conversion_of_chosen_scans_has_their_points_and_validates() {
    let dir = with(&[("a.e57", "e57/images.e57"), ("b.e57", "e57/scans.e57"), ("c.ptx", "rows/two_scans.ptx")]);
    for (choice, points) in
        [(&["--scan", "Yard"][..], 6), (&["--scan", "1"], 4), (&["--scan", "1", "--scan", "Yard"], 10)]
    {
        let args = [&["convert", "a.e57", "-o", "out", "--overwrite"], choice].concat();
        dir.succeed(args);
        assert_eq!(dir.report("out")["points"]["kept"], points, "{choice:?}");
        let args = [&["validate", "out", "-q", "--against", "a.e57"], choice].concat();
        assert_eq!(dir.run(args).code(), 0, "{choice:?}");
    }
    assert_eq!(dir.run(["validate", "out", "-q", "--against", "a.e57", "--scan", "2"]).code(), 7, "another choice");
    let all = info(&dir, &["c.ptx"])[0].clone();
    let second = info(&dir, &["c.ptx", "--scan", "2", "--deep"])[0].clone();
    assert_eq!(second["measured"]["points"], all["scans"][1]["points"]);
    assert_eq!(second["measured"]["ranges"]["point source id"]["min"][0], 1.0);
    assert_eq!((&second["scans"][0]["number"], second["scans"].as_array().unwrap().len()), (&2.into(), 1));
}

#[test]
fn a_scan_that_no_input_has_is_a_usage_error_with_those_there_are() {
    let dir = with(&[("a.e57", "e57/images.e57"), ("b.e57", "e57/no_z.e57"), ("c.las", "las/format0.las")]);
    for command in [&["convert", "a.e57", "b.e57", "-o", "out"][..], &["info", "a.e57", "b.e57"]] {
        let args = [command, &["--scan", "Barn"]].concat();
        dir.run(args).failed_with(2, &["--scan Barn", "there are 1 (Hall), 2 (Yard), 1"]);
    }
    dir.run(["convert", "c.las", "-o", "out", "--scan", "1"]).failed_with(2, &["no input has scans within it"]);
    // one file has it, the other none of its scans
    let ended = dir.succeed(["convert", "a.e57", "b.e57", "-o", "out", "--scan", "Yard"]);
    assert!(ended.stderr().contains("b.e57: its scan was not chosen; nothing of it is read"), "{}", ended.stderr());
    assert_eq!(dir.report("out")["points"]["kept"], 6);
}

#[test]
fn info_lists_scans_and_images() {
    let dir = with(&[("a.e57", "e57/images.e57")]);
    let text = dir.succeed(["info", "a.e57"]).stdout();
    for line in [
        "scans         1: Hall, 4 points, at 10 20 30, turned by 73.7398° about 0 0.6 0.8, in ",
        "2: Yard, 6 points, at 0 0 0\n",
        "images        1: Hall pano, spherical, JPEG, 8 × 4 pixels, 16 B, of scan 1, at 1.5 2.5 3.5, turned by ",
        "2: ../../out, pinhole, PNG, 6 × 4 pixels, ",
        "with a mask, of scan 2, at 100 200 0\n",
        "3: cylindrical, JPEG, 10 × 3 pixels, 16 B\n",
    ] {
        assert!(text.contains(line), "{line:?} is not in\n{text}");
    }
    let json = info(&dir, &["a.e57"])[0].clone();
    assert_eq!(json["scans"][1]["number"], 2);
    assert_eq!(json["images"].as_array().unwrap().len(), 5);
    assert_eq!(json["images"][2]["kind"], "pinhole");
    assert_eq!(json["images"][2]["focal_length"], 0.025);
    assert_eq!(json["images"][3]["translation"], Value::Null);
}

#[test]
fn dark_colours_of_16_bits_stay_dark() {
    let dir = with(&[("dark.e57", "e57/dark.e57")]);
    for to in ["potree2", "bintree", "batches"] {
        dir.succeed(["convert", "dark.e57", "-o", to, "--to", to]);
        dir.validate(to, &["dark.e57"]);
        let report = dir.report(to);
        // scaled integers on an offset of their own stay where they are, but for the rounding of doubles
        let moved = report["outputs"][0]["accuracy"]["lattice"]["max"].as_array().unwrap();
        assert!(moved.iter().all(|m| m.as_f64().unwrap() < 2e-9), "{moved:?}");
    }
    assert_eq!(dir.report("potree2")["inputs"][0]["rgb_depth"], 16);
    let info: Value = serde_json::from_str(&dir.succeed(["info", "--json", "potree2"]).stdout()).unwrap();
    let rgb = info[0]["attributes"].as_array().unwrap().iter().find(|a| a["name"] == "rgb").unwrap().clone();
    assert_eq!(rgb["max"], serde_json::json!([255.0, 255.0, 255.0]), "{info:#}");
}

#[test]
fn values_outside_of_their_limits_are_counted_in_the_report() {
    let dir = with(&[("outside.e57", "e57/outside.e57")]);
    let ended = dir.succeed(["convert", "outside.e57", "-o", "out"]);
    let told = ended.stderr();
    let line = "intensity: 2 values are outside the range and take its nearest end, 2 are not finite and become 0 \
                (-0.25 to 3)";
    assert!(told.contains(line), "{told}");
    assert!(told.contains("rgb: 3 values are outside the range and take its nearest end (300)"), "{told}");
}

#[test]
fn a_last_byte_that_is_missing_costs_no_point() {
    let dir = Dir::new();
    let bytes = fixture_bytes("e57/images.e57");
    dir.write("short.e57", &bytes[..bytes.len() - 1]);
    let ended = dir.succeed(["convert", "short.e57", "-o", "out"]);
    assert!(ended.stderr().contains("the last page of the file lacks 1 of its 1024 bytes"), "{}", ended.stderr());
    assert_eq!(dir.report("out")["points"]["kept"], 10);
    dir.validate("out", &["short.e57"]);
}
