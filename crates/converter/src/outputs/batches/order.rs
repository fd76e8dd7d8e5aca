//! The order of the format: Morton code, position, colour, extra attributes.

use std::cmp::Ordering;
use std::ops::Range;

use super::content::Extra;
use super::frame::Frame;
use crate::cloud::{MortonSorter, position};

/// Records of a task and their colour words, as they were loaded.
#[derive(Clone, Copy)]
pub(super) struct Loaded<'a> {
    pub(super) records: &'a [u8],
    pub(super) stride: usize,
    pub(super) words: &'a [u32],
}

impl Loaded<'_> {
    #[inline]
    pub(super) fn record(&self, i: usize) -> &[u8] {
        &self.records[i * self.stride..][..self.stride]
    }
}

/// Memory that is reused from task to task.
#[derive(Debug, Default)]
pub(super) struct Order {
    sorter: MortonSorter,
}

impl Order {
    /// Sorts the records of a task whose codes are not below `first_code`.
    pub(super) fn sort(&mut self, loaded: &Loaded<'_>, frame: &Frame, extras: &[Extra], first_code: u128) {
        let count = loaded.words.len();
        let positions = loaded.records.chunks_exact(loaded.stride).map(position);
        let row = |i: usize| (loaded.record(i), loaded.words[i]);
        let compare = |a: usize, b: usize| compare(frame, extras, row(a), row(b));
        let idle_bits = 3 * frame.idle_bits();
        let keys = self.sorter.codes(count);
        if frame.is_wide() {
            let codes = positions.map(|p| frame.code(frame.morton(p)).wrapping_sub(first_code));
            let greatest = codes.clone().max().unwrap_or(0);
            let code_bits = u128::BITS - greatest.leading_zeros();
            // the highest bits that a word holds; the comparison settles the rest
            let dropped = code_bits.saturating_sub(MortonSorter::room(count)).max(idle_bits);
            keys.extend(codes.map(|code| (code >> dropped) as u64));
            self.sorter.sort(code_bits.saturating_sub(dropped), 0, compare);
        } else {
            let first_code = first_code as u64;
            let mut seen = 0;
            keys.extend(positions.map(|p| {
                let code = frame.narrow_code(p).wrapping_sub(first_code);
                seen |= code;
                code
            }));
            self.sorter.sort(u64::BITS - seen.leading_zeros(), idle_bits, compare);
        }
    }

    /// Indices of the loaded records, in order.
    #[inline]
    pub(super) fn indices(&self, range: Range<usize>) -> impl ExactSizeIterator<Item = usize> + Clone {
        self.sorter.indices(range)
    }
}

/// Compares two records with their colour words.
pub(super) fn compare(
    frame: &Frame,
    extras: &[Extra],
    (ra, word_a): (&[u8], u32),
    (rb, word_b): (&[u8], u32),
) -> Ordering {
    let (pa, pb) = (position(ra), position(rb));
    if pa != pb {
        // stored positions differ from X by a constant
        let code = |p| frame.code(frame.morton(p));
        return code(pa).cmp(&code(pb)).then(pa.cmp(&pb));
    }
    let bytes = || extras.iter().map(|e| ra[e.from..e.to].cmp(&rb[e.from..e.to])).find(|o| o.is_ne());
    word_a.cmp(&word_b).then_with(|| bytes().unwrap_or(Ordering::Equal))
}
