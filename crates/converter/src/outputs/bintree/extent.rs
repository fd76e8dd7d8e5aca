//! Where the points of a node are: what its split and its box are made from.

use super::item::Item;
use crate::runtime::{Vectors, vectorized};

/// Extremes and sums, in stored integers.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Extent {
    pub(super) min: [i32; 3],
    pub(super) max: [i32; 3],
    pub(super) sum: [i64; 3],
}

impl Extent {
    /// Of these points; of none, the minimum is above the maximum.
    pub(super) fn of(items: &[Item]) -> Self {
        extent(Vectors::best(), items)
    }
}

vectorized! {
    fn extent(items: &[Item]) -> Extent = extent_anyhow;
}

#[inline(always)]
fn extent_anyhow(items: &[Item]) -> Extent {
    let mut e = Extent { min: [i32::MAX; 3], max: [i32::MIN; 3], sum: [0; 3] };
    for item in items {
        for a in 0..3 {
            e.min[a] = e.min[a].min(item.q[a]);
            e.max[a] = e.max[a].max(item.q[a]);
            e.sum[a] += i64::from(item.q[a]);
        }
    }
    e
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::StoredPoint;

    #[test]
    fn each_set_of_instructions_finds_extremes_and_sums() {
        let mut random = pointmill_testkit::Random::new(2);
        for count in [0, 1, 3, 8, 1001] {
            let q = |random: &mut pointmill_testkit::Random| std::array::from_fn(|_| random.next_u32() as i32);
            let items: Vec<Item> =
                (0..count).map(|record| Item { q: StoredPoint(q(&mut random)), record: record ^ 0x5555 }).collect();
            let axis = |a: usize| items.iter().map(move |i| i.q[a]);
            let expected = Extent {
                min: std::array::from_fn(|a| axis(a).min().unwrap_or(i32::MAX)),
                max: std::array::from_fn(|a| axis(a).max().unwrap_or(i32::MIN)),
                sum: std::array::from_fn(|a| axis(a).map(i64::from).sum()),
            };
            for vectors in Vectors::all() {
                assert_eq!(extent(vectors, &items), expected, "{vectors:?}, {count} points");
            }
        }
        // sums of one sign do not fit 32 bits
        let low = vec![Item { q: StoredPoint([i32::MIN, -1, i32::MAX]), record: 0 }; 5];
        let sums = [5 * i64::from(i32::MIN), -5, 5 * i64::from(i32::MAX)];
        for vectors in Vectors::all() {
            assert_eq!(extent(vectors, &low).sum, sums, "{vectors:?}");
        }
    }
}
