//! Attributes that a conversion has computed, as extra bytes.

use std::fs;

use pointmill_validate::{Check, Options, Outcome};
use serde_json::json;

use crate::file::Writer;
use crate::support::surfels::{Surfel, assert_right, report, settings, turned};
use crate::support::{Cloud, FLAT, Sampler, las, surfel_scene};

fn checked(change: impl Fn(Surfel) -> Surfel) -> Outcome {
    let mut cloud = Cloud::of(surfel_scene(), Sampler::Poisson);
    cloud.nodes.values_mut().flatten().for_each(|p| p.surfel = p.surfel.map(&change));
    Writer::default().encode(&cloud).validate_with(|path| {
        let text = report("copc", &settings(), [FLAT; 2], &json!([]));
        fs::write(path.with_file_name("report.json"), text).unwrap();
        let scan = path.with_file_name("scan.las");
        fs::write(&scan, las(&surfel_scene())).unwrap();
        Options { against: vec![scan], ..Options::default() }
    })
}

#[test]
fn right_attributes_are_found_right_and_others_are_not() {
    assert_right(&checked(|s| s), 0.001);
    let is_flat = |s: &Surfel| s[4] == 0.0;
    let outcome = checked(|s| if is_flat(&s) { s } else { turned(s, 1.0) });
    assert!(!outcome.check(Check::Surfels).unwrap().ok && outcome.check(Check::Against).unwrap().ok);
    let long = checked(|s| if is_flat(&s) { s } else { [1.5 * s[0], 1.5 * s[1], 1.5 * s[2], s[3], s[4]] });
    assert!(!long.check(Check::Normals).unwrap().ok);
    let outcome = checked(|[x, y, z, c, r]| [x, y, z, c, if r == 0.0 { 0.001 } else { r }]);
    assert_eq!(outcome.check(Check::Radii).unwrap().found, 1, "the count");
}
