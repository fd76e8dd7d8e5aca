//! Packed bits to values: the hot loop of reading E57. `examples/e57_speed.rs` measures it.
//!
//! The streams of a piece start at a byte border, for pieces start at multiples of eight records.

use super::fields::Encoding;

/// Zeros or anything else that must follow the packed bytes, so that wide loads stay inside.
pub(super) const PADDING: usize = 16;

/// Calls `put(i, value)` with the stored bits of each of `n` values, `bits` (0–64) wide. `bytes`: the packed values
/// and [`PADDING`]; values that are not there are omitted.
#[inline(always)]
fn each_packed(bits: u32, bytes: &[u8], n: usize, mut put: impl FnMut(usize, u64)) {
    macro_rules! whole {
        ($int:ident, $size:literal) => {
            for (i, b) in bytes.as_chunks::<$size>().0.iter().take(n).enumerate() {
                put(i, u64::from($int::from_le_bytes(*b)));
            }
        };
    }
    let bits = bits as usize;
    match bits {
        0 => (0..n).for_each(|i| put(i, 0)),
        8 => whole!(u8, 1),
        16 => whole!(u16, 2),
        32 => whole!(u32, 4),
        64 => whole!(u64, 8),
        // eight values are `bits` bytes
        1..=7 => {
            let mask = (1u64 << bits) - 1;
            for group in 0..n.div_ceil(8) {
                let word = word::<8>(bytes, group * bits).map_or(0, u64::from_le_bytes);
                for j in 0..(n - 8 * group).min(8) {
                    put(8 * group + j, word >> (j * bits) & mask);
                }
            }
        }
        // with up to 7 bits of a value before it, it fits a word
        9..=57 => {
            let mask = (1u64 << bits) - 1;
            for i in 0..n {
                let Some(word) = word::<8>(bytes, i * bits / 8) else { return };
                put(i, u64::from_le_bytes(word) >> (i * bits % 8) & mask);
            }
        }
        _ => {
            let mask = u64::MAX >> (64 - bits.min(64));
            for i in 0..n {
                let Some(word) = word::<16>(bytes, i * bits / 8) else { return };
                put(i, (u128::from_le_bytes(word) >> (i * bits % 8)) as u64 & mask);
            }
        }
    }
}

#[inline(always)]
fn word<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

/// Calls `put(i, value)` with each of `n` stored integers (0 for floats and text).
#[inline(always)]
pub(super) fn each_integer(encoding: Encoding, bytes: &[u8], n: usize, mut put: impl FnMut(usize, i64)) {
    let (Encoding::Integer { min, .. } | Encoding::Scaled { min, .. }) = encoding else {
        return (0..n).for_each(|i| put(i, 0));
    };
    each_packed(encoding.bits(), bytes, n, |i, raw| put(i, min.wrapping_add(raw as i64)));
}

/// Calls `put(i, value)` with each of `n` meant values (0 for text).
#[inline(always)]
pub(super) fn each(encoding: Encoding, bytes: &[u8], n: usize, mut put: impl FnMut(usize, f64)) {
    match encoding {
        Encoding::Single => {
            for (i, b) in bytes.as_chunks().0.iter().take(n).enumerate() {
                put(i, f64::from(f32::from_le_bytes(*b)));
            }
        }
        Encoding::Double => {
            for (i, b) in bytes.as_chunks().0.iter().take(n).enumerate() {
                put(i, f64::from_le_bytes(*b));
            }
        }
        Encoding::Integer { .. } | Encoding::Text => each_integer(encoding, bytes, n, |i, v| put(i, v as f64)),
        Encoding::Scaled { scale, offset, .. } => {
            each_integer(encoding, bytes, n, |i, v| put(i, v as f64 * scale + offset));
        }
    }
}

/// The meant values, to all of `out`.
pub(super) fn fill(encoding: Encoding, bytes: &[u8], out: &mut [f64]) {
    let n = out.len();
    each(encoding, bytes, n, |i, v| {
        if let Some(out) = out.get_mut(i) {
            *out = v;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bit by bit, the slow and certain way.
    fn pack(bits: u32, values: &[u64]) -> Vec<u8> {
        let mut bytes = vec![0; (bits as usize * values.len()).div_ceil(8)];
        for (i, v) in values.iter().enumerate() {
            for b in (0..bits as usize).filter(|b| v >> b & 1 == 1) {
                let at = i * bits as usize + b;
                bytes[at / 8] |= 1 << (at % 8);
            }
        }
        bytes.resize(bytes.len() + PADDING, 0xa5);
        bytes
    }

    #[test]
    fn every_width_comes_back_as_it_was_packed() {
        for bits in 0..=64 {
            let mask = if bits == 0 { 0 } else { u64::MAX >> (64 - bits) };
            let values: Vec<u64> = (1..=43u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) & mask).collect();
            let mut seen = Vec::new();
            each_packed(bits, &pack(bits, &values), values.len(), |_, v| seen.push(v));
            assert_eq!(seen, values, "{bits} bits");
        }
    }

    #[test]
    fn scaled_integers_are_exact_over_the_whole_range() {
        let encoding = Encoding::Scaled { min: i64::MIN, max: i64::MAX, scale: 0.5, offset: 1.0 };
        let raw = [0, 1 << 63, u64::MAX, (1 << 63) + 7];
        let mut out = [0.0; 4];
        fill(encoding, &pack(64, &raw), &mut out);
        assert_eq!(out, [i64::MIN as f64 * 0.5 + 1.0, 1.0, i64::MAX as f64 * 0.5 + 1.0, 4.5]);
        let mut integers = Vec::new();
        each_integer(encoding, &pack(64, &raw), 4, |_, v| integers.push(v));
        assert_eq!(integers, [i64::MIN, 0, i64::MAX, 7]);
    }

    #[test]
    fn missing_bytes_leave_values_out() {
        let mut out = [9.0; 4];
        fill(Encoding::Double, &1.5f64.to_le_bytes(), &mut out);
        assert_eq!(out, [1.5, 9.0, 9.0, 9.0]);
    }
}
