//! Against the scans, and against the report of the conversion.

use pointmill_validate::{Check, Options, validate};
use serde_json::{Value, json};

use crate::dataset::{Files, STRIDE, encode, good};
use crate::support::{Cloud, Point, Sampler, assert_only, las, scene};

#[test]
fn the_same_points_are_found() {
    let outcome = good().validate_against(&las(&scene()));
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
    let summary = outcome.against.unwrap();
    assert_eq!((summary.points_expected, summary.points_found), (6000, 6000));
    assert_eq!(summary.sum_expected, summary.sum_found);
    assert!(outcome.accuracy.format.is_some_and(|errors| errors.max_3d < 1e-6), "{:?}", outcome.accuracy);
}

#[test]
fn a_point_that_is_missing_moved_or_of_another_colour_is_told() {
    let mut more = scene();
    more.push(Point { position: [9000, 9001, 3500], ..more[0] });
    assert_only(&good().validate_against(&las(&more)), Check::Against, 1);
    for (at, subject) in [(1, "position"), (13, "rgb"), (16, "intensity")] {
        let mut files = good();
        let (leaf, _) = files.leaf();
        let points = files.file(leaf, "bin");
        let last = points.len() - STRIDE;
        points[last + at] ^= 1;
        let outcome = files.validate_against(&las(&scene()));
        assert!(outcome.check(Check::Against).unwrap().found > 0, "{subject}: {:#?}", outcome.problems);
    }
}

#[test]
fn less_than_half_a_lattice_step_is_the_same_point() {
    let mut files = good();
    let (leaf, _) = files.leaf();
    let x = files.file(leaf, "bin")[0];
    files.file(leaf, "bin")[0] = x + 1;
    let outcome = files.validate_against(&las(&scene()));
    assert!(outcome.ok, "{:#?}", outcome.problems);
    assert!(outcome.accuracy.format.is_some_and(|errors| errors.max[0] > 0.002), "{:?}", outcome.accuracy);
}

#[test]
fn white_and_greys_are_compared_with_what_they_are_made_of() {
    let mut points = scene();
    for p in &mut points {
        let grey = ((u32::from(p.intensity) * 255 + 2000) / 4000) as u16;
        p.rgb = [grey * 257; 3];
    }
    let mut files = encode(&Cloud::of(points.clone(), Sampler::Poisson));
    files.cloud["pointmill"]["colours"] = json!({ "intensity": [0, 4000] });
    // sources have other colours, which do not matter
    assert!(files.validate_against(&las(&scene())).ok);
    files.cloud["pointmill"]["colours"] = json!({ "intensity": [0, 3000] });
    assert_eq!(crate::support::broken(&files.validate_against(&las(&scene()))), [Check::Against]);
    files.cloud["pointmill"]["colours"] = json!("white");
    assert!(files.validate_against(&las(&scene())).ok);
}

#[test]
fn a_dataset_of_other_programs_is_compared_without_its_positions() {
    let mut files = good();
    files.cloud.as_object_mut().unwrap().remove("pointmill");
    let eight_bit: Vec<Point> = scene().into_iter().map(|p| Point { rgb: p.rgb.map(|v| v >> 8 << 8), ..p }).collect();
    files = Files { cloud: files.cloud, ..encode(&Cloud::of(eight_bit.clone(), Sampler::Poisson)) };
    let outcome = files.validate_against(&las(&eight_bit));
    let against = outcome.check(Check::Against).unwrap();
    assert!(against.skipped.as_ref().is_some_and(|why| why.contains("positions are not compared")), "{against}");
}

fn with_report(report: &Value) -> pointmill_validate::Outcome {
    let folder = tempfile::tempdir().unwrap();
    good().write(folder.path());
    std::fs::write(folder.path().join("report.json"), report.to_string()).unwrap();
    validate(folder.path(), &Options::default(), &|_| {}).unwrap()
}

const ZERO: [f64; 3] = [0.0; 3];

#[test]
fn the_report_states_points_nodes_and_errors() {
    let nodes = good().validate().nodes;
    let zeros = json!({
        "max": ZERO, "max_3d": 0.0, "rms": ZERO, "rms_3d": 0.0, "mean": ZERO, "how": "measured"
    });
    let report = |points: u64, format: &Value| {
        json!({ "outputs": [{
            "format": "potree1", "folder": "", "points": points, "tree": { "nodes": nodes },
            "accuracy": { "lattice": zeros, "format": format, "total": zeros },
        }]})
    };
    assert_only_report(&with_report(&report(5999, &zeros)));
    let mut wrong = zeros.clone();
    wrong["max"] = json!([1.0, 0.0, 0.0]);
    let outcome = with_report(&report(6000, &wrong));
    assert!(outcome.check(Check::Report).unwrap().ok, "{:#?}", outcome.problems);
    assert!(outcome.check(Check::Accuracy).unwrap().found > 0, "{:#?}", outcome.problems);
}

fn assert_only_report(outcome: &pointmill_validate::Outcome) {
    assert_eq!(outcome.check(Check::Report).unwrap().found, 1, "{:#?}", outcome.problems);
}
