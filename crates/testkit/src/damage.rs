//! Planted damage: files cut short, bytes changed at random, fields that are wrong.

use std::ops::Range;

use crate::Random;

/// Places at which [`cuts`] cuts a file.
pub const CUTS: usize = 64;

/// The file cut at [`CUTS`] places, the first of them byte 0.
pub fn cuts(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    (0..CUTS).map(|k| &bytes[..bytes.len() * k / CUTS])
}

/// Damaged files to make of each fixture: the environment variable `POINTMILL_MUTATIONS`, or `default`.
pub fn rounds(default: u64) -> u64 {
    std::env::var("POINTMILL_MUTATIONS").ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// The file with one to five places changed, each in one of `ranges`: bits, bytes, digits, lengths. The ranges name
/// where the structures are, since damage among the points seldom shows.
///
/// The result may be shorter or longer than `bytes`, because text moves when a character is lost.
pub fn mutated(bytes: &[u8], ranges: &[Range<usize>], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(5) {
        let range = &ranges[random.index(ranges.len())];
        let (from, to) = (range.start, range.end.min(bytes.len()));
        if from < to {
            let at = from + random.index(to - from);
            change(&mut bytes, at, random);
        }
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    match random.below(14) {
        0..3 => bytes[at] ^= 1 << random.below(8),
        3..5 => bytes[at] = random.below(256) as u8,
        5..7 => bytes[at] = 0xff,
        7..9 => {
            let len = (bytes.len() - at).min(4);
            let value = random.next_u32().to_le_bytes();
            put(bytes, at, &value[..len]);
        }
        9..12 => bytes[at] = random.pick(b"0123456789 -.\n\r#,;"),
        12 => {
            bytes.remove(at);
        }
        _ => {
            let digits = random.index(20);
            bytes.splice(at..at, std::iter::repeat_n(b'9', digits));
        }
    }
}

/// What JSON is made of.
const JSON: &[u8] = b"0123456789.-e\",[]{}";

/// One change at byte `at` of a file of a dataset, which is JSON or packed numbers: cut there, a number as large as it
/// can be or 0, a character or a number of JSON, a run of bytes twice, flipped bits.
pub fn hit(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let end = |len: usize| (at + len).min(bytes.len());
    match random.below(7) {
        0 => bytes.truncate(at),
        1 => {
            let extreme = random.pick(&[u64::MAX, 1 << 63, u64::from(u32::MAX), 1 << 40, 256, 0]).to_le_bytes();
            let len = end(1 + random.index(8)) - at;
            put(bytes, at, &extreme[..len]);
        }
        2 => bytes[at] = random.pick(JSON),
        3 => {
            let number: &[u8] = random.pick(&[b"1e308", b"-1", b"18446744073709551615", b"4294967295", b"0"]);
            let end = end(random.index(4));
            bytes.splice(at..end, number.iter().copied());
        }
        4 => {
            let copy = bytes[at..end(random.index(60))].to_vec();
            let to = random.index(bytes.len());
            bytes.splice(to..to, copy);
        }
        _ => (0..=random.index(4)).for_each(|_| {
            let at = random.index(bytes.len());
            bytes[at] ^= 1 << random.index(8);
        }),
    }
}

/// Highest resident set of this process, where the system reports it: what a test that plants lengths looks at.
pub fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}

/// Processor time that this process has taken, seconds, where the system reports it: what a test that plants counts looks at. It
/// does not go on while the process is stopped.
pub fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let ticks = |field: &str| field.parse::<u64>().ok(); // of user and of system, a hundredth of a second each
    Some((ticks(fields.get(11)?)? + ticks(fields.get(12)?)?) as f64 / 100.0)
}

/// Overwrites bytes from `at` on.
pub fn put(bytes: &mut [u8], at: usize, new: &[u8]) {
    bytes[at..at + new.len()].copy_from_slice(new);
}

/// A little-endian number at byte `at`.
pub fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

/// A little-endian number at byte `at`.
pub fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_is_the_same_for_the_same_seed_and_stays_in_its_ranges() {
        let whole = vec![b'a'; 1000];
        let (mut lengths, mut unchanged) = ([0; 3], 0);
        for seed in 0..500 {
            let damaged = mutated(&whole, &[100..150, 150..200], &mut Random::new(seed));
            assert_eq!(damaged, mutated(&whole, &[100..150, 150..200], &mut Random::new(seed)));
            let (head, tail) = (&damaged[..100], &damaged[damaged.len() - 700..]);
            assert!(head.iter().chain(tail).all(|b| *b == b'a'), "seed {seed}");
            lengths[(damaged.len().cmp(&1000) as i8 + 1) as usize] += 1;
            unchanged += usize::from(damaged == whole);
        }
        assert!(lengths.iter().all(|n| *n > 10), "shorter, equal, longer: {lengths:?}");
        assert!(unchanged < 10, "{unchanged} files came out whole");
    }

    #[test]
    fn processor_time_is_that_of_work() {
        let Some(before) = processor_seconds() else { return };
        let mut random = Random::new(1);
        let begun = std::time::Instant::now();
        while begun.elapsed().as_millis() < 60 || processor_seconds().unwrap() < before + 0.03 {
            std::hint::black_box(random.next_u64());
        }
        assert!(processor_seconds().unwrap() < before + 60.0);
    }

    #[test]
    fn cuts_begin_with_nothing_and_never_give_the_whole() {
        let lengths: Vec<usize> = cuts(&[0; 640]).map(<[u8]>::len).collect();
        assert_eq!((lengths[0], lengths[1], lengths[63], lengths.len()), (0, 10, 630, 64));
    }
}
