//! The order of points in a leaf: Morton order relative to the leaf's least integers.

use std::cmp::Ordering;

use super::item::Item;
use crate::cloud::{MortonSorter, morton};
use crate::runtime::{Vectors, vectorized};

/// Puts indices of `items` into Morton order, all bits of the coordinates; points of one place by `tails`, which compares
/// the bytes of their records behind the position.
pub(super) fn order(
    items: &[Item],
    min: [i32; 3],
    max: [i32; 3],
    sorter: &mut MortonSorter,
    out: &mut Vec<u32>,
    tails: impl Fn(&Item, &Item) -> Ordering,
) {
    let extent = (0..3).map(|a| max[a].abs_diff(min[a])).max().unwrap_or(0);
    let width = u32::BITS - extent.leading_zeros();
    let levels = (MortonSorter::room(items.len()) / 3).min(width).min(21);
    let shift = width - levels;
    let relative = |item: &Item| -> [u32; 3] { std::array::from_fn(|a| item.q[a].abs_diff(min[a])) };
    put_codes(Vectors::best(), items, min, shift, sorter.codes(items.len()));
    sorter.sort(3 * levels, 0, |a, b| {
        let (a, b) = (&items[a], &items[b]);
        morton::compare(relative(a), relative(b)).then_with(|| tails(a, b))
    });
    out.clear();
    out.extend(sorter.indices(0..sorter.len()).map(|i| i as u32));
}

vectorized! {
    fn put_codes(items: &[Item], min: [i32; 3], shift: u32, codes: &mut Vec<u64>) = put_codes_anyhow;
}

#[inline(always)]
fn put_codes_anyhow(items: &[Item], min: [i32; 3], shift: u32, codes: &mut Vec<u64>) {
    codes.resize(items.len(), 0);
    for (code, item) in codes.iter_mut().zip(items) {
        *code = morton::interleave(std::array::from_fn(|a| item.q[a].abs_diff(min[a]) >> shift));
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;
    use crate::cloud::StoredPoint;

    fn sorted(items: &[Item]) -> Vec<u32> {
        let ends = |f: fn(i32, i32) -> i32| [0, 1, 2].map(|a| items.iter().map(|i| i.q[a]).reduce(f).unwrap());
        let mut out = Vec::new();
        let tails = |a: &Item, b: &Item| (a.record % 5).cmp(&(b.record % 5));
        order(items, ends(i32::min), ends(i32::max), &mut MortonSorter::default(), &mut out, tails);
        out
    }

    #[test]
    fn all_bits_count_however_wide_the_leaf_and_ties_go_by_bytes() {
        let mut random = Random::new(3);
        for spread in [0, 3, 12, 31] {
            let mut items = Vec::new();
            for record in 0..4000 {
                let q = StoredPoint(std::array::from_fn(|_| random.next_u32() as i32 >> (31 - spread).min(31)));
                items.push(Item { q, record });
            }
            let min: [i32; 3] = std::array::from_fn(|a| items.iter().map(|i| i.q[a]).min().unwrap());
            let out = sorted(&items);
            let mut seen = out.clone();
            seen.sort_unstable();
            assert_eq!(seen, (0..4000).collect::<Vec<u32>>());
            for pair in out.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|i| &items[i as usize]);
                let at = |i: &Item| -> [u32; 3] { std::array::from_fn(|k| i.q[k].abs_diff(min[k])) };
                let order = morton::compare(at(a), at(b)).then((a.record % 5).cmp(&(b.record % 5)));
                assert_ne!(order, Ordering::Greater);
            }
        }
    }
    #[test]
    fn each_set_of_instructions_makes_the_same_codes() {
        let mut random = Random::new(8);
        for (count, shift) in [(0, 0), (1, 0), (9, 11), (130, 3), (130, 11)] {
            let q = |random: &mut Random| StoredPoint(std::array::from_fn(|_| random.next_u32() as i32));
            let items: Vec<Item> = (0..count).map(|record| Item { q: q(&mut random), record }).collect();
            let min: [i32; 3] = std::array::from_fn(|a| items.iter().map(|i| i.q[a]).min().unwrap_or(0));
            // bit k of x is bit 3k + 2, of y 3k + 1, of z 3k; 21 bits of each
            let code = |item: &Item| -> u64 {
                let c: [u64; 3] = std::array::from_fn(|a| (i64::from(item.q[a]) - i64::from(min[a])) as u64 >> shift);
                (0..21).map(|k| (0..3).map(|a| (c[a] >> k & 1) << (3 * k + 2 - a)).sum::<u64>()).sum()
            };
            let expected: Vec<u64> = items.iter().map(code).collect();
            for vectors in Vectors::all() {
                let mut codes = Vec::new();
                put_codes(vectors, &items, min, shift, &mut codes);
                assert_eq!(codes, expected, "{vectors:?}");
            }
        }
    }
}
