//! Random damage: nothing panics, nothing is invented, memory stays within what the file justifies.
//!
//! `POINTMILL_MUTATIONS` sets the number of damaged files per fixture (default 10).

use pointmill_testkit::{Random, damage, files, scans};

use crate::common::{self, LAS};

#[test]
fn flipped_bytes_never_panic() {
    let path = files::temporary(b"");
    for (f, fixture) in common::small_fixtures().iter().enumerate() {
        let whole = fixture.bytes();
        let head = common::points_start(&whole) + 100;
        for round in 0..damage::rounds(10) {
            let mut random = Random::new((f as u64) << 32 | round);
            // half of the damage goes to the structures; the first bytes stay, for without them it is no LAS file
            let bytes = damage::mutated(&whole, &[4..head, 4..whole.len()], &mut random);
            std::fs::write(&path, bytes).unwrap();
            let _ = LAS.check(&path, &format!("{} round {round}", fixture.name));
        }
    }
}

#[test]
fn cuts_at_64_places_never_panic() {
    let path = files::temporary(b"");
    for fixture in common::small_fixtures() {
        for cut in damage::cuts(&fixture.bytes()) {
            std::fs::write(&path, cut).unwrap();
            let result = LAS.check(&path, &format!("{} cut to {}", fixture.name, cut.len()));
            assert!(result.is_err() || !cut.is_empty());
        }
    }
}

#[test]
fn every_fixture_keeps_the_promises_of_a_scan() {
    for fixture in scans::scan_fixtures("las") {
        let cloud = LAS.check(&fixture.path, &fixture.name).unwrap();
        assert_eq!((cloud.len() as u64, cloud.errors.len()), (fixture.points, 0), "{}", fixture.name);
    }
}
