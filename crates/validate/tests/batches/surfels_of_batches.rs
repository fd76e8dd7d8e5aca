//! Attributes that a conversion has computed, as sections of their own.

use pointmill_validate::{Check, Outcome};
use serde_json::json;

use crate::against::ply;
use crate::cloud::{Cloud, check_reported, terrain};
use crate::surfels::{Surfel, assert_right, report, right, settings, turned};

/// Two batches.
fn cloud() -> Cloud {
    let mut cloud = terrain();
    cloud.points.truncate(11_000);
    let steps: Vec<[i64; 3]> = cloud.points.iter().map(|p| p.x).collect();
    let right = right(&steps, [cloud.scale; 3]);
    cloud.points.iter_mut().zip(right).for_each(|(p, surfel)| p.surfel = Some(surfel));
    cloud
}

fn checked(cloud: &Cloud, change: impl Fn(Surfel) -> Surfel) -> Outcome {
    let mut parts = cloud.parts();
    parts.surfels.iter_mut().for_each(|s| *s = change(*s));
    let text = report("batches", &settings(), [0, 0], &json!([]));
    check_reported(&parts.bytes().0, &[("scan.ply", ply(cloud, true))], Some(&text))
}

#[test]
fn radii_that_scans_may_have_had_are_not_judged() {
    let cloud = cloud();
    let mut text = String::from("x,y,z,red,green,blue,intensity,classification,radius\n");
    for p in &cloud.points {
        let ([x, y, z], [r, g, b]) = (cloud.world(p), p.rgb);
        text += &format!("{x},{y},{z},{r},{g},{b},{},{},7\n", p.intensity, p.class);
    }
    let mut parts = cloud.parts();
    parts.surfels.iter_mut().for_each(|s| s[4] = 7.0);
    let report = report("batches", &settings(), [0, 0], &json!([]));
    let outcome = check_reported(&parts.bytes().0, &[("scan.csv", text.into_bytes())], Some(&report));
    let surfels = outcome.check(Check::Surfels).unwrap();
    assert!(surfels.ok && surfels.skipped.as_ref().is_some_and(|why| why.contains("without radii")), "{surfels}");
    assert!(outcome.check(Check::Radii).unwrap().ok && outcome.surfels.unwrap().normals > 700);
    assert!(outcome.against.unwrap().attributes_not_in_dataset.is_empty());
}

#[test]
fn right_attributes_are_found_right_and_others_are_not() {
    let cloud = cloud();
    assert_right(&checked(&cloud, |s| s), 0.001);
    let outcome = checked(&cloud, |s| turned(s, 1.0));
    assert!(!outcome.check(Check::Surfels).unwrap().ok && outcome.check(Check::Against).unwrap().ok);
    assert!(outcome.problems.iter().any(|p| p.check == Check::Surfels && p.node.is_some()));
    let outcome = checked(&cloud, |[x, y, z, c, r]| [x, y, z, c + 0.5, r]);
    assert!(!outcome.check(Check::Curvature).unwrap().ok && outcome.check(Check::Normals).unwrap().ok);
}
