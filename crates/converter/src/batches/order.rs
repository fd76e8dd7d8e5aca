//! The order of the format: Morton code, position, colour, extra attributes.

use std::cmp::Ordering;

use super::content::Extra;
use super::frame::Frame;
use crate::build::sort::radix_sort;
use crate::records::position;

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
    keys: Vec<u64>,
    swap: Vec<u64>,
    index_mask: u64,
}

impl Order {
    /// Sorts the records of a task whose codes are not below `first_code`.
    pub(super) fn sort(&mut self, loaded: &Loaded<'_>, frame: &Frame, extras: &[Extra], first_code: u128) {
        let count = loaded.words.len();
        let index_bits = usize::BITS - count.saturating_sub(1).leading_zeros();
        let room = u64::BITS - index_bits;
        self.index_mask = (1 << index_bits) - 1;
        let positions = loaded.records.chunks_exact(loaded.stride).map(position);
        self.keys.clear();
        self.keys.reserve_exact(count);
        let idle = 3 * frame.idle_bits();
        let bits;
        if frame.is_wide() {
            let codes = positions.map(|p| frame.code(frame.morton(p)).wrapping_sub(first_code));
            let greatest = codes.clone().max().unwrap_or(0);
            let code_bits = u128::BITS - greatest.leading_zeros();
            let shift = code_bits.saturating_sub(room).max(idle);
            bits = code_bits.saturating_sub(shift);
            self.keys.extend(codes.enumerate().map(|(i, code)| ((code >> shift) as u64) << index_bits | i as u64));
        } else {
            let first_code = first_code as u64;
            let mut seen = 0;
            self.keys.extend(positions.map(|p| {
                let code = frame.narrow_code(p).wrapping_sub(first_code);
                seen |= code;
                code
            }));
            let code_bits = u64::BITS - seen.leading_zeros();
            let shift = code_bits.saturating_sub(room).max(idle);
            bits = code_bits.saturating_sub(shift);
            for (i, key) in self.keys.iter_mut().enumerate() {
                *key = (*key >> shift) << index_bits | i as u64;
            }
        }
        if bits > 0 {
            radix_sort(&mut self.keys, &mut self.swap, index_bits, index_bits + bits);
        }
        settle_ties(&mut self.keys, index_bits, self.index_mask, |a, b| compare(loaded, frame, extras, a, b));
    }

    /// Indices of the loaded records, in order.
    #[inline]
    pub(super) fn indices(&self, range: std::ops::Range<usize>) -> impl ExactSizeIterator<Item = usize> + Clone {
        let mask = self.index_mask;
        self.keys[range].iter().map(move |key| (key & mask) as usize)
    }
}

/// Orders runs whose codes agree as far as the keys tell.
fn settle_ties(keys: &mut [u64], index_bits: u32, index_mask: u64, order: impl Fn(usize, usize) -> Ordering) {
    let mut start = 0;
    while start < keys.len() {
        let code = keys[start] >> index_bits;
        let mut end = start + 1;
        while end < keys.len() && keys[end] >> index_bits == code {
            end += 1;
        }
        if end - start > 1 {
            let index = |key: &u64| (key & index_mask) as usize;
            keys[start..end].sort_unstable_by(|a, b| order(index(a), index(b)));
        }
        start = end;
    }
}

fn compare(loaded: &Loaded<'_>, frame: &Frame, extras: &[Extra], a: usize, b: usize) -> Ordering {
    let (ra, rb) = (loaded.record(a), loaded.record(b));
    let (pa, pb) = (position(ra), position(rb));
    if pa != pb {
        // stored positions differ from X by a constant
        let code = |p| frame.code(frame.morton(p));
        return code(pa).cmp(&code(pb)).then(pa.cmp(&pb));
    }
    let bytes = || extras.iter().map(|e| ra[e.from..e.to].cmp(&rb[e.from..e.to])).find(|o| o.is_ne());
    loaded.words[a].cmp(&loaded.words[b]).then_with(|| bytes().unwrap_or(Ordering::Equal))
}
