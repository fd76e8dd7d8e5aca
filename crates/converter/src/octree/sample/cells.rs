//! One point for each occupied cell of the node's grid. In Morton order a cell is one run of candidates.

use pointmill_format::NodeKey;

use crate::cloud::TreePoint;

/// Candidates of a part of a node, and which of them may be taken.
pub(super) struct Candidates<'a> {
    pub(super) points: &'a [TreePoint],
    /// False: too near to what a neighbour has taken.
    pub(super) are_free: &'a [bool],
    /// Bits of a cell.
    pub(super) shift: u32,
}

/// Takes the point nearest to the centre of its cell; of equals the first.
pub(super) fn nearest_to_center(candidates: &Candidates<'_>, accepted: &mut [bool]) {
    let mask = (1u64 << candidates.shift) - 1;
    // Twice the distance, so that the centre of an even-sized cell is a whole number.
    let off_center =
        |t: &TreePoint| -> u64 { t.0.iter().map(|v| (2 * (u64::from(*v) & mask)).abs_diff(mask).pow(2)).sum() };
    candidates.take_least(off_center, accepted);
}

/// Takes a pseudo-random point of each cell: the smallest hash of seed, node and position; of equals the first.
pub(super) fn random(node: NodeKey, seed: u64, candidates: &Candidates<'_>, accepted: &mut [bool]) {
    let salt = mix(seed ^ mix(u64::from(node.level) + 1));
    let hash = |t: &TreePoint| mix(mix(salt ^ (u64::from(t[0]) << 32 | u64::from(t[1]))) ^ u64::from(t[2]));
    candidates.take_least(hash, accepted);
}

impl Candidates<'_> {
    /// Takes of each cell the free point of least `rank`.
    fn take_least(&self, rank: impl Fn(&TreePoint) -> u64, accepted: &mut [bool]) {
        let Self { points, are_free, shift } = self;
        let mut start = 0;
        while start < points.len() {
            let cell = points[start].cell(*shift);
            let len = points[start..].iter().take_while(|t| t.cell(*shift) == cell).count();
            let free = (start..start + len).filter(|i| are_free[*i]);
            if let Some(best) = free.min_by_key(|i| rank(&points[*i])) {
                accepted[best] = true;
            }
            start += len;
        }
    }
}

/// A bijective scrambler (the finaliser of SplitMix64).
fn mix(mut v: u64) -> u64 {
    v = (v ^ v >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    v = (v ^ v >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    v ^ v >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cell_gives_its_most_central_point_that_is_free() {
        // cells of 4 units
        let points = [[0, 0, 0], [1, 1, 1], [3, 0, 0], [4, 0, 0]].map(TreePoint);
        let mut accepted = [false; 4];
        nearest_to_center(&Candidates { points: &points, are_free: &[true; 4], shift: 2 }, &mut accepted);
        assert_eq!(accepted, [false, true, false, true]);
        accepted = [false; 4];
        let are_free = [true, false, true, false];
        nearest_to_center(&Candidates { points: &points, are_free: &are_free, shift: 2 }, &mut accepted);
        assert_eq!(accepted, [true, false, false, false]);
    }

    #[test]
    fn random_takes_one_per_cell_and_follows_the_seed() {
        let points: Vec<TreePoint> = (0..1000).map(|i| TreePoint([i, 0, 0])).collect();
        let candidates = Candidates { points: &points, are_free: &[true; 1000], shift: 4 };
        let take = |seed| {
            let mut accepted = vec![false; points.len()];
            random(NodeKey { level: 20, x: 0, y: 0, z: 0 }, seed, &candidates, &mut accepted);
            accepted
        };
        let a = take(1);
        assert!(a.chunks(16).all(|cell| cell.iter().filter(|b| **b).count() == 1));
        assert_eq!(a, take(1));
        assert_ne!(a, take(2));
    }

    #[test]
    fn hashes_are_the_published_ones() {
        // the first numbers of SplitMix64 from 0 (Steele, Lea and Flood 2014): the finalizer of multiples of its step
        let step = 0x9e37_79b9_7f4a_7c15u64;
        let expected = [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4, 0x06c4_5d18_8009_454f];
        assert_eq!([1, 2, 3].map(|n| mix(step.wrapping_mul(n))), expected);
    }

    #[test]
    fn the_most_central_of_three_axes_is_taken() {
        // cells of 8 units whose middle is at 3.5; the last two are as far from it, and the first of them wins
        let points = [[8, 0, 0], [15, 1, 3], [10, 2, 6], [13, 5, 1]].map(TreePoint);
        let mut accepted = [false; 4];
        nearest_to_center(&Candidates { points: &points, are_free: &[true; 4], shift: 3 }, &mut accepted);
        assert_eq!(accepted, [false, false, true, false]);
    }

    #[test]
    fn the_same_seed_and_level_take_the_same_points() {
        // eight cells of 16 points; worked out by another program from the definition: the least of
        // mix(mix(salt ^ (x << 32 | y)) ^ z) with salt = mix(seed ^ mix(level + 1))
        let points: Vec<TreePoint> = (0..128).map(|i| TreePoint([i, i * 7 % 16, i * 5 % 16])).collect();
        let candidates = Candidates { points: &points, are_free: &[true; 128], shift: 4 };
        let take = |seed, level| {
            let mut accepted = vec![false; points.len()];
            random(NodeKey { level, x: 0, y: 0, z: 0 }, seed, &candidates, &mut accepted);
            let taken: Vec<usize> = accepted.iter().enumerate().filter(|(_, a)| **a).map(|(i, _)| i % 16).collect();
            taken
        };
        assert_eq!(take(1, 20), [3, 13, 13, 2, 4, 9, 3, 15]);
        assert_eq!(take(1, 3), [15, 15, 4, 12, 3, 6, 13, 9]);
        assert_eq!(take((1 << 63) + 5, 20), [4, 11, 8, 15, 8, 12, 11, 8]);
    }
}
