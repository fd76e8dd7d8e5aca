//! Attributes that a conversion has computed: right ones, and one planted fault each, exactly that finding and no other.

mod support;

use std::sync::OnceLock;

use pointmill_format::potree2::Encoding;
use pointmill_validate::{Check, Options, Outcome, Severity, validate};
use serde_json::{Value, json};
use support::surfels::{Surfel, assert_faults, assert_right, report, right_within, settings, turned};
use support::{Cloud, FLAT, Files, Point, SCALE, Sampler, las, surfel_scene};

fn good() -> Cloud {
    static GOOD: OnceLock<Cloud> = OnceLock::new();
    GOOD.get_or_init(|| Cloud::of(surfel_scene(), Sampler::Poisson)).clone()
}

/// Validates with that report, against the scan if `is_compared`.
fn checked(files: &Files, report: &str, is_compared: bool) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    files.write(folder.path());
    std::fs::write(folder.path().join("report.json"), report).unwrap();
    let mut options = Options { threads: 2, ..Options::default() };
    if is_compared {
        let scan = folder.path().join("scan.las");
        std::fs::write(&scan, las(&surfel_scene())).unwrap();
        options.against.push(scan);
    }
    validate(folder.path(), &options, &|_| {}).unwrap()
}

fn right_report() -> String {
    report("potree2", &settings(), [FLAT; 2], &json!([]))
}

/// Encodes after `plant` has changed every point of all nodes that it likes; values have no stated ranges to break.
fn planted(plant: impl Fn(usize, &mut Point)) -> Files {
    let mut cloud = good();
    cloud.nodes.values_mut().flatten().enumerate().for_each(|(i, p)| plant(i, p));
    cloud.encode(Encoding::Default)
}

/// Changes what was computed of the first point that has a normal.
fn one(change: impl Fn(Surfel) -> Surfel) -> Files {
    let is_it = |p: &Point| p.surfel.is_some_and(|s| s[4] > 0.0);
    let first = good().nodes.values().flatten().position(is_it).unwrap();
    planted(|i, p| {
        if i == first {
            p.surfel = p.surfel.map(&change);
        }
    })
}

#[test]
fn what_was_computed_right_is_found_right() {
    for encoding in [Encoding::Default, Encoding::Brotli] {
        let files = good().encode(encoding);
        let outcome = checked(&files, &right_report(), true);
        assert_right(&outcome, 0.001);
        assert!(outcome.check(Check::Against).unwrap().checked > 6000, "all else is compared with the scan");
        let alone = checked(&files, &right_report(), false);
        assert_faults(&alone, &[]);
        assert!(alone.check(Check::Surfels).unwrap().skipped.is_some() && alone.surfels.is_none());
    }
}

#[test]
fn the_sample_does_not_depend_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    good().encode(Encoding::Default).write(folder.path());
    std::fs::write(folder.path().join("report.json"), right_report()).unwrap();
    let scan = folder.path().join("scan.las");
    std::fs::write(&scan, las(&surfel_scene())).unwrap();
    let summary = |threads: usize| {
        let options = Options { threads, against: vec![scan.clone()], ..Options::default() };
        validate(folder.path(), &options, &|_| {}).unwrap().surfels.unwrap()
    };
    assert_eq!(summary(1), summary(7));
    assert_eq!(summary(1).points, 1000);
}

#[test]
fn datasets_without_such_attributes_have_no_such_checks() {
    let files = Cloud::new(Sampler::Poisson).encode(Encoding::Default);
    let nothing = json!({ "outputs": [{ "format": "potree2", "folder": "" }], "options": {} }).to_string();
    for report in [nothing, report("potree2", &Value::Null, [0, 0], &json!([]))] {
        let outcome = checked(&files, &report, false);
        assert!(Check::DERIVED.iter().all(|check| outcome.check(*check).is_none()));
    }
}

