//! Normals in two bytes that a conversion has computed.

use std::fs;

use pointmill_validate::{Check, Options, Outcome, validate};
use serde_json::json;

use crate::dataset::encode;
use crate::support::surfels::{Surfel, assert_faults, report, settings, turned};
use crate::support::{Cloud, FLAT, Sampler, las, surfel_scene};

/// Validates with that report against the scan.
fn checked(change: impl Fn(Surfel) -> Surfel, zero_normals: u64) -> Outcome {
    let mut cloud = Cloud::of(surfel_scene(), Sampler::Poisson);
    cloud.nodes.values_mut().flatten().for_each(|p| p.surfel = p.surfel.map(&change));
    let folder = tempfile::tempdir().unwrap();
    encode(&cloud).write(folder.path());
    let left_out = ["curvature", "radius"].map(|name| json!({ "name": name, "why": "no place" }));
    let text = report("potree1", &settings(), [zero_normals, FLAT], &json!(left_out));
    fs::write(folder.path().join("report.json"), text).unwrap();
    let scan = folder.path().join("scan.las");
    fs::write(&scan, las(&surfel_scene())).unwrap();
    let options = Options { threads: 2, against: vec![scan], ..Options::default() };
    validate(folder.path(), &options, &|_| {}).unwrap()
}

#[test]
fn normals_of_two_bytes_are_as_right_as_they_can_be() {
    let outcome = checked(|s| s, FLAT);
    assert_faults(&outcome, &[]);
    let skipped = |check: Check| outcome.check(check).unwrap().skipped.clone();
    assert_eq!((skipped(Check::Normals), skipped(Check::Surfels)), (None, None));
    assert!(skipped(Check::Curvature).is_some() && skipped(Check::Radii).is_some());
    let summary = outcome.surfels.unwrap();
    assert!(summary.normals > 700 && (0.1..1.6).contains(&summary.largest_angle.unwrap()), "{summary:?}");
    assert_eq!((summary.largest_curvature, summary.largest_radius), (None, None));
    // normals of 0 have no code: how many there are is not known
    assert_faults(&checked(|s| s, 0), &[]);
}

#[test]
fn normals_of_two_bytes_that_are_far_off_or_down_are_found() {
    let outcome = checked(|s| turned(s, 3.0), FLAT);
    assert!(!outcome.check(Check::Surfels).unwrap().ok);
    assert!(outcome.surfels.unwrap().largest_angle.unwrap() > 2.5, "{:?}", outcome.surfels);
    let down = checked(|[x, y, z, c, r]| [-x, -y, -z, c, r], FLAT);
    assert!(!down.check(Check::Normals).unwrap().ok && down.check(Check::Surfels).unwrap().ok);
}
