//! Cut and mutated files: an error that names file and byte, or points; never a panic, bounded memory.

use pointmill_format::ReadError;
use pointmill_testkit::reader::Cloud;
use pointmill_testkit::{Random, damage, files};

use crate::common::{self, ROWS};

/// Declared points that are not there, or an error.
fn is_reported(result: &Result<Cloud, ReadError>) -> bool {
    match result {
        Err(_) => true,
        Ok(cloud) => !cloud.errors.is_empty() || (cloud.len() as u64) < cloud.info.points_declared,
    }
}

#[test]
fn every_fixture_cut_at_64_places_is_told_or_gives_a_prefix_of_its_points() {
    let path = files::temporary(b"");
    for fixture in common::fixtures() {
        for cut in damage::cuts(&fixture.bytes()) {
            std::fs::write(&path, cut).unwrap();
            let what = format!("{} cut to {}", fixture.name, cut.len());
            let result = ROWS.check(&path, &what);
            let Ok(cloud) = &result else { continue };
            let points = cloud.len() as u64;
            assert!(points <= fixture.points, "{what}");
            // OFF declares its points, but behind the last vertex there may be faces
            if fixture.is_counted() && fixture.kind != "OFF" && points < fixture.points {
                assert!(is_reported(&result), "{what}: {points} points, no word");
            }
        }
    }
}

#[test]
fn seeded_mutations_never_panic_and_errors_name_a_byte() {
    let path = files::temporary(b"");
    let mut random = Random::new(20_251_122);
    for fixture in common::fixtures() {
        let whole = fixture.bytes();
        for round in 0..damage::rounds(60) {
            // headers are short: most of the damage goes there
            let bytes = damage::mutated(&whole, &[0..400, 0..400, 0..whole.len()], &mut random);
            std::fs::write(&path, &bytes).unwrap();
            let _ = ROWS.check(&path, &format!("{} round {round}", fixture.name));
        }
    }
}

#[test]
fn every_fixture_keeps_the_promises_of_a_scan() {
    for fixture in common::fixtures() {
        let cloud = ROWS.check(&fixture.path, &fixture.name).unwrap();
        assert_eq!((cloud.len() as u64, cloud.errors.len()), (fixture.points, 0), "{}", fixture.name);
    }
}
