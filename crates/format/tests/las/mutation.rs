//! Random damage: nothing panics, nothing is invented, memory stays within what the file justifies.
//!
//! `POINTMILL_MUTATIONS` sets the number of damaged files a fixture (default 10).

use std::path::Path;

use crate::common::{self, put};

/// SplitMix64: a seed gives the same damage everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// The promises of [`common::read_scan`] hold, and the pieces' points fit the file.
fn survives(bytes: &[u8], path: &Path, what: &str) {
    std::fs::write(path, bytes).unwrap();
    if let Ok(cloud) = common::read(path) {
        // 2048 points a byte: the bound of the densest compression
        assert!(cloud.promised <= 2048 * bytes.len() as u64 + 1, "{what}: {} points", cloud.promised);
        assert!(cloud.info.warnings.len() < 50, "{what}");
    }
}

#[test]
fn flipped_bytes_never_panic() {
    let rounds = std::env::var("POINTMILL_MUTATIONS").ok().and_then(|v| v.parse().ok()).unwrap_or(10);
    let path = common::file(b"");
    for (f, fixture) in common::small_fixtures().iter().enumerate() {
        let whole = std::fs::read(fixture).unwrap();
        let head = common::points_start(&whole) + 100;
        for round in 0..rounds {
            let mut random = Random((f as u64) << 32 | round);
            let mut bytes = whole.clone();
            for _ in 0..=random.below(6) {
                // half of the damage goes to the structures
                let range = if random.next() & 1 == 0 { head.min(bytes.len()) } else { bytes.len() };
                let at = random.below(range).max(4);
                match random.below(4) {
                    0 => bytes[at] ^= 1 << random.below(8),
                    1 => bytes[at] = random.next() as u8,
                    2 => bytes[at] = 0xff,
                    _ => {
                        let n = (bytes.len() - at).min(4);
                        let value = (random.next() as u32).to_le_bytes();
                        put(&mut bytes, at, &value[..n]);
                    }
                }
            }
            survives(&bytes, &path, &format!("{} round {round}", fixture.display()));
        }
    }
}

#[test]
fn cuts_at_64_places_never_panic() {
    let path = common::file(b"");
    for fixture in common::small_fixtures() {
        let whole = std::fs::read(&fixture).unwrap();
        for i in 0..64 {
            let len = whole.len() * i / 64;
            survives(&whole[..len], &path, &format!("{} cut to {len}", fixture.display()));
        }
    }
}
