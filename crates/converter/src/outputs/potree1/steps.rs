//! The integers that positions become: steps of one length from the lower corner of the box of their node.

use pointmill_format::{Lattice, NodeKey};

use crate::cloud::{Cube, RecordFrame, StoredOrigin, TREE_BITS, position};

/// Clients read integers as signed ones of 32 bits: there are no more steps along the side of the cube.
const MOST_BITS: u32 = TREE_BITS;

/// The length of a step, and the way from stored coordinates to steps.
#[derive(Debug, Clone)]
pub(super) struct Steps {
    /// World units.
    pub(super) scale: f64,
    cube: Cube,
    origin: StoredOrigin,
    /// Bytes of a stored record.
    stored_stride: usize,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// A step is that of the finest axis, halved so many times.
    Halved {
        halvings: u32,
        /// Of the cube, in steps.
        side: u64,
        /// By axis: a stored integer is so many steps, as a power of two.
        powers: [u32; 3],
        /// Added to a stored coordinate it counts from the corner of the cube, modulo 2^32.
        shift: [u32; 3],
    },
    /// A step is the 2^31st part of the side.
    Parts,
}

/// The way to steps in one node.
#[derive(Debug, Clone, Copy)]
pub(super) struct NodeSteps<'a> {
    steps: &'a Steps,
    /// The corner of the node: steps from that of the cube, modulo 2^32.
    corner: [u32; 3],
}

impl Steps {
    /// Where one step of the lattice gives all axes whole numbers, it is halved as often as the tree can have levels and as
    /// 31 bits allow: corners of nodes down to that level are whole steps too. In other lattices, and in cubes so large that
    /// not even one halving fits, the corners of all nodes are whole steps, and positions are rounded to less than half
    /// of the lattice's.
    pub(super) fn new(frame: &RecordFrame, lattice: &Lattice) -> Self {
        let (cube, origin) = (frame.cube, frame.origin);
        // a hair longer: the side has fewer than 2^31 steps
        let parts = || ((cube.side / 2f64.powi(MOST_BITS as i32)).next_up(), Kind::Parts);
        let (scale, kind) = match cube.whole_steps() {
            None => parts(),
            Some((side, powers)) => {
                let bits = u64::BITS - side.leading_zeros();
                match MOST_BITS.saturating_sub(bits).min(bits) {
                    0 => parts(),
                    halvings => {
                        let finest = lattice.scale.into_iter().fold(f64::INFINITY, f64::min);
                        let shift = std::array::from_fn(|a| (origin.0[a] - cube.min[a]) as u32);
                        let powers = powers.map(|power| power + halvings);
                        let kind = Kind::Halved { halvings, side: side << halvings, powers, shift };
                        (finest / 2f64.powi(halvings as i32), kind)
                    }
                }
            }
        };
        Self { scale, cube, origin, stored_stride: frame.stride, kind }
    }

    /// An axis with a step shorter than that of the dataset, which would put points together, and that step.
    pub(super) fn finer_axis(&self, lattice: &Lattice) -> Option<(usize, f64)> {
        lattice.scale.into_iter().enumerate().find(|(_, step)| *step < self.scale)
    }

    /// The deepest level all of whose corners are whole steps of exact positions; `None`: positions are rounded in any node.
    pub(super) fn exact_level(&self) -> Option<u32> {
        match self.kind {
            Kind::Halved { halvings, .. } => Some(halvings),
            Kind::Parts => None,
        }
    }

    /// True if doubles hold all corners of nodes down to `depth` and all positions of an axis exactly: `scale` is that of the
    /// lattice there, `ends` are the corners of the cube and the 0 of the lattice.
    pub(super) fn is_exact_in_doubles(&self, scale: f64, ends: [f64; 3], depth: u32) -> bool {
        let Kind::Halved { halvings, .. } = self.kind else { return false };
        let is_power = scale.to_bits() << 12 == 0;
        let unit = self.scale / 2f64.powi(depth.saturating_sub(halvings) as i32);
        let is_whole = |v: f64| (v / unit).fract() == 0.0 && (v / unit).abs() < 2f64.powi(52);
        is_power && ends.into_iter().all(is_whole)
    }

