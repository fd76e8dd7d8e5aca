//! What is written as Potree 1.x keeps every promise of its page, and holds every point of the scans.

use std::path::Path;

use pointmill_testkit::files::fixture;
use serde_json::{Value, json};

use crate::support::Dir;

/// Converts a scan, proves the points, and gives what the dataset says of itself.
fn proven(scan: &Path, options: &[&str]) -> Value {
    let dir = Dir::new();
    let scan = scan.to_str().unwrap();
    let convert = ["convert", scan, "-o", "out", "--to", "potree1", "-q", "--leaf-capacity", "60"];
    dir.succeed(convert.iter().chain(options));
    let ended = dir.run(["validate", "out", "--json", "--against", scan]);
    let outcome: Value = serde_json::from_str(&ended.stdout()).unwrap();
    assert_eq!(ended.code(), 0, "{scan} {options:?}: {:#}", outcome["problems"]);
    let skipped =
        |name: &str| outcome["checks"].as_array().unwrap().iter().any(|c| c["name"] == name && !c["skipped"].is_null());
    for check in ["against", "report", "accuracy", "spacing", "seams", "coverage"] {
        assert!(!skipped(check), "{scan}: {check} was skipped");
    }
    let cloud = std::fs::read(dir.path("out/cloud.js")).unwrap();
    serde_json::from_slice::<Value>(&cloud).unwrap()["pointmill"].clone()
}

#[test]
fn points_with_colours_greys_and_neither_are_all_there() {
    assert_eq!(proven(&fixture("las/format3.las"), &[])["colours"], Value::Null);
    assert!(proven(&fixture("las/format1.las"), &[])["colours"]["intensity"].is_array());
    assert_eq!(proven(&fixture("rows/xyz.xyz"), &[])["colours"], json!("white"));
}

#[test]
fn attributes_of_both_versions_are_those_of_the_scan() {
    let some = ["--attributes", "intensity,classification"];
    proven(&fixture("las/format7.laz"), &some);
    let more = ["--potree1-version", "1.8", "--attributes", "all"];
    for scan in ["las/format3.las", "las/format7.laz", "las/extra_bytes_format7.las"] {
        proven(&fixture(scan), &more);
    }
}
