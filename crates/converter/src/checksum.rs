//! An order-independent checksum of records: the sum of one strong-enough hash a record.
//!
//! It proves to ourselves, on every run, that what was decoded is what was written. The validator has its own.

use std::fmt;

/// Sum of record hashes, and how many.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Checksum {
    sum: u128,
    count: u64,
}

// Odd constants with balanced bits (digits of the golden ratio and of √2, √3, …).
const K: [u64; 8] = [
    0x9e37_79b9_7f4a_7c15,
    0x6a09_e667_f3bc_c909,
    0xbb67_ae85_84ca_a73b,
    0x3c6e_f372_fe94_f82b,
    0xa54f_f53a_5f1d_36f1,
    0x510e_527f_ade6_82d1,
    0x9b05_688c_2b3e_6c1f,
    0x1f83_d9ab_fb41_bd6b,
];

#[inline]
fn fold(a: u64, b: u64) -> u64 {
    let p = u128::from(a) * u128::from(b);
    (p as u64) ^ (p >> 64) as u64
}

#[inline]
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |w, b| w << 8 | u64::from(*b))
}

/// Hash of one record: products of pairs of words, independent of one another so that they overlap in the pipeline.
#[inline]
fn hash(record: &[u8]) -> u64 {
    let (pairs, tail) = record.as_chunks::<16>();
    let mut h = record.len() as u64;
    for (i, pair) in pairs.iter().enumerate() {
        let (a, b) = pair.split_at(8);
        let a = u64::from_le_bytes(a.try_into().unwrap_or_default());
        let b = u64::from_le_bytes(b.try_into().unwrap_or_default());
        let salt = (i as u64).wrapping_mul(K[7]);
        h = h.wrapping_add(fold(a ^ K[(2 * i) & 7] ^ salt, b ^ K[(2 * i + 1) & 7]).rotate_left(i as u32));
    }
    let (a, b) = tail.split_at(tail.len().min(8));
    h = h.wrapping_add(fold(word(a) ^ K[4], word(b) ^ K[5]));
    fold(h ^ K[2], K[3])
}

impl Checksum {
    /// Adds every record of `records` (`stride` bytes each).
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
    fn any_order_gives_the_same_sum_and_any_changed_byte_another() {
        let records: Vec<u8> = (0..35u32 * 100).map(|i| (i * 7919 >> 3) as u8).collect();
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
