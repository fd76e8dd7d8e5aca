//! Morton order of tree coordinates: octree path order, x owns the highest bit of each triple.

use super::frames::TreePoint;

/// Spreads the low 21 bits of `v` to every third bit.
#[inline]
fn spread(v: u32) -> u64 {
    let mut v = u64::from(v) & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// Interleaves the low 21 bits of each coordinate; bit `k` of x goes to bit `3k + 2`, y to `3k + 1`, z to `3k`.
#[inline]
pub(crate) fn interleave(v: [u32; 3]) -> u64 {
    spread(v[0]) << 2 | spread(v[1]) << 1 | spread(v[2])
}

/// The way from a cell of the octree to the one `levels` (at most 21) below it that is `2^shift` units wide: three bits
/// per level, the highest first.
#[inline]
pub(crate) fn path(t: TreePoint, shift: u32, levels: u32) -> u64 {
    let mask = (1 << levels) - 1;
    interleave(t.cell(shift).map(|c| c & mask))
}

/// Compares two points in Morton order without building their codes (31 bits per axis, x before y before z).
#[inline]
pub(crate) fn compare(a: [u32; 3], b: [u32; 3]) -> std::cmp::Ordering {
    let d = [a[0] ^ b[0], a[1] ^ b[1], a[2] ^ b[2]];
    // The axis whose highest differing bit is highest decides; x wins ties, then y.
    let mut axis = 0;
    for other in 1..3 {
        if d[axis] < d[other] && d[axis] < d[axis] ^ d[other] {
            axis = other;
        }
    }
    a[axis].cmp(&b[axis])
}

/// Child index of a tree coordinate below a node of `level` (x is bit 2).
#[inline]
pub(crate) fn child_index(t: TreePoint, level: u8) -> u8 {
    let bit = 30 - u32::from(level);
    ((t[0] >> bit & 1) << 2 | (t[1] >> bit & 1) << 1 | (t[2] >> bit & 1)) as u8
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    #[test]
    fn interleave_places_x_highest() {
        assert_eq!(interleave([1, 0, 0]), 4);
        assert_eq!(interleave([0, 1, 0]), 2);
        assert_eq!(interleave([0, 0, 3]), 0b1001);
        assert_eq!(interleave([0x1f_ffff; 3]), (1 << 63) - 1);
    }

    #[test]
    fn compare_agrees_with_the_codes() {
        let mut random = Random::new(1);
        let mut next = || random.below(1 << 21) as u32;
        for _ in 0..10_000 {
            let (a, b) = ([next(), next(), next()], [next(), next() >> 9, next()]);
            assert_eq!(compare(a, b), interleave(a).cmp(&interleave(b)), "{a:?} {b:?}");
            assert_eq!(compare(a, a), std::cmp::Ordering::Equal);
        }
    }
}
