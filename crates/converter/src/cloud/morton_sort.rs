//! Sorting by Morton codes: a radix sort of (code, index) packed into one word; what the words do not distinguish is
//! settled by a comparison, so that the order depends on the points alone.

use std::cmp::Ordering;
use std::ops::Range;

/// Sorts indices by codes; keeps its memory from one sort to the next.
#[derive(Debug, Default)]
pub(crate) struct MortonSorter {
    keys: Vec<u64>,
    swap: Vec<u64>,
    index_bits: u32,
}

const DIGIT_BITS: u32 = 10;

impl MortonSorter {
    /// Bits of a code that fit beside the index of one of `count` points.
    pub(crate) fn room(count: usize) -> u32 {
        u64::BITS - index_bits(count)
    }

    /// Starts a sort of `count` points; the caller puts the code of each, in order of index, into the vector.
    pub(crate) fn codes(&mut self, count: usize) -> &mut Vec<u64> {
        self.index_bits = index_bits(count);
        self.keys.clear();
        self.keys.reserve_exact(count);
        &mut self.keys
    }

    /// Sorts by the codes, which are below `2^code_bits`. The lowest `idle_bits` need not be looked at. Points whose
    /// codes agree in all bits that the words hold are put in order by `compare`, which takes two indices.
    pub(crate) fn sort(&mut self, code_bits: u32, idle_bits: u32, compare: impl Fn(usize, usize) -> Ordering) {
        let index_bits = self.index_bits;
        let shift = code_bits.saturating_sub(u64::BITS - index_bits).max(idle_bits);
        let bits = code_bits.saturating_sub(shift);
        if bits == 0 {
            self.keys.iter_mut().zip(0u64..).for_each(|(key, i)| *key = i);
        } else {
            self.keys.iter_mut().zip(0u64..).for_each(|(key, i)| *key = (*key >> shift) << index_bits | i);
            radix_sort(&mut self.keys, &mut self.swap, index_bits, index_bits + bits);
        }
        self.settle_ties(bits, compare);
    }

    /// Indices of the points, in order.
    #[inline]
    pub(crate) fn indices(&self, range: Range<usize>) -> impl ExactSizeIterator<Item = usize> + Clone {
        let mask = index_mask(self.index_bits);
        self.keys[range].iter().map(move |key| (key & mask) as usize)
    }

    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.keys.len()
    }

    fn settle_ties(&mut self, bits: u32, compare: impl Fn(usize, usize) -> Ordering) {
        let (index_bits, mask) = (self.index_bits, index_mask(self.index_bits));
        let code = |key: u64| if bits == 0 { 0 } else { key >> index_bits };
        let keys = &mut self.keys[..];
        let mut start = 0;
        while start < keys.len() {
            let first = code(keys[start]);
            let mut end = start + 1;
            while end < keys.len() && code(keys[end]) == first {
                end += 1;
            }
            if end - start > 1 {
                let index = |key: &u64| (key & mask) as usize;
                keys[start..end].sort_unstable_by(|a, b| compare(index(a), index(b)));
            }
            start = end;
        }
    }
}

fn index_bits(count: usize) -> u32 {
    usize::BITS - count.saturating_sub(1).leading_zeros()
}

fn index_mask(index_bits: u32) -> u64 {
    if index_bits < u64::BITS { (1 << index_bits) - 1 } else { u64::MAX }
}

/// Sorts by the bits from `from` to `to`; what is below `from` is in order already, and no two keys are the same.
///
/// A radix sort, least significant digit first, of the upper bits: as many as tell the points of a surface from one
/// another. The few whose upper bits agree lie side by side then, and are sorted in place.
fn radix_sort(keys: &mut Vec<u64>, swap: &mut Vec<u64>, from: u32, to: u32) {
    if keys.len() < 512 {
        keys.sort_unstable();
        return;
    }
    let telling = keys.len().ilog2() * 3 / 2;
    let passes = telling.min(to - from).div_ceil(DIGIT_BITS).max(1);
    let start = from.max(to.saturating_sub(passes * DIGIT_BITS));
    radix_sort_upper(keys, swap, start, to, passes);
    if start > from {
        for run in keys.chunk_by_mut(|a, b| a >> start == b >> start).filter(|run| run.len() > 1) {
            run.sort_unstable();
        }
    }
}

/// Sorts by the bits from `from` to `to`, in so many passes; keys that agree in them stay in order.
fn radix_sort_upper(keys: &mut Vec<u64>, swap: &mut Vec<u64>, from: u32, to: u32, passes: u32) {
    let digit_bits = (to - from).div_ceil(passes).max(1);
    let mask = (1u64 << digit_bits) - 1;
    let buckets = 1usize << digit_bits;
    let mut counts = vec![0u32; buckets * passes as usize];
    for &key in keys.iter() {
        for pass in 0..passes {
            let digit = (key >> (from + pass * digit_bits)) & mask;
            counts[pass as usize * buckets + digit as usize] += 1;
        }
    }
    swap.clear();
    swap.resize(keys.len(), 0);
    for (pass, counts) in counts.chunks_exact_mut(buckets).enumerate() {
        let shift = from + pass as u32 * digit_bits;
        if counts.iter().any(|c| *c as usize == keys.len()) {
            continue; // one value only
        }
        let mut start = 0;
        for count in counts.iter_mut() {
            let size = *count;
            *count = start;
            start += size;
        }
        for &key in keys.iter() {
            let at = &mut counts[((key >> shift) & mask) as usize];
            swap[*at as usize] = key;
            *at += 1;
        }
        std::mem::swap(keys, swap);
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn random() -> impl FnMut() -> u64 {
        let mut random = Random::new(7);
        move || random.next_u64() >> 1
    }

    #[test]
    fn every_point_once_in_order_of_code_and_ties_by_comparison() {
        let mut next = random();
        let mut sorter = MortonSorter::default();
        for (count, bits) in
            [(0, 63), (1, 63), (5, 63), (5000, 63), (5000, 40), (5000, 20), (5000, 3), (5000, 0), (40_000, 48)]
        {
            let codes: Vec<u64> = (0..count).map(|_| if bits == 0 { 0 } else { next() >> (64 - bits) }).collect();
            let tie = |i: usize| (codes[i], i % 7, i);
            sorter.codes(codes.len()).extend(&codes);
            sorter.sort(bits, 0, |a, b| tie(a).cmp(&tie(b)));
            let found: Vec<usize> = sorter.indices(0..sorter.len()).collect();
            let mut expected: Vec<usize> = (0..codes.len()).collect();
            expected.sort_by_key(|i| tie(*i));
            assert_eq!(found, expected, "{count} codes of {bits} bits");
        }
    }

    #[test]
    fn idle_bits_are_left_to_the_comparison() {
        let codes = [0b1011u64, 0b1001, 0b0111, 0b1010];
        let mut sorter = MortonSorter::default();
        sorter.codes(codes.len()).extend(codes);
        sorter.sort(4, 2, |a, b| codes[b].cmp(&codes[a]));
        assert_eq!(sorter.indices(0..4).collect::<Vec<_>>(), [2, 0, 3, 1], "descending within the idle bits");
    }
}
