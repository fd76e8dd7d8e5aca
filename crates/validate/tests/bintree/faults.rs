//! Faults of leaves and splits.

use std::path::Path;

use pointmill_validate::{Check, DatasetKind};
use serde_json::json;

use crate::support::{Cloud, Point, STRIDE, assert_only, check};

const RULES: [&str; 3] = ["mean", "median", "midpoint"];

#[test]
fn a_good_dataset_has_no_findings_by_any_rule_and_in_any_layout() {
    for rule in RULES {
        for packed in [false, true] {
            let outcome = Cloud { rule, packed, ..Cloud::default() }.build().validate();
            assert_only(&outcome, &[]);
            assert_eq!((outcome.format, outcome.points), (DatasetKind::Bintree, 750));
            for check in
                outcome.checks.iter().filter(|c| ![Check::Against, Check::Report, Check::Accuracy].contains(&c.name))
            {
                assert!(check.checked > 0 && check.skipped.is_none(), "{check}");
            }
            let leaves = outcome.leaves.unwrap();
            assert!(leaves.leaves > 37 && leaves.points_max <= 20 && leaves.points_min >= 1, "{leaves:?}");
            assert!(leaves.largest_error > 0.0 && leaves.largest_error <= leaves.largest_bound, "{leaves:?}");
            assert!(leaves.largest_bound < 1e-5 && leaves.volume > 0.0 && leaves.depth >= 6, "{leaves:?}");
        }
    }
}

#[test]
fn files_of_another_encoder_have_no_findings() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/bintree");
    for layout in ["files", "packed"] {
        let outcome = check(&fixtures.join(layout));
        assert_only(&outcome, &[]);
        assert_eq!((outcome.points, outcome.encoding), (17, Some(layout)));
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(fixtures.join("nested/index.json"), folder.path().join("index.json")).unwrap();
    std::fs::copy(fixtures.join("packed/leaves.bin"), folder.path().join("leaves.bin")).unwrap();
    assert_only(&check(folder.path()), &[]);
}

#[test]
fn a_cloud_of_one_leaf_and_an_empty_one() {
    for packed in [false, true] {
        for n in [0, 1, 20] {
            let points = Cloud::default().points[..n].to_vec();
            assert_only(&Cloud { points, packed, ..Cloud::default() }.build().validate(), &[]);
        }
    }
}

#[test]
fn a_point_that_was_moved_off_its_lattice_point() {
    let mut files = Cloud::default().build();
    let leaf = files.some_leaf();
    // a third of a millimetre, of a point in the middle
    let center = files.node(&leaf)["center"][0].as_f64().unwrap();
    let bytes = files.leaf(&leaf);
    let x = |r: &[u8]| f32::from_le_bytes(r[..4].try_into().unwrap());
    let record = bytes.chunks_exact_mut(STRIDE).min_by(|a, b| x(a).abs().total_cmp(&x(b).abs())).unwrap();
    let moved = x(record) + 0.000_3;
    record[..4].copy_from_slice(&moved.to_le_bytes());
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Positions, 1)]);
    assert_eq!(outcome.problems[0].node.unwrap().to_string(), leaf);
    assert_eq!(outcome.problems[0].found, json!(center + f64::from(moved)));
}

#[test]
fn an_offset_that_is_not_the_nearest_single() {
    let mut files = Cloud::default().build();
    let leaf = files.some_leaf();
    let bytes = files.leaf(&leaf);
    let record = bytes.chunks_exact_mut(STRIDE).find(|r| r[..4] != [0; 4]).unwrap();
    record[0] ^= 1;
    // it may have been at the border of the box
    let outcome = files.validate();
    assert_eq!(outcome.check(Check::Positions).unwrap().found, 1, "{:#?}", outcome.problems);
    assert!(outcome.problems.iter().any(|p| p.subject == "offset of x"));
}

#[test]
fn offsets_that_are_no_numbers() {
    let mut files = Cloud::default().build();
    let leaf = files.some_leaf();
    files.leaf(&leaf)[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Positions, 1)]);
    assert!(outcome.check(Check::Split).unwrap().skipped.as_ref().unwrap().contains("1 leaf"));
}

