//! Which stored coordinates are in the box of a node, exactly: limits are found once, points are compared as integers.

use pointmill_format::{Aabb, Lattice, NodeKey};

use crate::octree::expect::Geometry;

/// The box of a node on the lattice of the file.
#[derive(Debug, Clone)]
pub(super) struct Limits {
    pub(super) node: Aabb,
    /// First and last coordinate of each axis.
    axes: [(i64, i64); 3],
}

/// How many points are outside of a box.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Outside {
    /// By a step, on each axis, at most.
    pub(super) near: u64,
    /// By more.
    pub(super) far: u64,
    /// The first of them.
    pub(super) first: Option<[i32; 3]>,
}

impl Limits {
    /// The closed box, with 4 ulps of the largest coordinate on the axis.
    pub(super) fn new(key: NodeKey, geometry: &Geometry, lattice: &Lattice) -> Self {
        let node = geometry.node_box(key);
        let axes = [0, 1, 2].map(|axis| {
            let tolerance = tolerance(axis, geometry, lattice);
            let Lattice { scale, offset } = lattice;
            let world = |q: i64| q as f64 * scale[axis] + offset[axis];
            let steps = |bound: f64| (bound - offset[axis]) / scale[axis];
            let (least, most) = (node.min[axis] - tolerance, node.max[axis] + tolerance);
            let (low, high) = (steps(least).floor() as i64, steps(most).ceil() as i64);
            // the quotients are rounded, so their neighbours are tried too
            let first = (-2..=2).map(|d| low.saturating_add(d)).find(|q| world(*q) >= least);
            let last = (-2..=2).map(|d| high.saturating_sub(d)).find(|q| world(*q) <= most);
            (first.unwrap_or(low), last.unwrap_or(high))
        });
        Self { node, axes }
    }

    /// Counts points that are not in the box.
    pub(super) fn outside(&self, [xs, ys, zs]: [&[i32]; 3]) -> Outside {
        let mut outside = Outside::default();
        let beyond = |axis: usize, v: i32| {
            let ((first, last), v) = (self.axes[axis], i64::from(v));
            (first.saturating_sub(v)).max(v.saturating_sub(last)).max(0)
        };
        for ((x, y), z) in xs.iter().zip(ys).zip(zs) {
            let most = beyond(0, *x).max(beyond(1, *y)).max(beyond(2, *z));
            if most > 0 {
                outside.first.get_or_insert([*x, *y, *z]);
                *(if most == 1 { &mut outside.near } else { &mut outside.far }) += 1;
            }
        }
        outside
    }
}

/// What rounding may add to a coordinate: the cube may be nearer to 0 than the offset that coordinates are counted from.
pub(super) fn tolerance(axis: usize, geometry: &Geometry, lattice: &Lattice) -> f64 {
    let offset = lattice.offset[axis].abs();
    geometry.tolerance(axis).max(4.0 * (offset.next_up() - offset))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_the_plane_are_in_both_halves_and_those_a_step_beyond_are_near() {
        let lattice = Lattice { scale: [0.01; 3], offset: [637_937.71, 0.0, -3.0] };
        let cube = Aabb { min: [637_937.71, 0.0, -3.0], max: [637_947.95, 10.24, 7.24] };
        let geometry = Geometry { lattice, cube, spacing: 0.08, rounding: 0.01 };
        let limits = Limits::new("r4".parse().unwrap(), &geometry, &lattice);
        assert_eq!(limits.axes, [(512, 1024), (0, 512), (0, 512)]);
        let low = Limits::new("r0".parse().unwrap(), &geometry, &lattice);
        assert_eq!(low.axes[0], (0, 512));
        let of = |xs: &[i32]| limits.outside([xs, &vec![5; xs.len()], &vec![5; xs.len()]]);
        assert_eq!(of(&[512, 1024, 700]), Outside::default());
        assert_eq!(of(&[511, 1025, 510, 1030, -9]), Outside { near: 2, far: 3, first: Some([511, 5, 5]) });
    }
}
