//! With its sources at hand, the validator proves that nothing was lost, added or changed.

use pointmill_validate::Check;
use serde_json::json;

use crate::support::{Cloud, Files, Point, assert_only};

/// Colours with 8 bits alone: `rgb` is renamed, so that nothing is to be found for it.
fn only_rgba() -> Files {
    let mut files = Cloud::default().build();
    files.head["attributes"][4] = json!({ "name": "spare", "type": "uint16", "elements": 3, "offset": 16 });
    for bytes in files.leaves.values_mut() {
        bytes.chunks_exact_mut(crate::support::STRIDE).for_each(|r| r[16..22].fill(0));
    }
    files
}

#[test]
fn the_same_points_in_any_order_are_found() {
    for packed in [false, true] {
        let cloud = Cloud { packed, ..Cloud::default() };
        let mut points = cloud.points.clone();
        points.reverse();
        let outcome = cloud.build().validate_against(&cloud, &points);
        assert_only(&outcome, &[]);
        let summary = outcome.against.unwrap();
        assert_eq!((summary.points_expected, summary.points_found), (750, 750));
        assert_eq!(summary.sum_expected, summary.sum_found);
    }
}

#[test]
fn a_changed_attribute_or_class_is_named() {
    let cloud = Cloud::default();
    for at in 0..3 {
        let mut points = cloud.points.clone();
        let p: &mut Point = &mut points[77];
        let subject = match at {
            0 => {
                p.class = 9.0;
                "classification of a point"
            }
            1 => {
                p.rgb[1] ^= 1;
                "rgb of a point"
            }
            _ => {
                p.gps_time += 1e-9;
                "gps-time of a point"
            }
        };
        let outcome = cloud.build().validate_against(&cloud, &points);
        assert_only(&outcome, &[(Check::Against, 1)]);
        assert_eq!(outcome.problems[0].subject, subject);
        assert!(outcome.problems[0].node.unwrap().to_string().starts_with('n'));
    }
}

#[test]
fn a_missing_a_surplus_and_a_moved_point_are_named() {
    let cloud = Cloud::default();
    let files = cloud.build();
    let mut points = cloud.points.clone();
    let lost = points.pop().unwrap();
    let outcome = files.validate_against(&cloud, &points);
    assert_only(&outcome, &[(Check::Against, 1)]);
    assert_eq!(outcome.problems[0].found["position"], json!(cloud.world(lost.step)));
    points.push(Point { step: [150_000, -3000, 41], ..lost });
    let outcome = files.validate_against(&cloud, &points);
    assert_only(&outcome, &[(Check::Against, 2)]);
}

#[test]
fn colours_of_8_bits_are_compared_as_such() {
    let cloud = Cloud::default();
    let files = only_rgba();
    let mut points = cloud.points.clone();
    assert_only(&files.validate_against(&cloud, &points), &[]);
    points[5].rgb[0] = points[5].rgb[0].wrapping_add(1000);
    let outcome = files.validate_against(&cloud, &points);
    assert_only(&outcome, &[(Check::Against, 1)]);
    assert_eq!(outcome.problems[0].subject, "rgb of a point");
}

#[test]
fn recorded_filters_are_applied_to_the_sources() {
    let all = Cloud::default();
    let points = all.points.iter().filter(|p| p.class == 5.0).copied().collect();
    let cloud = Cloud { points, ..Cloud::default() };
    let mut files = cloud.build();
    files.head["pointmill"] = json!({ "rgbDepth": "16", "filter": { "classes": [5] } });
    assert_only(&files.validate_against(&cloud, &all.points), &[]);
    files.head["pointmill"] = json!({ "rgbDepth": "16" });
    assert!(!files.validate_against(&cloud, &all.points).ok);
}