#[test]
fn a_normal_of_another_length_or_of_no_numbers() {
    let longer = one(|[x, y, z, c, r]| [1.01 * x, 1.01 * y, 1.01 * z, c, r]);
    assert_faults(&checked(&longer, &right_report(), false), &[(Check::Normals, 1)]);
    let hardly = one(|[x, y, z, c, r]| [1.0005 * x, 1.0005 * y, 1.0005 * z, c, r]);
    assert_faults(&checked(&hardly, &right_report(), true), &[]);
    let none = one(|[x, _, z, c, r]| [x, f32::NAN, z, c, r]);
    let outcome = checked(&none, &right_report(), false);
    assert_faults(&outcome, &[(Check::Normals, 1)]);
    assert!(outcome.problems.iter().any(|p| p.check == Check::Normals && p.node.is_some() && p.points == Some(1)));
}

#[test]
fn lengths_of_normals_that_scans_had_are_warned_of() {
    let kept = right_report().replace("\"kept_normals\":0", "\"kept_normals\":1");
    let files = one(|[x, y, z, c, r]| [2.0 * x, 2.0 * y, -2.0 * z, c, r]);
    let outcome = checked(&files, &kept, true);
    assert_faults(&outcome, &[]);
    let warnings: Vec<_> = outcome.problems.iter().filter(|p| p.check == Check::Normals).collect();
    assert!(matches!(warnings[..], [w] if w.severity == Severity::Warning), "{warnings:?}");
    let summary = outcome.surfels.unwrap();
    assert!(summary.normals == 0 && summary.largest_curvature.unwrap() < 1e-6, "{summary:?}");
    // the same report of normals that were not kept
    let replaced = kept.replace("\"keep\"", "\"replace\"");
    assert_faults(&checked(&files, &replaced, false), &[(Check::Normals, 1)]);
}

#[test]
fn a_normal_on_the_wrong_side() {
    let down = one(|[x, y, z, c, r]| [-x, -y, -z, c, r]);
    let oriented = |to: Value| {
        let mut settings = settings();
        settings["orient"] = to;
        report("potree2", &settings, [FLAT; 2], &json!([]))
    };
    assert_faults(&checked(&down, &right_report(), true), &[(Check::Normals, 1)]);
    // a place far above the middle of the cloud; one far below is on the other side of all
    assert_faults(&checked(&down, &oriented(json!([637_050.0, 849_050.0, 1e7])), false), &[(Check::Normals, 1)]);
    let all = good().points().count() as u64 - FLAT;
    let below = checked(&good().encode(Encoding::Default), &oriented(json!([637_050.0, 849_050.0, -1e7])), false);
    let found: u64 = below.problems.iter().filter(|p| p.check == Check::Normals).filter_map(|p| p.points).sum();
    assert!(found > 0 && found <= all && !below.check(Check::Normals).unwrap().ok);
    // where the scanner was, no dataset says
    assert_faults(&checked(&down, &oriented("scanner".into()), true), &[]);
    // the largest component of a flat scene is z
    let none = checked(&down, &oriented("none".into()), false);
    assert!(!none.check(Check::Normals).unwrap().ok);
}

#[test]
fn level_normals_point_to_the_north_or_the_east() {
    for (normal, is_right) in [([0.0, 1.0], true), ([0.0, -1.0], false), ([1.0, 0.0], true), ([-1.0, 0.0], false)] {
        let level = one(|[.., c, r]| [normal[0], normal[1], 0.0, c, r]);
        let expected = if is_right { vec![] } else { vec![(Check::Normals, 1)] };
        assert_faults(&checked(&level, &right_report(), false), &expected);
    }
}

#[test]
fn a_curvature_that_no_surface_has() {
    for curvature in [0.334, -1e-6, f32::NAN] {
        let files = one(|[x, y, z, _, r]| [x, y, z, curvature, r]);
        assert_faults(&checked(&files, &right_report(), false), &[(Check::Curvature, 1)]);
    }
    let most = one(|[x, y, z, _, r]| [x, y, z, 1.0 / 3.0, r]);
    assert_faults(&checked(&most, &right_report(), false), &[]);
}

