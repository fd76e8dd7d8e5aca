//! Random damage: nothing panics, nothing is invented, memory stays within what the file justifies.
//!
//! `POINTMILL_MUTATIONS` sets the number of damaged files per fixture (default 30).

use pointmill_testkit::{Random, damage, files};

use crate::common::{self, E57};

#[test]
fn flipped_bytes_never_panic() {
    let path = files::temporary(b"");
    let (mut opened, mut tried) = (0, 0);
    for (f, fixture) in common::fixtures().iter().enumerate() {
        let whole = fixture.bytes();
        let xml = damage::u64_at(&whole, 24) as usize;
        for round in 0..damage::rounds(30) {
            let mut random = Random::new((f as u64) << 32 | round);
            let what = format!("{} round {round}", fixture.name);
            // heads, XML, anything
            let ranges = [8..300, xml..whole.len(), 0..whole.len()];
            let mut bytes = damage::mutated(&whole, &ranges, &mut random);
            std::fs::write(&path, &bytes).unwrap();
            let _ = E57.check(&path, &what);
            // with right checksums the damage reaches the parsers
            common::repair(&mut bytes);
            std::fs::write(&path, &bytes).unwrap();
            tried += 1;
            opened += usize::from(E57.check(&path, &what).is_ok());
        }
    }
    assert!(opened > tried / 10, "{opened} of {tried} opened: the damage is too coarse to test anything");
}

#[test]
fn cuts_at_64_places_are_one_clear_error_or_cost_no_point() {
    for fixture in common::fixtures() {
        let whole = fixture.bytes();
        for cut in damage::cuts(&whole) {
            let what = format!("{} cut to {}", fixture.name, cut.len());
            match E57.read_bytes(cut) {
                Err(error) => {
                    let broken = matches!(error.kind(), pointmill_format::ErrorKind::Broken);
                    assert!(broken && error.offset().is_some(), "{what}: {error}");
                }
                // the XML ends in the last page, and is whole
                Ok(cloud) => {
                    assert!(cut.len() > whole.len() - 1024, "{what} is read");
                    assert!(cloud.len() as u64 == fixture.points && cloud.errors.is_empty(), "{what}");
                    assert!(cloud.warned("the last page of the file lacks"), "{what}: {:?}", cloud.info.warnings);
                }
            }
        }
    }
}

#[test]
fn every_fixture_keeps_the_promises_of_a_scan() {
    for fixture in common::fixtures() {
        let cloud = E57.check(&fixture.path, &fixture.name).unwrap();
        assert_eq!((cloud.len() as u64, cloud.errors.len()), (fixture.points, 0), "{}", fixture.name);
    }
}