#[test]
fn a_center_that_is_not_the_middle() {
    // at one place all offsets are 0: another center with other offsets decodes to the same
    let points = vec![Point::at([1000, 2000, 300]); 4];
    let mut files = Cloud { points, ..Cloud::default() }.build();
    files.node("n")["center"][0] = json!(637_000.75);
    for record in files.leaf("n").chunks_exact_mut(STRIDE) {
        record[..4].copy_from_slice(&0.25f32.to_le_bytes());
    }
    assert_only(&files.validate(), &[(Check::Positions, 1)]);
}

#[test]
fn a_loose_and_a_narrow_leaf_box() {
    for off in [1, -1] {
        let mut files = Cloud::default().build();
        let leaf = files.some_leaf();
        let value = files.node(&leaf)["max"][1].as_f64().unwrap();
        files.node(&leaf)["max"][1] = json!(f64::from_bits(value.to_bits().wrapping_add_signed(off)));
        let outcome = files.validate();
        assert_eq!(outcome.check(Check::LeafBoxes).unwrap().found, 1);
        let broken = crate::support::broken(&outcome);
        assert!(broken.iter().all(|(c, _)| [Check::LeafBoxes, Check::Unions].contains(c)), "{broken:?}");
    }
}

#[test]
fn a_loose_inner_box() {
    let mut files = Cloud::default().build();
    let value = files.node("n")["min"][2].as_f64().unwrap();
    files.node("n")["min"][2] = json!(value - 1e-9);
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Unions, 1)]);
    assert_eq!(outcome.problems[0].subject, "min of z");
}

#[test]
fn a_plane_one_step_off() {
    for rule in RULES {
        for off in [-1, 1] {
            let mut files = Cloud { rule, ..Cloud::default() }.build();
            let plane = files.node("n1")["split"].as_f64().unwrap();
            let axis = files.node("n1")["axis"].as_u64().unwrap() as usize;
            files.node("n1")["split"] = json!(plane + f64::from(off) * Cloud::default().scale[axis]);
            let outcome = files.validate();
            assert_eq!(outcome.check(Check::Split).unwrap().found, 1, "{rule} {off}: {:#?}", outcome.problems);
            // a median is a point's coordinate, so a plane below it leaves that point on the wrong side
            let sides = outcome.check(Check::Sides).unwrap().found;
            assert_eq!(sides, u64::from(rule == "median" && off == -1), "{rule} {off}: {:#?}", outcome.problems);
        }
    }
}

#[test]
fn a_plane_elsewhere_with_sides_as_it_says() {
    for rule in RULES {
        let outcome = Cloud { rule, plane_off: Some(("n0", 900)), ..Cloud::default() }.build().validate();
        assert_only(&outcome, &[(Check::Split, 1)]);
    }
}

#[test]
fn an_axis_that_is_not_the_longest() {
    let outcome = Cloud { axis: Some(("n", 1)), ..Cloud::default() }.build().validate();
    assert_only(&outcome, &[(Check::SplitAxis, 1)]);
}

#[test]
fn of_equal_extents_the_lowest_axis_is_asked_for() {
    let points: Vec<Point> = (0..30).map(|i| Point::at([i * 7 % 30, i * 11 % 30, 0])).collect();
    let cloud = Cloud { points, ..Cloud::default() };
    assert_only(&cloud.build().validate(), &[]);
    assert_only(&Cloud { axis: Some(("n", 1)), ..cloud }.build().validate(), &[(Check::SplitAxis, 1)]);
}

#[test]
fn children_that_were_swapped() {
    // two leaves of one place each, as many points: files change places, and boxes and centers with them
    let points = (0..40).map(|i| Point::at([if i < 20 { 0 } else { 5000 }, 7, 7])).collect();
    let mut files = Cloud { points, ..Cloud::default() }.build();
    files.nodes.swap(1, 2);
    let (a, b) = (files.nodes[1]["file"].clone(), files.nodes[2]["file"].clone());
    (files.nodes[1]["file"], files.nodes[2]["file"]) = (b, a);
    let low = files.leaf("n0").clone();
    let high = std::mem::replace(files.leaf("n1"), low);
    *files.leaf("n0") = high;
    assert_only(&files.validate(), &[(Check::Sides, 2)]);
}