#[test]
fn a_radius_that_is_negative_or_infinite() {
    for radius in [-0.1, f32::NAN] {
        let files = one(|[x, y, z, c, _]| [x, y, z, c, radius]);
        assert_faults(&checked(&files, &right_report(), false), &[(Check::Radii, 1)]);
    }
    // the metadata have no word for it, and so do not bound it
    let infinite = one(|[x, y, z, c, _]| [x, y, z, c, f32::INFINITY]);
    assert_faults(&checked(&infinite, &right_report(), false), &[(Check::AttributeRanges, 1), (Check::Radii, 1)]);
}

#[test]
fn counts_of_the_report_are_those_of_the_dataset() {
    let files = good().encode(Encoding::Default);
    let counted = |normals: u64, radii: u64| report("potree2", &settings(), [normals, radii], &json!([]));
    assert_faults(&checked(&files, &counted(FLAT + 1, FLAT), false), &[(Check::Normals, 1)]);
    assert_faults(&checked(&files, &counted(FLAT, FLAT - 1), false), &[(Check::Radii, 1)]);
    let zero = one(|[.., c, r]| [0.0, 0.0, 0.0, c, r]);
    assert_faults(&checked(&zero, &right_report(), false), &[(Check::Normals, 1)]);
    // of equal points, which had no normal, some were dropped
    let dropped = |points: u64| {
        let report: Value = serde_json::from_str(&counted(FLAT + 3, FLAT + 3)).unwrap();
        let mut report = report;
        report["outputs"][0]["duplicates_dropped"] = points.into();
        report.to_string()
    };
    let outcome = checked(&files, &dropped(3), true);
    assert_faults(&outcome, &[]);
    assert!(outcome.check(Check::Surfels).unwrap().skipped.as_ref().is_some_and(|why| why.contains("3 equal")));
    assert_faults(&checked(&files, &dropped(2), false), &[(Check::Normals, 1), (Check::Radii, 1)]);
}

#[test]
fn attributes_that_are_missing_or_were_left_out() {
    let mut cloud = good();
    cloud.nodes.values_mut().flatten().for_each(|p| p.surfel = None);
    let files = cloud.encode(Encoding::Default);
    let outcome = checked(&files, &right_report(), true);
    assert_faults(&outcome, &[(Check::Normals, 3), (Check::Curvature, 1), (Check::Radii, 1)]);
    let left_out = |names: &[&str]| {
        let dropped = names.iter().map(|name| json!({ "name": name, "why": "not requested" }));
        report("potree2", &settings(), [FLAT; 2], &dropped.collect())
    };
    let all = checked(&files, &left_out(&["NormalX", "NormalY", "NormalZ", "curvature", "radius"]), true);
    assert_faults(&all, &[]);
    assert!(Check::DERIVED.iter().all(|check| all.check(*check).unwrap().skipped.is_some()));
    let some = checked(&files, &left_out(&["NormalX", "NormalZ", "curvature", "radius"]), true);
    assert_faults(&some, &[(Check::Normals, 1)]);
    assert!(some.problems.iter().any(|p| p.check == Check::Normals && p.subject == "NormalY"));
}

#[test]
fn attributes_that_are_one_value_throughout_are_as_good_as_stored() {
    let mut cloud = good();
    cloud.nodes.values_mut().flatten().for_each(|p| p.surfel = None);
    let files = cloud.encode(Encoding::Default);
    let dropped = |radius: f64, curvature: f64| {
        let one = |name: &str, value: f64| json!({ "name": name, "why": "constant", "constant": [value] });
        json!([
            one("NormalX", 0.0),
            one("NormalY", 0.0),
            one("NormalZ", 1.0),
            one("curvature", curvature),
            one("radius", radius)
        ])
    };
    let stated = |radius: f64, curvature: f64| report("potree2", &settings(), [0, 0], &dropped(radius, curvature));
    assert_faults(&checked(&files, &stated(0.5, 0.0), false), &[]);
    let below = checked(&files, &stated(-0.5, 0.4), false);
    let broken: Vec<_> = support::surfels::faults(&below).into_iter().map(|(check, _)| check).collect();
    assert_eq!(broken, [Check::Curvature, Check::Radii]);
    // the scene is not flat
    let compared = checked(&files, &stated(0.5, 0.0), true);
    assert!(!compared.check(Check::Surfels).unwrap().ok);
}

