//! Morton order of the points of a chunk, by radix sort of (path, index) packed into one word.

use std::cmp::Ordering;

use crate::grid::TREE_BITS;
use crate::morton;
use crate::records::RecordFrame;

/// A point of a chunk: where it is, and which record is its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Point {
    /// Tree coordinates.
    pub(crate) t: [u32; 3],
    /// Index of the record in the chunk.
    pub(crate) record: u32,
}

/// Memory that is reused from chunk to chunk.
#[derive(Debug, Default)]
pub(crate) struct SortScratch {
    trees: Vec<[u32; 3]>,
    keys: Vec<u64>,
    swap: Vec<u64>,
}

const DIGIT_BITS: u32 = 11;

/// Sorts the records of a chunk below a node of `level` into `out`: Morton order, and records that share a place by
/// their bytes, so that the order depends on the points alone.
pub(crate) fn sort(records: &[u8], frame: &RecordFrame, level: u8, scratch: &mut SortScratch, out: &mut Vec<Point>) {
    let stride = frame.stride;
    let count = records.len() / stride;
    scratch.trees.clear();
    scratch.trees.extend(records.chunks_exact(stride).map(|r| frame.tree(r)));
    let index_bits = usize::BITS - count.saturating_sub(1).leading_zeros();
    let level = u32::from(level);
    let levels = ((u64::BITS - index_bits) / 3).min(frame.cube.resolved_level().saturating_sub(level)).min(21);
    let shift = TREE_BITS - level - levels;
    scratch.keys.clear();
    scratch.keys.extend(scratch.trees.iter().enumerate().map(|(i, t)| {
        let path = morton::interleave(t.map(|t| (t >> shift) & ((1 << levels) - 1)));
        path << index_bits | i as u64
    }));
    radix_sort(&mut scratch.keys, &mut scratch.swap, index_bits, index_bits + 3 * levels);
    let index_mask = (1u64 << index_bits) - 1;
    out.clear();
    out.extend(scratch.keys.iter().map(|key| {
        let record = (key & index_mask) as u32;
        Point { t: scratch.trees[record as usize], record }
    }));
    settle_ties(&scratch.keys, index_bits, out, records, stride);
}

/// Orders runs whose paths agree as far as the keys tell.
fn settle_ties(keys: &[u64], index_bits: u32, points: &mut [Point], records: &[u8], stride: usize) {
    let bytes = |p: &Point| &records[p.record as usize * stride..][..stride];
    let order = |a: &Point, b: &Point| match morton::compare(a.t, b.t) {
        Ordering::Equal => bytes(a).cmp(bytes(b)),
        other => other,
    };
    let mut start = 0;
    while start < keys.len() {
        let path = keys[start] >> index_bits;
        let mut end = start + 1;
        while end < keys.len() && keys[end] >> index_bits == path {
            end += 1;
        }
        if end - start > 1 {
            points[start..end].sort_unstable_by(order);
        }
        start = end;
    }
}

/// Least-significant-digit radix sort of the bits `from..to`; what is below `from` is in order already.
pub(crate) fn radix_sort(keys: &mut Vec<u64>, swap: &mut Vec<u64>, from: u32, to: u32) {
    if keys.len() < 512 {
        keys.sort_unstable();
        return;
    }
    let passes = (to - from).div_ceil(DIGIT_BITS);
    let digit_bits = (to - from).div_ceil(passes.max(1)).max(1);
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
    use super::*;
    use crate::grid::{Cube, LatticeBounds};
    use pointmill_format::Lattice;

    #[test]
    fn every_point_once_in_path_order_and_ties_by_bytes() {
        let bounds = LatticeBounds { min: [0; 3], max: [100_000; 3] };
        let cube = Cube::around(&bounds, &Lattice { scale: [0.01; 3], offset: [0.0; 3] }).unwrap();
        let frame = RecordFrame { stride: 14, cube, base: [0; 3] };
        let mut records = Vec::new();
        let mut state = 7u64;
        for i in 0..5000u32 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let q = [(state >> 50) as i32, (state >> 40) as i32 & 0xff, i as i32 % 3];
            records.extend(q.iter().flat_map(|v| v.to_le_bytes()));
            records.extend((i as u16 % 50).to_le_bytes());
        }
        let mut out = Vec::new();
        sort(&records, &frame, 0, &mut SortScratch::default(), &mut out);
        let mut seen: Vec<u32> = out.iter().map(|p| p.record).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..5000).collect::<Vec<u32>>());
        let bytes = |p: &Point| &records[p.record as usize * 14..][..14];
        for pair in out.windows(2) {
            let order = morton::compare(pair[0].t, pair[1].t).then_with(|| bytes(&pair[0]).cmp(bytes(&pair[1])));
            assert_ne!(order, Ordering::Greater);
        }
    }
}
