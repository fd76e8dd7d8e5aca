//! Positions of all nodes on one lattice. Each node counts from its own corner.

use pointmill_format::{Aabb, Lattice, NodeKey, NodePoints, Positions};
use serde_json::Value;

use crate::accuracy::Deviation;
use crate::octree::expect::Geometry;

/// The lattice of the run in terms of the cube, where its integers come back exactly: the cube is `side` steps wide, and a step
/// is 2^`bits` stored ones.
#[derive(Debug, Clone, Copy)]
struct Exact {
    side: u64,
    bits: u32,
}

impl Exact {
    fn new(side: f64, step: f64, scale: f64) -> Option<Self> {
        let (side, ratio) = (side / step, step / scale);
        let is_in_range = |v: f64| (1.0..=2f64.powi(31)).contains(&v);
        let is_whole = (side - side.round()).abs() <= 1e-6 && is_in_range(side.round());
        // halving is exact, and the 2^31st part of a side of nearly 2^31 steps is nearly a step
        let is_power = is_in_range(ratio) && ratio.fract() == 0.0 && (ratio as u64).is_power_of_two();
        (is_whole && is_power).then(|| Self { side: side.round() as u64, bits: (ratio as u64).ilog2() })
    }

    /// Steps from the cube's lower corner: the nearest to the place in cell `cell` of a level, the upper one of two.
    fn steps(&self, level: u8, cell: u32, stored: i32) -> i64 {
        let shift = u32::from(level) + self.bits;
        let corner = (u128::from(cell) * u128::from(self.side)) << self.bits;
        let place = corner + (u128::from(stored.unsigned_abs()) << level);
        (((place << 1) + (1 << shift)) >> (shift + 1)) as i64
    }
}

/// What makes steps from the cube's lower corner of the positions in a node.
#[derive(Debug, Clone)]
pub(crate) struct Steps {
    /// One for all nodes; 0 is the cube's lower corner.
    pub(crate) lattice: Lattice,
    /// The lattice of the run, and the steps from its 0 to the cube's corner, if the dataset states it.
    run: Option<(Lattice, [i64; 3])>,
    exact: [Option<Exact>; 3],
    cube: Aabb,
}

impl Steps {
    /// `scale`: of stored positions; `None` if they are not relative to nodes. `own`: pointmill's own key of `cloud.js`.
    pub(crate) fn new(cube: Aabb, scale: Option<f64>, coarse: f64, own: &Value) -> Self {
        let vector = |value: &Value| -> Option<[f64; 3]> {
            value.as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<_>>>()?.try_into().ok()
        };
        let stated = vector(&own["lattice"]["scale"]).zip(vector(&own["lattice"]["offset"]));
        let stated = stated.map(|(scale, offset)| Lattice { scale, offset }).filter(Lattice::is_valid);
        let steps = stated.map_or([coarse; 3], |run| run.scale);
        let side = cube.max[0] - cube.min[0];
        Self {
            lattice: Lattice { scale: steps, offset: cube.min },
            run: stated
                .map(|run| (run, [0, 1, 2].map(|a| ((cube.min[a] - run.offset[a]) / run.scale[a]).round() as i64))),
            exact: steps.map(|step| scale.filter(|_| stated.is_some()).and_then(|scale| Exact::new(side, step, scale))),
            cube,
        }
    }

    /// True if the dataset states the lattice of the run.
    pub(crate) fn is_stated(&self) -> bool {
        self.run.is_some()
    }

    /// Positions of a node's points, axis by axis. `geometry`: of the dataset.
    pub(crate) fn axis(&self, key: NodeKey, points: &NodePoints, axis: usize) -> Vec<i64> {
        let nearest = |world: f64| ((world - self.cube.min[axis]) / self.lattice.scale[axis]).round() as i64;
        match (points.positions(), self.exact[axis]) {
            (Positions::Quantized(stored), Some(exact)) => {
                let cell = [key.x, key.y, key.z][axis];
                stored[axis].iter().map(|v| exact.steps(key.level, cell, *v)).collect()
            }
            (Positions::Quantized(stored), None) => {
                let Lattice { scale, offset } = points.lattice();
                stored[axis].iter().map(|v| nearest(f64::from(*v) * scale[axis] + offset[axis])).collect()
            }
            (Positions::World(world), _) => world[axis].iter().map(|v| nearest(*v)).collect(),
        }
    }

    /// How far decoded positions are from the points of the run's lattice; nothing if that is not stated.
    pub(crate) fn deviation(&self, key: NodeKey, points: &NodePoints) -> Deviation {
        let mut deviation = Deviation::default();
        let Some((run, shift)) = &self.run else { return deviation };
        let [xs, ys, zs] = [0, 1, 2].map(|axis| self.axis(key, points, axis));
        let corner = points.lattice().offset;
        for (i, ((x, y), z)) in xs.into_iter().zip(ys).zip(zs).enumerate() {
            let Some(decoded) = points.world(i) else { break };
            let steps = [x, y, z];
            let meant = run.world([0, 1, 2].map(|a| steps[a].saturating_add(shift[a])));
            // near 0 a coordinate is as exact as the offset that it is counted from
            let size = [0, 1, 2].map(|a| meant[a].abs().max(corner[a].abs()).max(run.offset[a].abs()));
            deviation.add([0, 1, 2].map(|a| decoded[a] - meant[a]), size);
        }
        deviation
    }

    /// The geometry of the dataset on this lattice. Two points that a writer truncated to steps, and that are rounded here, may
    /// be two steps nearer on each axis.
    pub(crate) fn geometry(&self, spacing: f64) -> Geometry {
        let rounding = 2.0 * self.lattice.scale.iter().map(|s| s * s).sum::<f64>().sqrt();
        Geometry { lattice: self.lattice, cube: self.cube, spacing, rounding }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_come_back_from_any_node_whatever_its_corner_is() {
        // 1,001 steps of 0.01, each of 4 stored ones: corners of level 5 are at multiples of 31.28 steps
        let exact = Exact::new(10.01, 0.01, 0.0025).unwrap();
        assert_eq!((exact.side, exact.bits), (1001, 2));
        for level in 0..12u8 {
            for k in 0..1001u64 {
                let cell = (k << level) / 1001;
                // the nearest stored coordinate, the lower one of two: ceil(u - 1/2)
                let units = u128::from(k) << (2 + level);
                let u = units - u128::from(cell) * (1001 << 2);
                let stored = (u << 1).saturating_sub(1 << level).div_ceil(2 << level);
                assert_eq!(exact.steps(level, cell as u32, stored as i32), k as i64, "level {level}");
            }
        }
    }

    #[test]
    fn what_is_no_power_of_two_is_not_exact() {
        assert!(Exact::new(10.01, 0.01, 0.003).is_none() && Exact::new(10.013, 0.01, 0.01).is_none());
        assert!(Exact::new(10.01, 0.01, 0.01).is_some_and(|exact| exact.bits == 0));
        // 2^31 - 1 steps of 0.001, divided into 2^31 parts: a whole step off at the far end
        let (side, parts) = (2_147_483.647, 2f64.powi(31));
        assert!(Exact::new(side, 0.001, (side / parts).next_up()).is_none());
    }
}
