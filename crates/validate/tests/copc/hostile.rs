//! Files that were damaged anywhere: findings or an error, no panic, no memory by what is claimed.

use pointmill_testkit::Random;
use pointmill_testkit::damage::{cuts, hit, mutated, rounds};
use pointmill_testkit::files::fixture_bytes;
use pointmill_validate::{Options, validate};

use crate::file::good;

fn look(bytes: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.copc.laz");
    std::fs::write(&path, bytes).unwrap();
    let options = Options {
        threads: 1,
        memory_bytes: 256 << 20,
        max_problems: 5,
        neighbourhoods: bytes.len() % 2 == 1,
        ..Options::default()
    };
    if let Ok(outcome) = validate(&path, &options, &|_| {}) {
        assert_eq!(outcome.ok, outcome.checks.iter().all(|c| c.ok));
    }
}

#[test]
fn damaged_and_cut_files_end_in_findings_or_an_error() {
    let bytes = fixture_bytes("copc/pages.copc.laz");
    cuts(&bytes).step_by(13).for_each(look);
    let mut random = Random::new(3);
    for _ in 0..rounds(300) {
        let range = 0..bytes.len();
        look(&mutated(&bytes, std::slice::from_ref(&range), &mut random));
    }
}

#[test]
fn what_every_entry_says_can_be_wrong() {
    let file = good();
    let mut random = Random::new(4);
    let places: Vec<usize> = file.entries.values().chain(file.proxies.values()).copied().collect();
    for _ in 0..rounds(60) {
        let mut bytes = file.bytes.clone();
        let place = places[random.below(places.len() as u64) as usize] + random.below(32) as usize;
        hit(&mut bytes, place, &mut random);
        look(&bytes);
    }
}
