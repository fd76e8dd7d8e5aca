//! What Potree 2.0 interleaves. In payloads x owns bit 0; in the names of nodes z does.

use crate::geometry::morton::{deinterleave16, morton21};

/// The position as Potree's BROTLI encoding keeps it: the (upper, lower) words, Morton codes of bits 16–31 and 0–15.
pub(super) fn position_words(p: [i32; 3]) -> (u64, u64) {
    let p = p.map(|v| v as u32);
    (morton21(p.map(|v| v >> 16)), morton21(p.map(|v| v & 0xffff)))
}

/// Undoes [`position_words`].
pub(super) fn position_from_words(upper: u64, lower: u64) -> [i32; 3] {
    let (upper, lower) = (deinterleave16(upper), deinterleave16(lower));
    std::array::from_fn(|a| (u32::from(upper[a]) << 16 | u32::from(lower[a])) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_examples_of_the_format_page_hold() {
        assert_eq!(position_words([1, 2, 3]), (0, 0x35));
        assert_eq!(position_words([123_456, 654_321, 42]), (0x403, 0x6da4_1a4f_2822));
        assert_eq!(morton21([65_535, 256, 1]), 0x2492_4b24_924d);
    }

    #[test]
    fn positions_come_back_whatever_their_sign() {
        for p in [[0, 0, 0], [-1, i32::MIN, i32::MAX], [1 << 27, 0, 0], [-5, 70_000, -70_000]] {
            let (upper, lower) = position_words(p);
            assert_eq!(position_from_words(upper, lower), p);
        }
    }
}
