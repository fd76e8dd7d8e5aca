//! One point for each occupied cell of the node's 128³ grid. In Morton order a cell is one run of candidates.

use pointmill_format::NodeKey;

use super::spacing::cell_shift;
use crate::cloud::TreePoint;

/// Takes the point nearest to the centre of its cell; of equals the first.
pub(super) fn nearest_to_center(level: u8, candidates: &[TreePoint], accepted: &mut [bool]) {
    let shift = cell_shift(level);
    let mask = (1u64 << shift) - 1;
    // Twice the distance, so that the centre of an even-sized cell is a whole number.
    let off_center =
        |t: &TreePoint| -> u64 { t.0.iter().map(|v| (2 * (u64::from(*v) & mask)).abs_diff(mask).pow(2)).sum() };
    for_each_cell(shift, candidates, |run, start| {
        let best = (0..run.len()).min_by_key(|&i| off_center(&run[i])).unwrap_or(0);
        accepted[start + best] = true;
    });
}

/// Takes a pseudo-random point of each cell: the smallest hash of seed, node and position; of equals the first.
pub(super) fn random(node: NodeKey, seed: u64, candidates: &[TreePoint], accepted: &mut [bool]) {
    let salt = mix(seed ^ mix(u64::from(node.level) + 1));
    for_each_cell(cell_shift(node.level), candidates, |run, start| {
        let hash = |t: &TreePoint| mix(mix(salt ^ (u64::from(t[0]) << 32 | u64::from(t[1]))) ^ u64::from(t[2]));
        let best = (0..run.len()).min_by_key(|&i| hash(&run[i])).unwrap_or(0);
        accepted[start + best] = true;
    });
}

fn for_each_cell(shift: u32, candidates: &[TreePoint], mut visit: impl FnMut(&[TreePoint], usize)) {
    let mut start = 0;
    while start < candidates.len() {
        let cell = candidates[start].cell(shift);
        let len = candidates[start..].iter().take_while(|t| t.cell(shift) == cell).count();
        visit(&candidates[start..start + len], start);
        start += len;
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
    fn each_cell_gives_its_most_central_point() {
        // Level 23: cells are 2 units wide; level 22: 4 units.
        let candidates = [[0, 0, 0], [1, 1, 1], [3, 0, 0], [4, 0, 0]].map(TreePoint);
        let mut accepted = [false; 4];
        nearest_to_center(22, &candidates, &mut accepted);
        assert_eq!(accepted, [false, true, false, true]);
    }

    #[test]
    fn random_takes_one_per_cell_and_follows_the_seed() {
        let candidates: Vec<TreePoint> = (0..1000).map(|i| TreePoint([i, 0, 0])).collect();
        let take = |seed| {
            let mut accepted = vec![false; candidates.len()];
            random(NodeKey { level: 20, x: 0, y: 0, z: 0 }, seed, &candidates, &mut accepted);
            accepted
        };
        let a = take(1);
        assert!(a.chunks(16).all(|cell| cell.iter().filter(|b| **b).count() == 1));
        assert_eq!(a, take(1));
        assert_ne!(a, take(2));
    }
}
