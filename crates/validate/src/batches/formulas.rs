//! The arithmetic of `docs/formats/batches.md`, written again, independent of the format crate.
//!
//! IEEE doubles in the order in which the page writes the formulas; nothing is fused.

/// Points of a full batch.
pub(crate) const BATCH: u64 = 10_240;

/// 2^30: the steps of a box's side.
const STEPS: f64 = 1_073_741_824.0;

/// Where Morton batch `i` of `count` stands, and back (§3.3).
pub(crate) fn slot(i: u64, count: u64) -> u64 {
    let mirror = count - 1 - i;
    let nearer = i.min(mirror);
    if nearer % 2 == 1 && i != mirror { mirror } else { i }
}

/// The largest float32 that is not above `v`.
pub(crate) fn f32_below(v: f64) -> f32 {
    let f = v as f32;
    if f64::from(f) <= v { f } else { f.next_down() }
}

/// The smallest float32 that is not below `v`.
pub(crate) fn f32_above(v: f64) -> f32 {
    let f = v as f32;
    if f64::from(f) >= v { f } else { f.next_up() }
}

/// 30 bits of `r` in a side of length `s` that begins at `m` (§5).
#[inline]
pub(crate) fn encode(r: f64, m: f64, s: f64) -> u32 {
    if s == 0.0 {
        return 0;
    }
    let steps = ((r - m) / s * STEPS).floor();
    steps.min(STEPS - 1.0) as u32 // below 0 saturates at 0: such an r is not in its box, and is found there
}

/// The middle of the cell that the top `bits` bits `t` of q stand for, relative to the origin (§5).
#[inline]
pub(crate) fn decode(t: u32, m: f64, s: f64, bits: u32) -> f64 {
    if s == 0.0 { m } else { m + (f64::from(t) + 0.5) * s / power(bits as i32) }
}

/// 2^`exponent`, exact, for −1022 … 1023.
#[inline]
pub(crate) fn power(exponent: i32) -> f64 {
    f64::from_bits(((1023 + i64::from(exponent)) as u64) << 52)
}

/// The Morton code of coordinates of up to 32 bits: bit k of x is bit 3k, of y 3k + 1, of z 3k + 2 (§3.1).
#[inline]
pub(crate) fn morton([x, y, z]: [u32; 3]) -> u128 {
    let spread = |v: u32| u128::from(spread21(v & 0x1f_ffff)) | u128::from(spread21(v >> 21)) << 63;
    spread(x) | spread(y) << 1 | spread(z) << 2
}

/// Bit k of 21 goes to bit 3k.
#[inline]
fn spread21(v: u32) -> u64 {
    let mut v = u64::from(v);
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// Squared distance, in cells of `level`, from the centre of the cell that `u` (level-0 cells) lies in (§4.1).
#[inline]
pub(crate) fn distance_squared(u: [f64; 3], level: i32) -> f64 {
    let [dx, dy, dz] = u.map(|u| {
        let v = u * power(level);
        v - (v.floor() + 0.5)
    });
    (dx * dx + dy * dy) + dz * dz
}

/// A step of rounding at the size of `v`: the distance to the next double.
pub(crate) fn ulp(v: f64) -> f64 {
    v.abs().next_up() - v.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_those_of_the_page_and_of_the_exchanges_one_by_one() {
        let row = |count: u64| (0..count).map(|i| slot(i, count)).collect::<Vec<_>>();
        assert_eq!(row(5), [0, 3, 2, 1, 4]);
        assert_eq!(row(8), [0, 6, 2, 4, 3, 5, 1, 7]);
        for count in 1..60 {
            let mut slots: Vec<u64> = (0..count).collect();
            let mut i = 1;
            while i + 1 + i < count {
                slots.swap(i as usize, (count - 1 - i) as usize);
                i += 2;
            }
            assert_eq!(row(count), slots, "{count}");
        }
    }

    #[test]
    fn the_example_of_the_page_encodes_and_decodes_to_its_digits() {
        let (m, s, r) = ([10.0, 20.0, 5.0], [8.0, 4.0, 1.0], [12.5, 23.0, 5.3]);
        let q = [0, 1, 2].map(|a| encode(r[a], m[a], s[a]));
        assert_eq!(q, [0x1400_0000, 0x3000_0000, 0x1333_3333]);
        let at = |bits: u32| [0, 1, 2].map(|a| decode(q[a] >> (30 - bits), m[a], s[a], bits));
        assert_eq!(at(10), [12.503_906_25, 23.001_953_125, 5.300_292_968_75]);
        assert_eq!(at(30), [12.500_000_003_725_29, 23.000_000_001_862_645, 5.300_000_000_279_397]);
        assert_eq!(encode(18.0, 10.0, 8.0), (1 << 30) - 1);
        assert_eq!((encode(3.0, 3.0, 0.0), decode(0, 3.0, 0.0, 30)), (0, 3.0));
    }

    #[test]
    fn morton_codes_are_bit_by_bit_those_of_the_page() {
        assert_eq!(morton([52_428; 3]), 0x0000_fc0f_c0fc_0fc0);
        assert_eq!(morton([471_859, 104_857, 52_428]), 0x004b_d0bd_0bd0_bd0b);
        for v in [[1, 0, 0], [0, 1, 0], [0, 0, 1], [u32::MAX, 0x8000_0001, 0x0012_3456], [u32::MAX; 3]] {
            let slow = (0..32).fold(0u128, |c, k| (0..3).fold(c, |c, a| c | u128::from(v[a] >> k & 1) << (3 * k + a)));
            assert_eq!(morton(v), slow);
        }
    }

    #[test]
    fn boxes_round_outwards_by_less_than_one_step() {
        for v in [0.0, 0.1, 1.0, 3.3, 700_000.123_456_7, 1e-300] {
            let (below, above) = (f32_below(v), f32_above(v));
            assert!(f64::from(below) <= v && v < f64::from(below.next_up()), "{v}");
            assert!(f64::from(above) >= v && v > f64::from(above.next_down()), "{v}");
        }
    }
}
