//! Damaged datasets of every format: an account or an error of one line, never a panic, never memory without end.
//! `POINTMILL_MUTATIONS` sets how many are made of each fixture.

use std::collections::BTreeMap;
use std::path::Path;

use pointmill_testkit::Random;
use pointmill_testkit::damage::{hit, peak_memory_bytes, rounds};
use pointmill_testkit::files::fixture;
use pointmill_validate::{Options, validate};

/// Whole datasets by name, each with its files.
fn originals() -> Vec<(&'static str, BTreeMap<String, Vec<u8>>)> {
    let folders = ["potree2/default", "potree2/brotli", "bintree/files", "bintree/packed"];
    let mut all: Vec<_> = folders.map(|name| (name, pointmill_testkit::files::dataset(&fixture(name)))).into();
    for name in ["batches/example.qbatch", "batches/blocks.qbatch", "batches/coarse.qbatch", "batches/far.qbatch"] {
        let bytes = std::fs::read(fixture(name)).unwrap();
        all.push((name, BTreeMap::from([("points.qbatch".to_owned(), bytes)])));
    }
    all
}

fn look_at(folder: &Path, seed: u64, name: &str) -> bool {
    let options = Options { memory_bytes: 200 << 20, threads: 1, ..Options::default() };
    match validate(folder, &options, &|_| {}) {
        Ok(outcome) => {
            let found = outcome.checks.iter().any(|check| check.found > 0);
            assert!(outcome.ok || found || !outcome.problems.is_empty(), "{name} {seed}: not ok, and nothing found");
            assert_eq!(outcome.checks.len(), pointmill_validate::Check::of(outcome.format).len());
            outcome.ok
        }
        Err(error) => {
            assert!(!error.to_string().contains('\n'), "{name} {seed}: {error}");
            false
        }
    }
}

#[test]
fn damaged_datasets_are_accounted_for_within_bounded_memory() {
    let (mut sound, mut faulty) = (0, 0);
    for (name, original) in originals() {
        for seed in 0..rounds(60) {
            let random = &mut Random::new(seed);
            let mut files = original.clone();
            for _ in 0..=random.below(2) {
                let names: Vec<String> = files.keys().cloned().collect();
                let bytes = files.get_mut(&names[random.index(names.len())]).unwrap();
                if !bytes.is_empty() {
                    // structures are at the start of files
                    let reach = if random.below(2) == 0 { bytes.len() } else { bytes.len().min(400) };
                    hit(bytes, random.index(reach), random);
                }
            }
            let folder = tempfile::tempdir().unwrap();
            files.iter().for_each(|(file, bytes)| std::fs::write(folder.path().join(file), bytes).unwrap());
            match look_at(folder.path(), seed, name) {
                true => sound += 1,
                false => faulty += 1,
            }
        }
    }
    println!("{sound} sound, {faulty} faulty");
    assert!(faulty > sound, "{sound} sound, {faulty} faulty");
    if let Some(peak) = peak_memory_bytes() {
        assert!(peak < 300 << 20, "{peak} bytes");
    }
}
