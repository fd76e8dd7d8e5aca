//! Cut and mutated files: an error that names file and byte, or points; never a panic, bounded memory.

use pointmill_format::ReadError;

use crate::common::{self, Cloud};

/// Declared points that are not there, or an error.
fn is_told(result: &Result<Cloud, ReadError>) -> bool {
    match result {
        Err(_) => true,
        Ok(cloud) => !cloud.errors.is_empty() || (cloud.len() as u64) < cloud.info.points_declared,
    }
}

fn check_errors(result: &Result<Cloud, ReadError>) {
    let errors = match result {
        Err(e) => std::slice::from_ref(e),
        Ok(cloud) => &cloud.errors,
    };
    for e in errors {
        let line = e.to_string();
        assert!(!line.contains('\n'), "{line}");
        assert!(e.offset().is_some() || matches!(e.kind(), pointmill_format::ErrorKind::Unsupported), "{line}");
        assert!(e.advice().is_some() || e.what().contains("empty") || e.what().contains("text"), "{line}");
    }
}

#[test]
fn every_fixture_cut_at_64_places_is_told_or_gives_a_prefix_of_its_points() {
    for path in common::all_fixtures() {
        let bytes = std::fs::read(&path).unwrap();
        let whole = common::read(&path).unwrap();
        let extension = path.extension().unwrap().to_string_lossy().into_owned();
        for k in 0..64 {
            let cut = bytes.len() * k / 64;
            let result = common::read_bytes(&bytes[..cut]);
            check_errors(&result);
            let Ok(cloud) = &result else { continue };
            assert!(cloud.len() <= whole.len(), "{path:?} cut at {cut}");
            // these declare how many points there are; behind the last vertex there may be faces
            let counted = matches!(extension.as_str(), "ply" | "pcd" | "pts" | "ptx");
            if counted && cloud.len() < whole.len() {
                assert!(is_told(&result), "{path:?} cut at {cut}: {} points, no word", cloud.len());
            }
        }
    }
}

/// xorshift64*: the same sequence everywhere.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % n.max(1)
    }
}

#[test]
fn seeded_mutations_never_panic_and_errors_name_a_byte() {
    let mut random = Random(20_251_122);
    for path in common::all_fixtures() {
        let original = std::fs::read(&path).unwrap();
        // headers are short: most of the mutations hit them
        for round in 0..60 {
            let mut bytes = original.clone();
            let range = if round % 3 == 2 { bytes.len() } else { bytes.len().min(400) };
            for _ in 0..=random.below(4) {
                let at = random.below(range);
                match random.below(5) {
                    0 => bytes[at] = random.below(256) as u8,
                    1 => bytes[at] ^= 1 << random.below(8),
                    2 => bytes[at] = b"0123456789 -.\n\r#,;"[random.below(18)],
                    3 => {
                        bytes.remove(at);
                    }
                    _ => {
                        let digits = b"99999999999999999999";
                        let len = random.below(20);
                        bytes.splice(at..at, digits[..len].iter().copied());
                    }
                }
            }
            check_errors(&common::read_bytes(&bytes));
        }
    }
}
