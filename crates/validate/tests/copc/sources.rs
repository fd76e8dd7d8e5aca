//! Against the scans, the report of the conversion, and a small ceiling of memory.

use pointmill_validate::{Check, Options, Outcome, validate};
use serde_json::{Value, json};

use crate::file::{Writer, foreign, good};
use crate::support::{Cloud, Point, Sampler, assert_only, las, scene};

#[test]
fn the_same_points_are_found_whoever_wrote_the_file() {
    for file in [good(), foreign()] {
        let outcome = file.validate_against(&las(&scene()));
        assert!(outcome.ok, "{:#?}", outcome.problems);
        let summary = outcome.against.unwrap();
        assert_eq!((summary.points_expected, summary.points_found), (6000, 6000));
        assert_eq!(summary.sum_expected, summary.sum_found);
        assert!(outcome.accuracy.format.is_some_and(|errors| errors.max_3d < 1e-9), "{:?}", outcome.accuracy);
    }
}

#[test]
fn a_point_that_is_missing_moved_or_of_another_colour_is_told() {
    let mut more = scene();
    more.push(Point { position: [9000, 9001, 3500], ..more[0] });
    assert_only(&good().validate_against(&las(&more)), Check::Against, 1);
    let changes: [fn(&mut Point); 5] =
        [|p| p.position[2] += 1, |p| p.rgb[1] ^= 1, |p| p.intensity += 1, |p| p.scan_angle += 1, |p| p.gps_time += 0.5];
    for (i, change) in changes.into_iter().enumerate() {
        let mut others = scene();
        change(&mut others[17]);
        let outcome = good().validate_against(&las(&others));
        assert!(outcome.check(Check::Against).unwrap().found > 0, "{i}: {:#?}", outcome.problems);
    }
}

#[test]
fn what_was_asked_of_the_conversion_is_read_in_the_file() {
    let own = json!({ "sampling": "poisson", "rgbDepth": "auto", "duplicates": "keep", "filter": { "classes": [2] } });
    let kept: Vec<Point> = scene().into_iter().filter(|p| p.classification & 31 == 2).collect();
    let writer = Writer { own: Some(own), ..Writer::default() };
    let outcome = writer.encode(&Cloud::of(kept, Sampler::Poisson)).validate_against(&las(&scene()));
    assert!(outcome.check(Check::Against).unwrap().ok, "{:#?}", outcome.problems);
}

#[test]
fn colours_of_8_bits_are_stored_with_16() {
    let dark = |p: Point| Point { rgb: p.rgb.map(|v| v >> 8), ..p };
    let wide = |p: Point| Point { rgb: p.rgb.map(|v| (v >> 8) * 257), ..p };
    let source: Vec<Point> = scene().into_iter().map(dark).collect();
    let stored = Cloud::of(scene().into_iter().map(wide).collect(), Sampler::Poisson);
    assert!(Writer::default().encode(&stored).validate_against(&las(&source)).ok);
    let as_they_are = Cloud::of(source.clone(), Sampler::Poisson);
    let outcome = Writer::default().encode(&as_they_are).validate_against(&las(&source));
    assert!(!outcome.check(Check::Against).unwrap().ok, "ours are wide");
}

fn with_report(report: &Value) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("points.copc.laz"), good().bytes).unwrap();
    std::fs::write(folder.path().join("report.json"), report.to_string()).unwrap();
    validate(folder.path(), &Options::default(), &|_| {}).unwrap()
}

#[test]
fn the_report_names_the_points_and_nodes() {
    let nodes = good().entries.len();
    let report = |format: &str, points: u64| json!({ "outputs": [{ "format": format, "folder": "", "points": points, "tree": { "nodes": nodes } }] });
    let of = |report: &Value| with_report(report).check(Check::Report).unwrap().found;
    assert_eq!(of(&report("copc", 6000)), 0);
    assert_eq!(of(&report("copc", 6001)), 1);
    assert_eq!(of(&report("potree2", 6000)), 1);
}

#[test]
fn a_ceiling_that_is_too_low_is_said_to_be_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.copc.laz");
    std::fs::write(&path, good().bytes).unwrap();
    let with = |memory_bytes| validate(&path, &Options { memory_bytes, ..Options::default() }, &|_| {});
    assert!(with(64 << 20).unwrap().ok);
    assert!(with(24 << 20).unwrap_err().to_string().contains("memory"));
}

#[test]
fn a_quick_look_leaves_out_the_neighbourhoods() {
    let outcome = good().validate_with(|_| Options { neighbourhoods: false, ..Options::default() });
    assert!(outcome.ok && outcome.check(Check::Spacing).unwrap().skipped.is_some());
    assert_eq!(outcome.check(Check::Boxes).unwrap().checked, 6000);
}