/// Points of the sample are some: a fault is planted in all.
#[test]
fn normals_curvatures_and_radii_that_are_not_those_of_the_points_around() {
    let compared = |change: &dyn Fn(Surfel) -> Surfel| {
        checked(
            &planted(|_, p| p.surfel = p.surfel.filter(|s| s[4] > 0.0).map(change).or(p.surfel)),
            &right_report(),
            true,
        )
    };
    let judged = {
        let summary = checked(&good().encode(Encoding::Default), &right_report(), true).surfels.unwrap();
        summary.points - summary.ambiguous
    };
    let found = |outcome: &Outcome| {
        let faults = support::surfels::faults(outcome);
        assert!(matches!(faults[..], [(Check::Surfels, _)]), "{faults:?}");
        faults[0].1
    };
    let outcome = compared(&|s| turned(s, 1.0));
    assert!(found(&outcome) * 10 > judged * 9, "{} of {judged}", found(&outcome));
    assert!((outcome.surfels.unwrap().largest_angle.unwrap() - 1.0).abs() < 0.01, "{:?}", outcome.surfels);
    assert!(outcome.problems.iter().any(|p| p.check == Check::Surfels && p.subject.contains("degrees off")));
    assert_faults(&compared(&|s| turned(s, 0.05)), &[]);
    let outcome = compared(&|[x, y, z, c, r]| [x, y, z, c, r * 1.01]);
    assert!(
        found(&outcome) * 10 > judged * 9 && (outcome.surfels.unwrap().largest_radius.unwrap() - 0.01).abs() < 1e-4
    );
    let outcome = compared(&|[x, y, z, c, r]| [x, y, z, c + 0.001, r]);
    assert!(
        found(&outcome) * 10 > judged * 9 && (outcome.surfels.unwrap().largest_curvature.unwrap() - 0.001).abs() < 1e-5
    );
    // another number of neighbours than the report says
    let mut other = settings();
    other["neighbours"] = json!(15);
    let report = report("potree2", &other, [FLAT; 2], &json!([]));
    assert!(found(&checked(&good().encode(Encoding::Default), &report, true)) > judged / 2);
}

#[test]
fn a_neighbourhood_by_distance_has_other_radii() {
    let mut within = settings();
    within["neighbours"] = Value::Null;
    within["neighbour_radius"] = json!(2.0);
    let reported = |settings: &Value, zeros: [u64; 2]| report("potree2", settings, zeros, &json!([]));
    let outcome = checked(&good().encode(Encoding::Default), &reported(&within, [FLAT; 2]), true);
    assert!(!outcome.check(Check::Surfels).unwrap().ok, "made by the 16 nearest");
    assert!(outcome.surfels.unwrap().points == 1000);
    let mut cloud = good();
    let steps: Vec<[i64; 3]> = cloud.points().map(|p| p.position.map(i64::from)).collect();
    let right = right_within(&steps, [SCALE; 3], 2.0);
    cloud.nodes.values_mut().flatten().zip(&right).for_each(|(p, surfel)| p.surfel = Some(*surfel));
    let zeros = |is_zero: fn(&Surfel) -> bool| right.iter().filter(|s| is_zero(s)).count() as u64;
    let zeros = [zeros(|s| s[..3] == [0.0; 3]), zeros(|s| s[4] == 0.0)];
    assert!(zeros[1] > FLAT && zeros[0] > zeros[1], "some are alone, some have one neighbour: {zeros:?}");
    let outcome = checked(&cloud.encode(Encoding::Default), &reported(&within, zeros), true);
    assert_right(&outcome, 0.001);
}