#[test]
fn a_leaf_above_and_an_inner_node_below_the_capacity() {
    let mut files = Cloud::default().build();
    let leaves = files.nodes.iter().filter(|n| n.get("children").is_none());
    let counts: Vec<u64> = leaves.map(|n| n["count"].as_u64().unwrap()).collect();
    let most = *counts.iter().max().unwrap();
    files.head["capacity"] = json!(most - 1);
    let over = counts.iter().filter(|n| **n == most).count() as u64;
    let outcome = files.validate();
    assert!(over > 0);
    assert_eq!(outcome.check(Check::Capacity).unwrap().found, over);
    files.head["capacity"] = json!(25);
    let under = |n: &&serde_json::Value| n.get("children").is_some() && n["count"].as_u64().unwrap() <= 25;
    let under = files.nodes.iter().filter(under).count() as u64;
    let outcome = files.validate();
    assert!(under > 0);
    assert_eq!(outcome.check(Check::Capacity).unwrap().found, under);
}

#[test]
fn points_of_a_leaf_out_of_order() {
    let mut files = Cloud::default().build();
    let leaf = files.some_leaf();
    let (a, b) = files.leaf(&leaf).split_at_mut(5 * STRIDE);
    a[4 * STRIDE..].swap_with_slice(&mut b[..STRIDE]);
    assert_only(&files.validate(), &[(Check::LeafOrder, 1)]);
}

#[test]
fn points_of_one_place_out_of_order() {
    let points = (0..5).map(|i| Point { intensity: i, ..Point::at([10, 20, 30]) }).collect();
    let mut files = Cloud { points, ..Cloud::default() }.build();
    let (a, b) = files.leaf("n").split_at_mut(STRIDE);
    a.swap_with_slice(&mut b[..STRIDE]);
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::LeafOrder, 1)]);
    assert_eq!(outcome.problems[0].subject, "bytes of points of one place");
}

#[test]
fn classes_that_are_not_whole_or_no_numbers() {
    for class in [f32::NAN, 2.5, f32::INFINITY, 3e8] {
        let mut files = Cloud::default().build();
        let leaf = files.some_leaf();
        files.leaf(&leaf)[STRIDE + 12..STRIDE + 16].copy_from_slice(&class.to_le_bytes());
        assert_only(&files.validate(), &[(Check::Values, 1)]);
    }
}

#[test]
fn transparent_points_and_colours_that_disagree() {
    for (at, subject) in [(24, "rgba beside rgb"), (27, "alpha of rgba")] {
        let mut files = Cloud::default().build();
        let leaf = files.some_leaf();
        files.leaf(&leaf)[at] ^= 1;
        let outcome = files.validate();
        assert_only(&outcome, &[(Check::Values, 1)]);
        assert_eq!(outcome.problems[0].subject, subject);
    }
}

#[test]
fn padding_that_is_not_zero() {
    let mut files = Cloud::default().build();
    let leaf = files.some_leaf();
    files.leaf(&leaf)[2 * STRIDE + 30] = 9;
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Padding, 1)]);
    assert_eq!(outcome.problems[0].found, json!("9 at byte 30 of the record"));
}

/// 50 points of one place, cut into 17, 17 and 16.
fn one_place() -> Cloud {
    let points = (0..50).map(|i| Point { intensity: i, ..Point::at([10, 20, 30]) }).collect();
    Cloud { points, ..Cloud::default() }
}

#[test]
fn runs_of_one_place_of_wrong_sizes_or_out_of_order() {
    let mut files = one_place().build();
    assert_eq!(files.nodes.len(), 5);
    assert_only(&files.validate(), &[]);
    // the second and third leaf have as many points as they should, but each other's
    let outcome = Cloud { run: Some(18), ..one_place() }.build().validate();
    assert!(outcome.check(Check::Degenerate).unwrap().found >= 2, "{:#?}", outcome.problems);
    let last = files.leaf("n00").len() - STRIDE;
    let record = files.leaf("n00")[last..].to_vec();
    let other = files.leaf("n01")[..STRIDE].to_vec();
    files.leaf("n00")[last..].copy_from_slice(&other);
    files.leaf("n01")[..STRIDE].copy_from_slice(&record);
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Degenerate, 1)]);
    assert_eq!(outcome.problems[0].subject, "order of runs");
}

