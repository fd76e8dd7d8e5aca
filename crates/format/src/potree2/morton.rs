//! Interleaved bits. In payloads x owns bit 0; in the names of nodes z does.

use crate::NodeKey;

/// Bit k of a goes to bit 3k, of b to 3k+1, of c to 3k+2: 48 bits.
pub(super) fn interleave(a: u16, b: u16, c: u16) -> u64 {
    spread(a) | spread(b) << 1 | spread(c) << 2
}

/// Undoes [`interleave`]; bits 48 and up are ignored.
pub(super) fn deinterleave(code: u64) -> [u16; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

fn spread(v: u16) -> u64 {
    let mut v = u64::from(v);
    v = (v | v << 16) & 0x0000_ff00_00ff;
    v = (v | v << 8) & 0x00f0_0f00_f00f;
    v = (v | v << 4) & 0x0c30_c30c_30c3;
    (v | v << 2) & 0x2492_4924_9249
}

fn gather(v: u64) -> u16 {
    let mut v = v & 0x2492_4924_9249;
    v = (v | v >> 2) & 0x0c30_c30c_30c3;
    v = (v | v >> 4) & 0x00f0_0f00_f00f;
    v = (v | v >> 8) & 0x0000_ff00_00ff;
    (v | v >> 16) as u16
}

/// The position as Potree's BROTLI encoding keeps it: the (upper, lower) words, Morton codes of bits 16–31 and 0–15.
pub(super) fn position_words(p: [i32; 3]) -> (u64, u64) {
    let [x, y, z] = p.map(|v| v as u32);
    (interleave((x >> 16) as u16, (y >> 16) as u16, (z >> 16) as u16), interleave(x as u16, y as u16, z as u16))
}

/// Undoes [`position_words`].
pub(super) fn position_from_words(upper: u64, lower: u64) -> [i32; 3] {
    let (upper, lower) = (deinterleave(upper), deinterleave(lower));
    std::array::from_fn(|a| (u32::from(upper[a]) << 16 | u32::from(lower[a])) as i32)
}

/// Where a node stands in breadth-first order: the level in the top bits, then the digits of the name.
pub(super) fn breadth_first_rank(key: NodeKey) -> u128 {
    let low = interleave(key.z as u16, key.y as u16, key.x as u16);
    let high = interleave((key.z >> 16) as u16, (key.y >> 16) as u16, (key.x >> 16) as u16);
    u128::from(key.level) << 96 | u128::from(high) << 48 | u128::from(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_goes_where_the_format_wants_it_and_comes_back() {
        for bit in 0..16 {
            let v = 1 << bit;
            assert_eq!(
                [interleave(v, 0, 0), interleave(0, v, 0), interleave(0, 0, v)],
                [0, 1, 2].map(|a| 1 << (3 * bit + a))
            );
            assert_eq!(deinterleave(interleave(v, 0, 0)), [v, 0, 0]);
            assert_eq!(deinterleave(interleave(0, v, 0)), [0, v, 0]);
            assert_eq!(deinterleave(interleave(0, 0, v)), [0, 0, v]);
        }
    }

    #[test]
    fn the_examples_of_the_format_page_hold() {
        assert_eq!(position_words([1, 2, 3]), (0, 0x35));
        assert_eq!(position_words([123_456, 654_321, 42]), (0x403, 0x6da4_1a4f_2822));
        assert_eq!(interleave(65_535, 256, 1), 0x2492_4b24_924d);
    }

    #[test]
    fn positions_come_back_whatever_their_sign() {
        for p in [[0, 0, 0], [-1, i32::MIN, i32::MAX], [1 << 27, 0, 0], [-5, 70_000, -70_000]] {
            let (upper, lower) = position_words(p);
            assert_eq!(position_from_words(upper, lower), p);
        }
    }

    #[test]
    fn ranks_order_nodes_by_level_and_then_by_name() {
        let deep = format!("r{}", "0".repeat(31));
        let names = ["r", "r0", "r3", "r7", "r00", "r04", "r40", "r777", &deep];
        let ranks = names.map(|n| breadth_first_rank(NodeKey::from_name(n).unwrap()));
        assert!(ranks.is_sorted_by(|a, b| a < b), "{ranks:x?}");
    }
}
