//! Boxes, spacing and order as the format defines them (`docs/formats/potree2.md`), computed here.
//!
//! The format crate knows how to do some of this too. It is repeated on purpose: a validator that borrows the
//! arithmetic of the program it checks agrees with its mistakes.

use std::cmp::Ordering;

use pointmill_format::{Aabb, Lattice, NodeKey};

/// The geometry in the metadata.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Geometry {
    pub(crate) lattice: Lattice,
    pub(crate) cube: Aabb,
    pub(crate) spacing: f64,
    /// What rounding may take off distances in datasets that do not state how they were sampled, world units.
    pub(crate) rounding: f64,
}

impl Geometry {
    /// World coordinate of a stored one, as renderers compute it.
    pub(crate) fn world(&self, axis: usize, stored: i64) -> f64 {
        stored as f64 * self.lattice.scale[axis] + self.lattice.offset[axis]
    }

    /// The coarsest step of the lattice, world units: the tolerance of distances.
    pub(crate) fn step(&self) -> f64 {
        self.lattice.scale.iter().copied().fold(0.0, f64::max)
    }

    /// What distances may lose because samplers of our own compare 31-bit fractions of the cube, rounded down: less than a
    /// unit on each axis.
    pub(crate) fn sampling_slack(&self) -> f64 {
        2.0 * (self.cube.max[0] - self.cube.min[0]) / 31f64.exp2()
    }

    /// Spacing of a level, world units.
    pub(crate) fn spacing_at(&self, level: u8) -> f64 {
        self.spacing / f64::from(level).exp2()
    }

    /// Cells a side of an inner node, at most one point each under grid and random sampling: as wide as the spacing.
    fn cells(&self) -> f64 {
        ((self.cube.max[0] - self.cube.min[0]) / self.spacing).round().max(1.0)
    }

    /// False for a spacing that no writer would choose (usual: side / 128): searches by cells of that size would look
    /// at everything or at nothing.
    pub(crate) fn spacing_is_sane(&self) -> bool {
        let cells = (self.cube.max[0] - self.cube.min[0]) / self.spacing;
        (8.0..65_536.0).contains(&cells)
    }

    /// False if the spacing of a level is lost in the rounding of doubles as large as the coordinates: what lies in a box, and
    /// how far from it, is not decided by them then.
    pub(crate) fn resolves(&self, level: u8) -> bool {
        (0..3).all(|axis| self.tolerance(axis) < self.spacing_at(level))
    }

    /// Rounding allowed when world coordinates are compared: 4 ulps of the cube's largest coordinate on that axis.
    ///
    /// A dequantised coordinate carries two roundings (product, sum), a box bound one per level in the worst case, of
    /// which only those of the last, smallest, halvings can fall below one ulp of the corner.
    pub(crate) fn tolerance(&self, axis: usize) -> f64 {
        let largest = self.cube.min[axis].abs().max(self.cube.max[axis].abs());
        4.0 * (largest.next_up() - largest)
    }

    /// The closed box of a node, by halving the cube.
    pub(crate) fn node_box(&self, key: NodeKey) -> Aabb {
        let Aabb { mut min, mut max } = self.cube;
        for up in (0..key.level).rev() {
            for (axis, cell) in [key.x, key.y, key.z].into_iter().enumerate() {
                let mid = min[axis] + (max[axis] - min[axis]) / 2.0;
                let bound = if cell >> up & 1 == 1 { &mut min } else { &mut max };
                bound[axis] = mid;
            }
        }
        Aabb { min, max }
    }

    /// The stored coordinates that lie in a node's box, within [`Self::tolerance`]: first and last per axis.
    pub(crate) fn node_limits(&self, key: NodeKey) -> [(i64, i64); 3] {
        let node = self.node_box(key);
        std::array::from_fn(|axis| {
            let tolerance = self.tolerance(axis);
            (self.first_at(axis, node.min[axis] - tolerance), self.last_at(axis, node.max[axis] + tolerance))
        })
    }

    /// The smallest stored coordinate whose world coordinate is at least `bound`.
    fn first_at(&self, axis: usize, bound: f64) -> i64 {
        let guess = ((bound - self.lattice.offset[axis]) / self.lattice.scale[axis]).floor() as i64;
        // the quotient is rounded, so its neighbours are tried too
        (-2..=2).map(|d| guess.saturating_add(d)).find(|q| self.world(axis, *q) >= bound).unwrap_or(guess)
    }