#[test]
fn a_node_of_several_places_that_is_called_degenerate_and_the_reverse() {
    let points = (0..40).map(|i| Point::at([if i < 20 { 0 } else { 5000 }, 7, 7])).collect();
    let mut files = Cloud { points, ..Cloud::default() }.build();
    let node = files.node("n").as_object_mut().unwrap();
    node.remove("split");
    node.insert("axis".into(), json!(-1));
    node.insert("degenerate".into(), json!(true));
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Degenerate, 1)]);

    let mut files = one_place().build();
    let node = files.node("n").as_object_mut().unwrap();
    node.remove("degenerate");
    node.insert("axis".into(), json!(0));
    node.insert("split".into(), json!(637_000.01));
    let outcome = files.validate();
    assert_eq!(outcome.check(Check::Degenerate).unwrap().found, 1, "{:#?}", outcome.problems);
}

/// On two axes, each point twice as far as the one before: midpoints set them apart one by one.
fn far_outliers(median_depth: usize) -> Cloud {
    let line = |axis: usize| {
        (0..45).map(move |i| {
            let mut step = [0; 3];
            step[axis] = 1i64 << i;
            Point::at(step)
        })
    };
    let points = line(0).chain(line(1)).collect();
    Cloud { points, capacity: 1, rule: "midpoint", scale: [1.0; 3], offset: [0.0; 3], median_depth, ..Cloud::default() }
}

#[test]
fn below_depth_64_planes_are_medians() {
    let outcome = far_outliers(64).build().validate();
    assert_only(&outcome, &[]);
    assert!(outcome.leaves.as_ref().unwrap().depth > 64);
    let outcome = far_outliers(500).build().validate();
    assert!(outcome.check(Check::Split).unwrap().found > 0);
    assert!(outcome.leaves.unwrap().depth > 80);
    assert!(outcome.problems.iter().all(|p| p.check == Check::Split), "{:#?}", outcome.problems);
}

/// A leaf of 37 km.
fn coarse() -> Cloud {
    let points = (0..10).map(|i| Point { intensity: i as u16, ..Point::at([i * 4_100_001, i * 3, i]) }).collect();
    Cloud { points, ..Cloud::default() }
}

#[test]
fn where_single_precision_is_too_coarse_it_is_said() {
    let outcome = coarse().build().validate();
    assert_only(&outcome, &[]);
    assert_eq!(outcome.leaves.as_ref().unwrap().uncertain, 1);
    for check in [Check::Positions, Check::LeafOrder] {
        let why = outcome.check(check).unwrap().skipped.as_ref().unwrap();
        assert!(why.contains("too coarse"), "{why}");
    }
    assert_eq!(outcome.check(Check::LeafBoxes).unwrap().checked, 1);
}

#[test]
fn where_single_precision_is_too_coarse_sources_are_compared_with_what_has_to_be_stored() {
    let cloud = Cloud { capacity: 4, ..coarse() };
    let mut cloud = Cloud { scale: [0.000_1; 3], ..cloud };
    cloud.points.iter_mut().for_each(|p| p.step[0] *= 10);
    cloud.points.extend((0..5).map(|i| Point { intensity: i, ..Point::at([123, 20_000_000, 5]) }));
    let mut points = cloud.points.clone();
    let outcome = cloud.build().validate_against(&cloud, &points);
    assert_only(&outcome, &[]);
    assert!(outcome.leaves.as_ref().unwrap().uncertain > 1);
    assert_eq!(outcome.check(Check::Against).unwrap().checked, 15);
    points[3].step[1] += 20;
    points[12].intensity += 9;
    let outcome = cloud.build().validate_against(&cloud, &points);
    assert_only(&outcome, &[(Check::Against, 3)]);
}