    /// For the points of a node.
    pub(super) fn of(&self, key: NodeKey) -> NodeSteps<'_> {
        let (level, cells) = (u32::from(key.level), [key.x, key.y, key.z].map(u64::from));
        let corner = match self.kind {
            Kind::Halved { side, .. } => {
                // The upper one of two: no coordinate less the corner is below 0.
                let nearest = |cell: u64| ((u128::from(cell) * u128::from(side) + half_of(level)) >> level) as u32;
                cells.map(nearest)
            }
            Kind::Parts => cells.map(|cell| (cell << (TREE_BITS - level)) as u32),
        };
        NodeSteps { steps: self, corner }
    }
}

/// Half of `2^power`, for rounding by a shift.
const fn half_of(power: u32) -> u128 {
    (1 << power) >> 1
}

impl NodeSteps<'_> {
    /// What all positions of the node are off by because its corner is no whole step, world units, decoded less meant.
    pub(super) fn moved_by(&self, key: NodeKey) -> [f64; 3] {
        let Kind::Halved { side, .. } = self.steps.kind else { return [0.0; 3] };
        let level = u32::from(key.level);
        [key.x, key.y, key.z].map(|cell| {
            // decoded positions count from the true corner, stored ones from the rounded one
            let product = u128::from(cell) * u128::from(side);
            let rounded = (product + half_of(level)) >> level << level;
            let parts = product as i128 - rounded as i128;
            parts as f64 / 2f64.powi(level as i32) * self.steps.scale
        })
    }

    /// Puts the positions of `records`, stored back to back, to the front of `stride` bytes each.
    pub(super) fn put(&self, records: &[u8], out: &mut [u8], stride: usize) {
        let Steps { cube, origin, kind, .. } = self.steps;
        let corner = self.corner;
        let pairs = records.chunks_exact(self.steps.stored_stride).zip(out.chunks_exact_mut(stride));
        match *kind {
            Kind::Halved { powers, shift, .. } => {
                for (record, out) in pairs {
                    let from = position(record).0;
                    for a in 0..3 {
                        let steps = from[a].cast_unsigned().wrapping_add(shift[a]) << powers[a];
                        out[4 * a..4 * a + 4].copy_from_slice(&steps.wrapping_sub(corner[a]).to_le_bytes());
                    }
                }
            }
            Kind::Parts => {
                for (record, out) in pairs {
                    let nearest = cube.nearest_tree(origin.job(position(record)));
                    for a in 0..3 {
                        let steps = (nearest[a] as u32).wrapping_sub(corner[a]);
                        out[4 * a..4 * a + 4].copy_from_slice(&steps.to_le_bytes());
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;
    use crate::cloud::{JobBounds, JobPoint};

    /// Points within `extent` steps, the corners among them, and what they are measured with.
    fn cloud(scale: [f64; 3], extent: [u32; 3]) -> (RecordFrame, Lattice, Vec<u8>) {
        let (lattice, min) = (Lattice { scale, offset: [0.0; 3] }, [1 << 20, -7, 0]);
        let max = std::array::from_fn(|a| min[a] + i64::from(extent[a]));
        let cube = Cube::around(&JobBounds::new(min, max), &lattice).unwrap();
        let frame = RecordFrame { stride: 12, cube, origin: StoredOrigin(JobPoint(min)) };
        let mut random = Random::new(3);
        let mut records: Vec<u8> = [[0; 3], extent].iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        for _ in 0..500 {
            records.extend(extent.iter().flat_map(|e| (random.below(u64::from(*e) + 1) as i32).to_le_bytes()));
        }
        (frame, lattice, records)
    }

    /// The node of each point at that level, its integers, and by how many of its lattice's steps they are off.
    fn places(frame: &RecordFrame, lattice: &Lattice, steps: &Steps, level: u8, record: &[u8]) -> ([u32; 3], [f64; 3]) {
        let q = frame.origin.job(position(record));
        let t = frame.cube.tree(q).cell(TREE_BITS - u32::from(level));
        let key = NodeKey { level, x: t[0], y: t[1], z: t[2] };
        let mut out = [0; 13];
        steps.of(key).put(record, &mut out, 13);
        assert_eq!(out[12], 0, "bytes of others");
        let stored: Vec<u32> = out.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        let of_side = frame.cube.side / f64::from(level).exp2();
        let error = std::array::from_fn(|a| {
            assert!(f64::from(stored[a]) * steps.scale <= of_side + steps.scale, "level {level}: beyond the node");
            let corner = of_side * f64::from(t[a]);
            let meant = (q[a] - frame.cube.min[a]) as f64 * lattice.scale[a];
            (corner + f64::from(stored[a]) * steps.scale - meant) / lattice.scale[a]
        });
        (std::array::from_fn(|a| stored[a]), error)
    }

    #[test]
    fn positions_are_exact_down_to_the_level_and_at_most_a_quarter_off_below() {
        for (extent, level) in [(200, 8), (5_000, 13), (100_000, 14), (1 << 27, 3), ((1 << 30) - 3, 1)] {
            let (frame, lattice, records) = cloud([0.001; 3], [extent, extent / 3, 9]);
            let steps = Steps::new(&frame, &lattice);
            assert_eq!(steps.exact_level(), Some(level));
            assert!(frame.cube.side / steps.scale < 2f64.powi(31) && steps.scale < 0.001);
            for record in records.chunks_exact(12) {
                for at in [0, 1, 2, 5, 8, 11, 17, 31] {
                    let (_, error) = places(&frame, &lattice, &steps, at, record);
                    let most = if u32::from(at) <= level { 1e-6 } else { 0.250_001 };
                    assert!(error.iter().all(|e| e.abs() <= most), "{extent} at level {at}: {error:?}");
                }
            }
        }
    }

    #[test]
    fn what_a_node_is_off_by_is_known() {
        let (frame, lattice, records) = cloud([0.001; 3], [1 << 29; 3]);
        let steps = Steps::new(&frame, &lattice);
        for record in records.chunks_exact(12) {
            for level in [0, 1, 2, 7] {
                let q = frame.origin.job(position(record));
                let [x, y, z] = frame.cube.tree(q).cell(TREE_BITS - u32::from(level));
                let by = steps.of(NodeKey { level, x, y, z }).moved_by(NodeKey { level, x, y, z });
                let (_, error) = places(&frame, &lattice, &steps, level, record);
                assert!((0..3).all(|a| (by[a] / 0.001 - error[a]).abs() < 1e-4), "{by:?} {error:?}");
            }
        }
    }

    #[test]
    fn one_step_serves_axes_that_are_a_power_of_two_apart() {
        let (frame, lattice, records) = cloud([0.002, 0.001, 0.004], [3_000, 5_000, 70]);
        let steps = Steps::new(&frame, &lattice);
        assert_eq!(steps.scale, 0.001 / 2f64.powi(13));
        for record in records.chunks_exact(12) {
            let (_, error) = places(&frame, &lattice, &steps, 6, record);
            assert!(error.iter().all(|e| e.abs() < 1e-6), "{error:?}");
        }
    }

    #[test]
    fn other_axes_and_cubes_without_room_for_a_halving_get_parts_of_the_side() {
        for (scale, extent) in [
            ([0.001, 0.003, 0.000_7], [40_000, 9_000, 500]),
            ([0.001; 3], [1 << 30, 77, 1 << 29]),
            ([1e-7; 3], [2_147_483_645, 5, 6]),
        ] {
            let (frame, lattice, records) = cloud(scale, extent);
            let steps = Steps::new(&frame, &lattice);
            assert_eq!(steps.exact_level(), None);
            let along = frame.cube.side / steps.scale;
            assert!(along < 2f64.powi(31) && along > 2f64.powi(31) - 1e-3);
            for record in records.chunks_exact(12) {
                for level in [0, 1, 9, 31] {
                    let (stored, error) = places(&frame, &lattice, &steps, level, record);
                    assert!(stored.iter().all(|v| *v < 1 << 31));
                    let most = |a: usize| 0.5001 * steps.scale / scale[a] + 1e-5;
                    assert!((0..3).all(|a| error[a].abs() <= most(a)), "{extent:?} at level {level}: {error:?}");
                }
            }
        }
    }
}
