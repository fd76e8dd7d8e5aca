//! Faults of points: where they are, how they were sampled.

use pointmill_format::NodeKey;
use pointmill_validate::Check;
use serde_json::json;

use crate::dataset::{FINE, encode, good};
use crate::support::{self, Cloud, SCALE, Sampler, assert_only, broken, distance_squared, floor};

#[test]
fn a_coordinate_of_32_bits() {
    let mut files = good();
    let (leaf, _) = files.leaf();
    files.file(leaf, "bin")[3] |= 0x80;
    let outcome = files.validate();
    assert!(outcome.check(Check::Coordinates).unwrap().found == 1, "{:#?}", outcome.problems);
}

#[test]
fn a_point_outside_of_its_node() {
    let mut files = good();
    let (leaf, _) = files.leaf();
    let side = (support::SIDE >> leaf.level) * FINE;
    // a step beyond is allowed
    for (x, ok) in [(side + 1, true), (side + 2, false)] {
        files.file(leaf, "bin")[..4].copy_from_slice(&x.to_le_bytes());
        let outcome = files.validate();
        assert_eq!(outcome.check(Check::Boxes).unwrap().ok, ok, "{:#?}", outcome.problems);
    }
}

#[test]
fn a_tight_box_that_is_not_tight() {
    let mut files = good();
    let upper = files.cloud["tightBoundingBox"]["uz"].as_f64().unwrap();
    files.cloud["tightBoundingBox"]["uz"] = json!(upper + 0.9 * SCALE / f64::from(FINE));
    assert!(files.validate().ok, "less than a step");
    files.cloud["tightBoundingBox"]["uz"] = json!(upper + 1.1 * SCALE / f64::from(FINE));
    assert_only(&files.validate(), Check::TightBox, 1);
}

#[test]
fn a_pair_closer_than_the_spacing() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    cloud.raise(|p, root| root.iter().any(|q| distance_squared(p, q) < 120 * 120));
    let mut files = encode(&cloud);
    let outcome = files.validate();
    assert_only(&outcome, Check::Spacing, 1);
    assert_eq!(outcome.problems[0].node, Some(NodeKey::ROOT.into()));
    // by whatever rule it was made: neither has it
    files.cloud["pointmill"].as_object_mut().unwrap().remove("sampling");
    assert_eq!(broken(&files.validate()), [Check::Spacing]);
}

#[test]
fn three_steps_are_nothing_in_datasets_that_state_no_rule() {
    let mut files = good();
    let spacing = files.cloud["spacing"].as_f64().unwrap();
    files.cloud["spacing"] = json!(spacing + 3.0 * SCALE);
    assert!(!files.validate().check(Check::Spacing).unwrap().ok);
    files.cloud["pointmill"].as_object_mut().unwrap().remove("sampling");
    let outcome = files.validate();
    assert!(outcome.ok, "{:#?}", outcome.problems);
}

#[test]
fn a_hole_at_the_coarsest_level() {
    let mut cloud = Cloud::new(Sampler::Poisson);
    cloud.make_hole();
    let outcome = encode(&cloud).validate();
    assert_eq!(broken(&outcome), [Check::Coverage], "{:#?}", outcome.problems);
}

#[test]
fn a_plane_between_nodes_that_was_sampled_on_both_sides() {
    let honest = encode(&Cloud::sampled(floor(), Sampler::Poisson, false)).validate();
    assert!(honest.ok && honest.problems.is_empty(), "{:#?}", honest.problems);
    let doubled = encode(&Cloud::sampled(floor(), Sampler::Poisson, true)).validate();
    assert_eq!(broken(&doubled), [Check::Seams], "{:#?}", doubled.problems);
}

#[test]
fn figures_of_quality_are_those_of_the_same_octree_as_potree_2() {
    let cloud = Cloud::new(Sampler::Poisson);
    let other = cloud.encode(pointmill_format::potree2::Encoding::Default).validate();
    assert_eq!(encode(&cloud).validate().quality, other.quality);
}
