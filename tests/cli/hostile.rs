//! Scans and options that invite a wrong dataset: headers that lie, colours that mislead, points that repeat.

use pointmill_testkit::las::Las;

use crate::support::Dir;

#[test]
fn a_header_that_declares_a_thousand_light_seconds_costs_no_precision() {
    let dir = Dir::new();
    dir.write("scans/centimetres.las", &Las::terrain(3000, 1).bytes());
    let mut fine = Las::terrain(3000, 2);
    fine.scale = [0.001; 3];
    let [min, mut max] = fine.bounds();
    max[0] = 3e11;
    fine.bounds_declared = Some([min, max]);
    dir.write("scans/millimetres.las", &fine.bytes());
    dir.succeed(["convert", "scans", "-o", "out", "-q"]);
    assert_eq!(dir.report("out")["grid"]["scale"][0], 0.001);
    assert_eq!(dir.report("out")["outputs"][0]["accuracy"]["lattice"]["max"][0], 0.0);
    dir.validate("out", &["scans"]);
}

#[test]
fn the_depth_of_colours_is_detected_from_filtered_points_too() {
    let dir = Dir::new();
    let mut scan = Las::terrain(3000, 1);
    for (i, point) in scan.points.iter_mut().enumerate() {
        // dark water in a picture of 16 bits
        (point.class, point.rgb) = if i % 2 == 0 { (9, [200; 3]) } else { (2, [60_000; 3]) };
    }
    dir.write("scan.las", &scan.bytes());
    dir.succeed(["convert", "scan.las", "-o", "out", "-q", "--class", "9"]);
    assert_eq!(dir.report("out")["inputs"][0]["rgb_depth"], 16);
    dir.validate("out", &["scan.las"]);
}

#[test]
fn dropped_duplicates_are_not_counted_in_the_histogram_of_classes() {
    let dir = Dir::new();
    let bytes = Las::terrain(3000, 1).bytes();
    dir.write("scans/a.las", &bytes);
    dir.write("scans/b.las", &bytes);
    dir.succeed(["convert", "scans", "-o", "out", "-q", "--duplicates", "drop"]);
    assert_eq!(dir.report("out")["outputs"][0]["duplicates_dropped"], 3000);
    dir.validate("out", &[]); // it counts the classes
}

#[test]
fn degrees_with_heights_in_metres_are_in_order() {
    let dir = Dir::new();
    let mut scan = Las::terrain(3000, 1);
    (scan.scale, scan.offset) = ([1e-7, 1e-7, 0.01], [11.5, 48.1, 300.0]);
    scan.points[0].xyz[2] = 40_000; // a mountain: 400 units of z are more than 2^31 steps of x
    dir.write("scan.las", &scan.bytes());
    dir.succeed(["convert", "scan.las", "-o", "out", "-q"]);
    dir.validate("out", &["scan.las"]);
}

#[test]
fn infinite_times_do_not_enter_the_range_of_times() {
    let dir = Dir::new();
    let mut scan = Las::terrain(3000, 1);
    for (i, time) in [f64::INFINITY, f64::NAN, f64::NEG_INFINITY].into_iter().enumerate() {
        scan.points[7 * i].gps_time = time;
    }
    dir.write("scan.las", &scan.bytes());
    dir.succeed(["convert", "scan.las", "-o", "out", "-q"]);
    dir.validate("out", &["scan.las"]);
}

#[test]
fn an_unknown_attribute_is_reported_before_a_point_is_read() {
    let dir = Dir::new();
    dir.write("scan.las", &Las::terrain(3000, 1).bytes());
    let ended = dir.run(["convert", "scan.las", "-o", "out", "--attributes", "colour", "--progress", "json"]);
    assert_eq!(ended.code(), 2);
    assert!(!ended.stderr().contains("\"read\""), "{}", ended.stderr());
}

#[test]
fn a_report_never_replaces_a_scan() {
    let dir = Dir::new();
    let bytes = Las::terrain(3000, 1).bytes();
    let scan = dir.write("scan.las", &bytes);
    dir.run(["convert", "scan.las", "-o", "out", "-q", "--report", "scan.las"]).failed_with(2, &["scan.las", "report"]);
    assert!(std::fs::read(scan).unwrap() == bytes, "the scan was changed");
}

#[test]
fn an_empty_folder_may_be_filled_from_inside() {
    let dir = Dir::new();
    dir.write("scan.las", &Las::terrain(3000, 1).bytes());
    std::fs::create_dir(dir.path("out")).unwrap();
    let status = dir.command(["convert", "../scan.las", "-o", ".", "-q"]).current_dir(dir.path("out")).status();
    assert!(status.unwrap().success());
    dir.validate("out", &["scan.las"]);
}

#[cfg(unix)]
#[test]
fn a_pipe_in_a_folder_is_left_out() {
    let dir = Dir::new();
    dir.write("scans/scan.las", &Las::terrain(3000, 1).bytes());
    let made = std::process::Command::new("mkfifo").arg(dir.path("scans/pipe.las")).status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("skipped: no mkfifo here");
        return;
    }
    dir.succeed(["convert", "scans", "-o", "out", "-q"]);
}

#[test]
fn scans_that_no_lattice_can_hold_together_are_refused() {
    let dir = Dir::new();
    dir.write("scans/a.las", &Las::terrain(3000, 1).bytes());
    let far: String = (0..3000).map(|i| format!("1.{i:04}e300 {i} 2\n")).collect();
    dir.write("scans/b.xyz", far.as_bytes());
    dir.run(["convert", "scans", "-o", "out", "-q"]).failed_with(3, &["cannot be coordinates", "--bounds"]);
    let mut far = Las::terrain(3000, 1);
    far.offset[0] = 1e300;
    dir.write("scans/b.las", &far.bytes());
    dir.run(["convert", "scans", "-o", "out", "-q"]).failed_with(3, &["b.las", "offset of x", "byte 155"]);
    dir.succeed(["convert", "scans/a.las", "scans/b.las", "-o", "out", "-q", "--unreadable", "skip"]);
}