    /// The largest stored coordinate whose world coordinate is at most `bound`.
    fn last_at(&self, axis: usize, bound: f64) -> i64 {
        let guess = ((bound - self.lattice.offset[axis]) / self.lattice.scale[axis]).ceil() as i64;
        (-2..=2).map(|d| guess.saturating_sub(d)).find(|q| self.world(axis, *q) <= bound).unwrap_or(guess)
    }

    /// The stored coordinates within `reach` (world units) of a node's box: first and last per axis.
    pub(crate) fn around(&self, key: NodeKey, reach: f64) -> [(i64, i64); 3] {
        let node = self.node_box(key);
        std::array::from_fn(|axis| {
            (self.first_at(axis, node.min[axis] - reach), self.last_at(axis, node.max[axis] + reach))
        })
    }

    /// The cell of the node's grid that a stored position falls into, or `None` if it lies so close to the
    /// border of a cell that rounding decides (within one lattice step, unless the side of the cube is whole steps).
    pub(crate) fn sample_cell(&self, level: u8, node: &Aabb, stored: [i32; 3]) -> Option<u64> {
        let (mut cell, cells) = (0u64, self.cells());
        for (axis, stored) in stored.into_iter().enumerate() {
            let own = match self.whole_steps(axis) {
                Some((steps, own)) => {
                    let cells = cells as u128;
                    let fraction = (u128::from(stored.unsigned_abs()) * own * cells) << level;
                    (fraction / steps % cells) as u64
                }
                None => {
                    let side = (self.cube.max[axis] - self.cube.min[axis]) / f64::from(level).exp2() / cells;
                    let in_steps = side / self.lattice.scale[axis];
                    let origin = (node.min[axis] - self.lattice.offset[axis]) / self.lattice.scale[axis];
                    let u = (f64::from(stored) - origin) / in_steps;
                    if (u - u.round()).abs() * in_steps <= 1.0 {
                        return None;
                    }
                    u.floor().clamp(0.0, cells - 1.0) as u64
                }
            };
            cell = cell << 20 | own;
        }
        Some(cell)
    }

    /// The side of the cube in steps of the finest axis, and how many of these a step of `axis` is, if both are whole but
    /// for the rounding of the cube's corners.
    fn whole_steps(&self, axis: usize) -> Option<(u128, u128)> {
        let finest = self.lattice.scale.iter().copied().fold(f64::INFINITY, f64::min);
        let (side, own) = (self.cube.max[axis] - self.cube.min[axis], self.lattice.scale[axis] / finest);
        let steps = (side / finest).round();
        let is_whole = (side - steps * finest).abs() <= self.tolerance(axis).min(finest / 4.0);
        (is_whole && steps >= 1.0 && own.fract() == 0.0).then_some((steps as u128, own as u128))
    }
}

