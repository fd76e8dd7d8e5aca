//! Attributes that a conversion has computed, as columns of leaves.

use pointmill_validate::{Check, Outcome};
use serde_json::json;

use crate::support::{Cloud, Files};
use crate::surfels::{Surfel, assert_faults, assert_right, report, right, settings, turned};

/// Points of the scene that share one place.
const FLAT: u64 = 50;

fn cloud(change: impl Fn(Surfel) -> Surfel) -> Cloud {
    let mut cloud = Cloud::default();
    cloud.points.iter_mut().for_each(|p| p.class = 2.0);
    let steps: Vec<[i64; 3]> = cloud.points.iter().map(|p| p.step).collect();
    let right = right(&steps, cloud.scale);
    cloud.points.iter_mut().zip(right).for_each(|(p, surfel)| p.surfel = Some(change(surfel)));
    cloud
}

fn checked(cloud: &Cloud) -> Outcome {
    let files: Files = cloud.build();
    let text = report("bintree", &settings(), [FLAT; 2], &json!([]));
    files.validate_reported(cloud, &cloud.points, Some(&text))
}

#[test]
fn right_attributes_are_found_right_and_others_are_not() {
    assert_right(&checked(&cloud(|s| s)), 0.001);
    let is_flat = |s: &Surfel| s[4] == 0.0;
    let outcome = checked(&cloud(|s| if is_flat(&s) { s } else { turned(s, 1.0) }));
    assert!(!outcome.check(Check::Surfels).unwrap().ok && outcome.check(Check::Against).unwrap().ok);
    assert!(outcome.problems.iter().any(|p| p.check == Check::Surfels && p.node.is_some()));
    let outcome = checked(&cloud(|[x, y, z, c, r]| [x, y, z, c, if r == 0.0 { -1.0 } else { r }]));
    let radii = outcome.check(Check::Radii).unwrap().found;
    assert!(radii >= 2, "a leaf or more, and the count");
    assert_faults(&outcome, &[(Check::Radii, radii), (Check::Surfels, outcome.check(Check::Surfels).unwrap().found)]);
}

#[test]
fn positions_that_are_not_certain_are_no_neighbours() {
    let mut cloud = cloud(|s| s);
    (cloud.points[0].step[0], cloud.capacity) = (1 << 34, 2000);
    let outcome = checked(&cloud);
    assert!(outcome.check(Check::Surfels).unwrap().skipped.as_ref().is_some_and(|why| why.contains("too coarse")));
    assert!(outcome.check(Check::Normals).unwrap().ok);
}
