//! With its sources at hand, the validator proves that nothing was lost, added or changed, and says what was.

mod support;

use pointmill_format::NodeKey;
use pointmill_format::potree2::Encoding;
use pointmill_validate::Check;
use serde_json::json;
use support::{Cloud, OFFSET, Point, SCALE, Sampler, assert_only, scene};

const BOTH: [Encoding; 2] = [Encoding::Default, Encoding::Brotli];

/// The scene with classes that a LAS 1.2 record can hold.
fn points() -> Vec<Point> {
    scene().into_iter().map(|p| Point { classification: p.classification & 31, ..p }).collect()
}

fn cloud() -> Cloud {
    Cloud::of(points(), Sampler::Poisson)
}

#[test]
fn the_same_points_in_any_order_and_any_number_of_files_are_found() {
    let points = points();
    let (a, b) = points.split_at(2500);
    for encoding in BOTH {
        let files = cloud().encode(encoding);
        let outcome = files.validate_against(&[b, a]);
        assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
        let summary = outcome.against.unwrap();
        assert_eq!((summary.points_expected, summary.points_found), (6000, 6000));
        assert!(summary.attributes_not_in_dataset.contains(&"user data".to_owned()));
        assert_eq!(summary.sum_expected, summary.sum_found);
    }
}

#[test]
fn a_missing_point_is_named() {
    let mut more = points();
    let extra = Point { position: [9000, 9001, 3500], ..more[0] };
    more.push(extra);
    let outcome = cloud().encode(Encoding::Default).validate_against(&[&more]);
    assert_only(&outcome, Check::Against, 1);
    let expected = &outcome.problems[0].expected;
    assert_eq!(expected["position"][0], json!(9000.0 * SCALE + OFFSET[0]));
    assert_eq!(expected["gps-time"], json!(extra.gps_time));
}

#[test]
fn a_point_stored_twice_is_surplus_and_its_node_is_named() {
    // its twin is missing from the source, so that counts agree
    let mut cloud = cloud();
    let leaf = *cloud.nodes.keys().find(|k| !cloud.is_inner(**k)).unwrap();
    let twice = cloud.nodes[&leaf][0];
    cloud.nodes.get_mut(&leaf).unwrap().push(twice);
    let outcome = cloud.encode(Encoding::Brotli).validate_against(&[&points()]);
    assert_only(&outcome, Check::Against, 1);
    assert_eq!((outcome.problems[0].subject.as_ref(), outcome.problems[0].node), ("surplus point", Some(leaf.into())));
}

#[test]
fn a_changed_attribute_is_named_with_both_values() {
    let mut sources = points();
    sources[77].intensity ^= 1;
    sources[78].gps_time += 1e-9;
    let outcome = cloud().encode(Encoding::Default).validate_against(&[&sources]);
    assert_only(&outcome, Check::Against, 2);
    let intensity = outcome.problems.iter().find(|p| p.subject == "intensity of a point").unwrap();
    assert_eq!(intensity.expected, json!(sources[77].intensity));
    assert_eq!(intensity.found, json!(sources[77].intensity ^ 1));
}

#[test]
fn swapped_attributes_of_two_points_do_not_cancel() {
    let mut sources = points();
    (sources[5].rgb, sources[6].rgb) = (sources[6].rgb, sources[5].rgb);
    assert_only(&cloud().encode(Encoding::Brotli).validate_against(&[&sources]), Check::Against, 2);
}

#[test]
fn positions_that_are_all_one_step_off_are_told_apart_from_lost_points() {
    let sources = points();
    let moved = sources.iter().map(|p| Point { position: p.position.map(|v| v + 1), ..*p });
    let mut files = Cloud::of(moved.collect(), Sampler::Poisson).encode(Encoding::Brotli);
    files.metadata.extra.clear(); // another converter's
    let outcome = files.validate_against(&[&sources]);
    assert_only(&outcome, Check::Against, 1);
    assert_eq!(outcome.problems[0].found, json!("shifted by +1 step on every axis"));
    assert_eq!(outcome.problems[0].points, Some(6000));
}

#[test]
fn eight_bit_colours_are_expected_times_257_by_file() {
    let mut sources = points();
    let wide = sources.split_off(3000);
    sources.iter_mut().for_each(|p| p.rgb = p.rgb.map(|v| v & 255));
    let stored = sources.iter().map(|p| Point { rgb: p.rgb.map(|v| v * 257), ..*p }).chain(wide.clone());
    let mut files = Cloud::of(stored.collect(), Sampler::Poisson).encode(Encoding::Default);
    assert!(files.validate_against(&[&sources, &wide]).ok);
    files.metadata.extra["pointmill"]["rgbDepth"] = json!("16");
    assert!(!files.validate_against(&[&sources, &wide]).ok);
}

#[test]
fn recorded_filters_are_applied_to_the_sources() {
    let sources = points();
    let bounds = [OFFSET[0], OFFSET[1], OFFSET[2], OFFSET[0] + 12.0, OFFSET[1] + 13.0, OFFSET[2] + 100.0];
    let kept = sources.iter().enumerate().filter(|(i, p)| {
        let inside = (0..3).all(|a| f64::from(p.position[a]) * SCALE + OFFSET[a] <= bounds[3 + a]);
        i % 2 == 0 && inside && [2, 6].contains(&p.classification)
    });
    let kept: Vec<Point> = kept.map(|(_, p)| *p).collect();
    assert!(kept.len() > 300 && kept.len() < 2000);
    let mut files = Cloud::of(kept, Sampler::Poisson).encode(Encoding::Brotli);
    files.metadata.extra["pointmill"]["filter"] = json!({ "bounds": bounds, "classes": [2, 6], "every": 2 });
    let outcome = files.validate_against(&[&sources]);
    assert!(outcome.ok, "{:#?}", outcome.problems);
    files.metadata.extra["pointmill"]["filter"]["every"] = json!(1);
    assert!(!files.validate_against(&[&sources]).ok);
}

#[test]
fn dropped_duplicates_make_it_a_comparison_of_sets() {
    let sources = points();
    let mut twice = sources.clone();
    twice.extend_from_slice(&sources[100..200]);
    let mut files = cloud().encode(Encoding::Default);
    assert!(!files.validate_against(&[&twice]).ok);
    files.metadata.extra["pointmill"]["duplicates"] = json!("drop");
    let outcome = files.validate_against(&[&twice]);
    assert!(outcome.ok, "{:#?}", outcome.problems);
    let outcome = files.validate_against(&[&twice[1..]]);
    assert_only(&outcome, Check::Against, 1);
}

#[test]
fn an_attribute_dropped_as_constant_has_to_be_constant() {
    let sources = points();
    let mut files = cloud().encode(Encoding::Default);
    files.metadata.extra["pointmill"]["attributesDropped"] = json!({ "user data": 0, "return number": 1 });
    assert!(files.validate_against(&[&sources]).ok);
    files.metadata.extra["pointmill"]["attributesDropped"]["return number"] = json!(2);
    let outcome = files.validate_against(&[&sources]);
    assert_only(&outcome, Check::Against, 1);
    assert_eq!(outcome.problems[0].points, Some(6000));
}

#[test]
fn the_jobs_lattice_may_start_elsewhere() {
    // the sources' coordinate 0 is the dataset's 700
    let sources = points();
    let mut files = cloud().encode(Encoding::Default);
    files.metadata.extra["pointmill"]["latticeOffset"] = json!(OFFSET.map(|v| v - 700.0 * SCALE));
    assert!(files.validate_against(&[&sources]).ok);
    assert!(files.entries.iter().any(|e| e.key == NodeKey::ROOT));
}
