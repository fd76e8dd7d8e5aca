//! The points of a part of the cloud in Morton order.

use super::cube::TREE_BITS;
use super::frames::TreePoint;
use super::morton;
use super::morton_sort::MortonSorter;
use super::record::RecordFrame;
use crate::runtime::{Vectors, vectorized};

/// A point of a part: where it is, and which record it has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Point {
    pub(crate) t: TreePoint,
    /// Index of the record in the part.
    pub(crate) record: u32,
}

/// Memory that is reused from part to part.
#[derive(Debug, Default)]
pub(crate) struct OrderScratch {
    vectors: Vectors,
    trees: Vec<TreePoint>,
    sorter: MortonSorter,
}

/// Sorts records below a node of `level` into `out`: Morton order, and records that share a place by
/// their bytes, so that the order depends on the points alone.
pub(crate) fn order(records: &[u8], frame: &RecordFrame, level: u8, scratch: &mut OrderScratch, out: &mut Vec<Point>) {
    let stride = frame.stride;
    let OrderScratch { vectors, trees, sorter } = scratch;
    put_trees(*vectors, records, frame, trees);
    let level = u32::from(level);
    let room = MortonSorter::room(trees.len());
    let levels = (room / 3).min(frame.cube.resolved_level().saturating_sub(level)).min(21);
    let shift = TREE_BITS - level - levels;
    put_codes(*vectors, trees, shift, levels, sorter.codes(trees.len()));
    let bytes = |i: usize| &records[i * stride..][..stride];
    sorter.sort(3 * levels, 0, |a, b| morton::compare(trees[a].0, trees[b].0).then_with(|| bytes(a).cmp(bytes(b))));
    out.clear();
    out.extend(sorter.indices(0..sorter.len()).map(|i| Point { t: trees[i], record: i as u32 }));
}

vectorized! {
    fn put_trees(records: &[u8], frame: &RecordFrame, trees: &mut Vec<TreePoint>) = put_trees_anyhow;
}

#[inline(always)]
fn put_trees_anyhow(records: &[u8], frame: &RecordFrame, trees: &mut Vec<TreePoint>) {
    trees.resize(records.len() / frame.stride, TreePoint([0; 3]));
    trees.iter_mut().zip(records.chunks_exact(frame.stride)).for_each(|(tree, record)| *tree = frame.tree(record));
}

vectorized! {
    fn put_codes(trees: &[TreePoint], shift: u32, levels: u32, codes: &mut Vec<u64>) = put_codes_anyhow;
}

#[inline(always)]
fn put_codes_anyhow(trees: &[TreePoint], shift: u32, levels: u32, codes: &mut Vec<u64>) {
    codes.resize(trees.len(), 0);
    codes.iter_mut().zip(trees).for_each(|(code, tree)| *code = morton::path(*tree, shift, levels));
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;
    use crate::cloud::{Cube, JobBounds, JobPoint, StoredOrigin};
    use pointmill_format::Lattice;
    use std::cmp::Ordering;

    #[test]
    fn every_point_once_in_path_order_and_ties_by_bytes() {
        let bounds = JobBounds::new([0; 3], [100_000; 3]);
        let cube = Cube::around(&bounds, &Lattice { scale: [0.01; 3], offset: [0.0; 3] }).unwrap();
        let frame = RecordFrame { stride: 14, cube, origin: StoredOrigin(JobPoint([0; 3])) };
        let mut records = Vec::new();
        let mut random = Random::new(7);
        for i in 0..5000u32 {
            let q = [random.below(1 << 14) as i32, random.below(256) as i32, i as i32 % 3];
            records.extend(q.iter().flat_map(|v| v.to_le_bytes()));
            records.extend((i as u16 % 50).to_le_bytes());
        }
        let mut out = Vec::new();
        for vectors in Vectors::all() {
            let others = std::mem::take(&mut out);
            order(&records, &frame, 0, &mut OrderScratch { vectors, ..OrderScratch::default() }, &mut out);
            assert!(others.is_empty() || others == out, "{vectors:?}");
        }
        let mut seen: Vec<u32> = out.iter().map(|p| p.record).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..5000).collect::<Vec<u32>>());
        let bytes = |p: &Point| &records[p.record as usize * 14..][..14];
        for pair in out.windows(2) {
            let order = morton::compare(pair[0].t.0, pair[1].t.0).then_with(|| bytes(&pair[0]).cmp(bytes(&pair[1])));
            assert_ne!(order, Ordering::Greater);
        }
    }
}
