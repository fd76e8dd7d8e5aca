//! `convert --append`: scans are added to a dataset.

use pointmill_testkit::files::{assert_same_dataset, dataset};
use pointmill_testkit::las::Las;

use crate::support::Dir;

/// Two scans side by side, and datasets of the first and of both.
fn stage(options: &[&str]) -> Dir {
    let dir = Dir::new();
    let mut other = Las::terrain(30_000, 2);
    other.points.iter_mut().for_each(|point| point.xyz[0] += 4000);
    dir.write("a.las", &Las::terrain(30_000, 1).bytes());
    dir.write("b.las", &other.bytes());
    dir.succeed([&["convert", "a.las", "-o", "city", "-q"][..], options].concat());
    dir.succeed([&["convert", "a.las", "b.las", "-o", "both", "-q", "--name", "city"][..], options].concat());
    dir
}

#[test]
fn a_dataset_that_was_added_to_has_the_bytes_of_all_scans() {
    let all = "intensity,classification,gps-time";
    for options in [&[][..], &["--to", "bintree", "--attributes", all], &["--to", "batches", "--attributes", all]] {
        let dir = stage(options);
        dir.succeed([&["convert", "b.las", "-o", "city", "-q", "--append"][..], options].concat());
        assert_same_dataset(&dataset(&dir.path("city")), &dataset(&dir.path("both")), &format!("{options:?}"));
        assert_eq!(dir.names(), ["a.las", "b.las", "both", "city"], "{options:?}");
    }
}

#[test]
fn the_summary_and_the_report_say_what_was_built_anew() {
    let dir = stage(&[]);
    let said = dir.succeed(["convert", "b.las", "-o", "city", "--append"]);
    let said = said.stderr();
    assert!(said.contains("all built anew: with the new points the root cube is another one"), "{said}");
    assert_eq!(dir.report("city")["outputs"][0]["taken_over"]["nodes"], 0);
}

#[test]
fn formats_with_other_fields_than_the_scans_hold_all_points_too() {
    // COPC has more fields, so that its description differs; Potree 1 has 8 bits of a colour, so that points of one place have another order
    for options in [&["--to", "copc"][..], &["--to", "potree1", "--potree1-version", "1.8"]] {
        let dir = stage(options);
        dir.succeed([&["convert", "b.las", "-o", "city", "-q", "--append"][..], options].concat());
        dir.validate("city", &["a.las", "b.las"]);
    }
}

#[test]
fn what_cannot_be_added_to_is_left_alone() {
    let dir = stage(&[]);
    let before = dataset(&dir.path("city"));
    let append = |more: &[&'static str]| dir.run([&["convert", "b.las", "--append", "-q"][..], more].concat());
    append(&["-o", "village"]).failed_with(2, &["village", "no dataset to add to"]);
    append(&["-o", "city", "--to", "bintree"]).failed_with(2, &["city", "potree2", "--to potree2"]);
    append(&["-o", "city", "--to", "potree2", "--to", "copc"]).failed_with(2, &["--append", "one dataset"]);
    append(&["-o", "city", "--overwrite"]).failed_with(2, &["--append", "--overwrite"]);
    append(&["-o", "city", "--every", "2"]).failed_with(2, &["--every", "points of city"]);
    append(&["-o", "city", "--axes", "y-up"]).failed_with(2, &["--axes", "points of city"]);
    append(&["-o", "city", "--encoding", "brotli"]).failed_with(2, &["city", "another", "same options"]);
    append(&["-o", "city", "city"]).failed_with(2, &["city", "already"]);
    dir.write("cut.las", &std::fs::read(dir.path("b.las")).unwrap()[..5000]);
    dir.run(["convert", "cut.las", "-o", "city", "--append", "-q"]).failed_with(3, &["cut.las"]);
    assert_eq!(dataset(&dir.path("city")), before);
}