/// Compares Morton codes (bit k of x is bit 3k, of y 3k + 1, of z 3k + 2) without building them: the axis whose
/// coordinates differ in the highest bit decides, z before y before x.
///
/// Source: T. M. Chan, "A minimalist's implementation of an approximate nearest neighbor algorithm in fixed
/// dimensions", 2006.
pub(crate) fn morton_cmp(a: [i32; 3], b: [i32; 3]) -> Ordering {
    let difference = |axis: usize| (a[axis] ^ b[axis]) as u32;
    let higher = |x: u32, y: u32| x < y && x < (x ^ y);
    let mut decides = 2;
    for axis in [1, 0] {
        if higher(difference(decides), difference(axis)) {
            decides = axis;
        }
    }
    (a[decides] as u32).cmp(&(b[decides] as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geometry() -> Geometry {
        Geometry {
            lattice: Lattice { scale: [0.001; 3], offset: [4_428_000.125, -7.3, 0.0] },
            cube: Aabb { min: [4_428_000.125, -7.3, 0.0], max: [4_428_001.149, -6.276, 1.024] },
            spacing: 0.008,
            rounding: 0.001,
        }
    }

    #[test]
    fn limits_of_a_node_are_the_outermost_coordinates_inside_its_box() {
        let geometry = geometry();
        assert_eq!(geometry.node_limits(NodeKey::ROOT), [(0, 1024); 3]);
        let key = NodeKey::from_name("r41").unwrap();
        assert_eq!(geometry.node_limits(key), [(512, 768), (0, 256), (256, 512)]);
    }

    #[test]
    fn morton_order_without_codes_equals_the_order_of_codes() {
        fn code(p: [i32; 3]) -> u128 {
            (0..32).fold(0, |code, k| {
                (0..3).fold(code, |code, axis| code | u128::from(p[axis] as u32 >> k & 1) << (3 * k + axis))
            })
        }
        let values = [0, 1, 2, 3, 7, 8, 65_535, 65_536, 1 << 27, i32::MAX, -1];
        let n = values.len();
        let points: Vec<[i32; 3]> = (0..n.pow(3)).map(|i| [i, i / n, i / n / n].map(|i| values[i % n])).collect();
        for a in &points {
            for b in points.iter().step_by(7) {
                assert_eq!(morton_cmp(*a, *b), code(*a).cmp(&code(*b)), "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn spacings_below_the_rounding_of_the_coordinates_decide_nothing() {
        let geometry = geometry(); // spacing 8 mm, 4 ulps of 4.4 million are 3.7 nm
        assert!(geometry.resolves(0) && geometry.resolves(21) && !geometry.resolves(22));
    }

    #[test]
    fn sample_cells_of_whole_steps_are_exact() {
        let mut geometry = geometry(); // 8 steps a cell at the root
        let node = geometry.node_box(NodeKey::ROOT);
        assert_eq!(geometry.sample_cell(0, &node, [8, 7, 1023]), Some(1 << 40 | 127));
        let coarse = Geometry { spacing: 0.016, ..geometry };
        assert_eq!(coarse.sample_cell(0, &node, [16, 15, 1023]), Some(1 << 40 | 63));
        geometry.cube.max = geometry.cube.min.map(|v| v + 1.025);
        // 1,025 steps: cells begin at multiples of 8.0078 steps, and of 4.0039 a level below
        let cell = |level, x| geometry.sample_cell(level, &geometry.node_box(NodeKey::ROOT), [x, 0, 0]).unwrap() >> 40;
        assert_eq!([7, 8, 9, 1024].map(|x| cell(0, x)), [0, 0, 1, 127]);
        assert_eq!([4, 5, 512, 513].map(|x| cell(1, x)), [0, 1, 127, 0]);
        geometry.lattice.scale[0] = 0.004;
        let cell = |x| geometry.sample_cell(0, &geometry.node_box(NodeKey::ROOT), [x, 0, 0]).unwrap() >> 40;
        assert_eq!([2, 3, 256].map(cell), [0, 1, 127], "steps of 4 finest ones");
        geometry.lattice.scale[0] = 0.0013;
        assert_eq!(geometry.sample_cell(0, &node, [6, 0, 0]), None, "6 of 6.16 steps");
    }

    #[test]
    fn no_coordinate_is_near_a_border_of_a_cube_with_an_odd_number_of_steps() {
        let mut geometry = geometry();
        let steps = 1_000_001u64; // a kilometre of millimetres, 4,400 km away
        geometry.cube.max = geometry.cube.min.map(|v| v + steps as f64 * 0.001);
        for level in [1u8, 5, 12, 17] {
            let first = |cell: u64| (cell * steps).div_ceil(1 << level) as i64;
            for x in (0..1u64 << level).step_by(1 + (1 << level) / 4096) {
                let key = NodeKey { level, x: x as u32, y: 0, z: (1 << level) - 1 };
                let limits = geometry.node_limits(key);
                let exact = [x, 0, (1 << level) - 1].map(|cell| (first(cell), first(cell + 1) - 1));
                // outside of the cube there may be room for one more
                assert_eq!(limits[0].0.max(0), exact[0].0, "{key:?}");
                assert_eq!(limits[0].1.min(steps as i64 - 1), exact[0].1, "{key:?}");
                assert_eq!((limits[1].1, limits[2].0), (exact[1].1, exact[2].0), "{key:?}");
            }
        }
    }
}
