//! An order-independent checksum of records: the sum of one strong-enough hash per record.
//!
//! It proves to ourselves, on every run, that what was decoded is what was written. The validator has its own.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Sum of record hashes, and how many.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Checksum {
    sum: u128,
    count: u64,
}

// Odd constants with balanced bits (digits of the golden ratio and of √2, √3, …).
const K: [u64; 5] =
    [0x9e37_79b9_7f4a_7c15, 0x6a09_e667_f3bc_c909, 0xbb67_ae85_84ca_a73b, 0x3c6e_f372_fe94_f82b, 0x1f83_d9ab_fb41_bd6b];

#[inline]
fn fold(a: u64, b: u64) -> u64 {
    let p = u128::from(a) * u128::from(b);
    (p as u64) ^ (p >> 64) as u64
}

/// Mixes 16 bytes; `i` is their place.
#[inline]
fn mix(bytes: &[u8; 16], i: u64) -> u64 {
    let v = u128::from_le_bytes(*bytes);
    let salt = i.wrapping_mul(K[4]);
    fold(v as u64 ^ K[0] ^ salt, (v >> 64) as u64 ^ K[1].wrapping_add(salt))
}

/// Hash of one record: products of pairs of words, independent of one another so that they overlap in the pipeline.
/// The last 16 bytes may overlap those before, so that there is no tail.
#[inline]
fn hash(record: &[u8]) -> u64 {
    let mut h = record.len() as u64;
    let last = match record.last_chunk::<16>() {
        Some(last) => *last,
        None => padded(record),
    };
    for (i, bytes) in record.as_chunks::<16>().0.iter().enumerate() {
        h = h.wrapping_add(mix(bytes, i as u64));
    }
    fold(h.wrapping_add(mix(&last, u64::MAX)) ^ K[2], K[3])
}

/// A record of less than 16 bytes, and zeros behind it. Those of binary trees are that short: two words instead of a call.
#[inline]
fn padded(record: &[u8]) -> [u8; 16] {
    if let (Some(first), Some(last)) = (record.first_chunk(), record.last_chunk()) {
        let (first, last) = (u64::from_le_bytes(*first), u64::from_le_bytes(*last));
        let behind = last.checked_shr(8 * (16 - record.len() as u32)).unwrap_or(0);
        return (u128::from(behind) << 64 | u128::from(first)).to_le_bytes();
    }
    let mut padded = [0; 16];
    padded[..record.len()].copy_from_slice(record);
    padded
}

impl Checksum {
    /// Adds every record of `records` (`stride` bytes each).
    #[inline]
    pub(crate) fn add_all(&mut self, records: &[u8], stride: usize) {
        for record in records.chunks_exact(stride) {
            self.add(record);
        }
    }

    #[inline]
    pub(crate) fn add(&mut self, record: &[u8]) {
        self.sum = self.sum.wrapping_add(u128::from(hash(record)));
        self.count += 1;
    }

    /// Number of records.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// Takes out what `other` holds.
    pub(crate) fn remove(&mut self, other: &Self) {
        self.sum = self.sum.wrapping_sub(other.sum);
        self.count = self.count.wrapping_sub(other.count);
    }

    /// Takes out `old` and puts in `new`.
    pub(crate) fn replace(&mut self, old: &Self, new: &Self) {
        self.remove(old);
        self.merge(new);
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.sum = self.sum.wrapping_add(other.sum);
        self.count = self.count.wrapping_add(other.count);
    }
}

impl fmt::Display for Checksum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_records_are_followed_by_zeros() {
        let record: Vec<u8> = (1..16).collect();
        for len in 0..16 {
            let mut expected = [0; 16];
            expected[..len].copy_from_slice(&record[..len]);
            assert_eq!(padded(&record[..len]), expected);
        }
    }

    #[test]
    fn any_order_gives_the_same_sum_and_any_changed_byte_another() {
        let records: Vec<u8> = (0..35u32 * 100).map(|i| ((i * 7919) >> 3) as u8).collect();
        let mut forward = Checksum::default();
        forward.add_all(&records, 35);
        let mut backward = Checksum::default();
        records.chunks_exact(35).rev().for_each(|r| backward.add(r));
        assert_eq!(forward, backward);
        for at in 0..35 {
            let mut changed = records.clone();
            changed[35 * 50 + at] ^= 1;
            let mut other = Checksum::default();
            other.add_all(&changed, 35);
            assert_ne!(forward, other, "byte {at}");
        }
    }
}
