//! Random damage: nothing panics, nothing is invented, memory stays within what the file justifies.
//!
//! `POINTMILL_MUTATIONS` sets the number of damaged files a fixture (default 30).

use std::path::Path;

use crate::common;

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

/// The promises of [`common::read_scan`] hold, and the pieces' points fit the file. True if it could be opened.
fn survives(bytes: &[u8], path: &Path, what: &str) -> bool {
    std::fs::write(path, bytes).unwrap();
    let Ok(cloud) = common::read(path) else { return false };
    // a bit a record, and scans of constants
    let most = 8 * bytes.len() as u64 + 65_536 * 16;
    assert!(cloud.promised <= most, "{what}: {} points", cloud.promised);
    assert!(cloud.info.warnings.len() < 50, "{what}");
    true
}

#[test]
fn flipped_bytes_never_panic() {
    let rounds = std::env::var("POINTMILL_MUTATIONS").ok().and_then(|v| v.parse().ok()).unwrap_or(30);
    let path = common::file(b"");
    let (mut opened, mut tried) = (0, 0);
    for (f, fixture) in common::all_fixtures().iter().enumerate() {
        let whole = std::fs::read(fixture).unwrap();
        let xml = u64::from_le_bytes(whole[24..32].try_into().unwrap()) as usize;
        for round in 0..rounds {
            let mut random = Random((f as u64) << 32 | round);
            let mut bytes = whole.clone();
            for _ in 0..=random.below(4) {
                // heads, XML, anything
                let (from, to) = match random.below(3) {
                    0 => (8, 300.min(bytes.len())),
                    1 => (xml, bytes.len()),
                    _ => (0, bytes.len()),
                };
                let at = from + random.below(to - from);
                match random.below(4) {
                    0 => bytes[at] ^= 1 << random.below(8),
                    1 => bytes[at] = random.next() as u8,
                    2 => bytes[at] = 0xff,
                    _ => bytes[at] = b'0' + random.below(10) as u8,
                }
            }
            let what = format!("{} round {round}", fixture.display());
            survives(&bytes, &path, &what);
            // with right checksums the damage reaches the parsers
            common::repair(&mut bytes);
            tried += 1;
            opened += usize::from(survives(&bytes, &path, &what));
        }
    }
    assert!(opened > tried / 10, "{opened} of {tried} opened: the damage is too coarse to test anything");
}

#[test]
fn cuts_at_64_places_never_panic() {
    let path = common::file(b"");
    for fixture in common::all_fixtures() {
        let whole = std::fs::read(&fixture).unwrap();
        for i in 0..64 {
            let len = whole.len() * i / 64;
            assert!(!survives(&whole[..len], &path, &format!("{} cut to {len}", fixture.display())));
        }
    }
}
