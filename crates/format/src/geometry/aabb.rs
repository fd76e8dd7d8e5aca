//! Axis-aligned boxes in world coordinates.

use super::NodeKey;

/// An axis-aligned box, world coordinates, closed: `min ≤ p ≤ max`.
///
/// ```
/// use pointmill_format::Aabb;
///
/// let mut bounds = Aabb::EMPTY;
/// bounds.grow([1.0, 2.0, 3.0]);
/// bounds.grow([3.0, 2.0, 4.0]);
/// assert_eq!((bounds.extent(), bounds.center()), ([2.0, 0.0, 1.0], [2.0, 2.0, 3.5]));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Aabb {
    /// Lower corner: x, y, z.
    pub min: [f64; 3],
    /// Upper corner: x, y, z.
    pub max: [f64; 3],
}

impl Aabb {
    /// The box that contains nothing; growing it by a point gives that point.
    pub const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    /// True while no point was added (or a side is inverted or not a number).
    pub fn is_empty(&self) -> bool {
        !(0..3).all(|a| self.min[a] <= self.max[a])
    }

    /// Enlarges the box so that it contains `p`.
    pub fn grow(&mut self, p: [f64; 3]) {
        for (a, &v) in p.iter().enumerate() {
            self.min[a] = self.min[a].min(v);
            self.max[a] = self.max[a].max(v);
        }
    }

    /// The smallest box that contains both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        for a in 0..3 {
            out.min[a] = out.min[a].min(other.min[a]);
            out.max[a] = out.max[a].max(other.max[a]);
        }
        out
    }

    /// True if `p` lies inside or on the border.
    #[must_use]
    pub fn contains(&self, p: [f64; 3]) -> bool {
        (0..3).all(|a| self.min[a] <= p[a] && p[a] <= self.max[a])
    }

    /// Side lengths: x, y, z.
    #[must_use]
    pub fn extent(&self) -> [f64; 3] {
        std::array::from_fn(|a| self.max[a] - self.min[a])
    }

    /// The box of a node, if this is the root's: halved [`NodeKey::level`] times, as viewers do it.
    #[must_use]
    pub fn octant(&self, key: NodeKey) -> Self {
        let mut node = *self;
        for level in (0..key.level).rev() {
            for (axis, cell) in [key.x, key.y, key.z].into_iter().enumerate() {
                let mid = node.min[axis] + (node.max[axis] - node.min[axis]) / 2.0;
                if cell.checked_shr(level.into()).unwrap_or(0) & 1 == 1 {
                    node.min[axis] = mid;
                } else {
                    node.max[axis] = mid;
                }
            }
        }
        node
    }

    /// The midpoint.
    #[must_use]
    pub fn center(&self) -> [f64; 3] {
        std::array::from_fn(|a| self.min[a] + 0.5 * (self.max[a] - self.min[a]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grows_from_nothing_to_a_point_to_a_box() {
        let mut b = Aabb::EMPTY;
        assert!(b.is_empty());
        b.grow([1.0, 2.0, 3.0]);
        assert_eq!(b.extent(), [0.0; 3]);
        b.grow([-1.0, 4.0, 3.0]);
        assert_eq!(b, Aabb { min: [-1.0, 2.0, 3.0], max: [1.0, 4.0, 3.0] });
        assert!(b.contains([1.0, 4.0, 3.0]) && !b.contains([1.0, 4.1, 3.0]));
    }

    #[test]
    fn planes_between_octants_are_exact_far_from_0() {
        // single precision has whole halves there
        let root = Aabb { min: [5_400_000.0625; 3], max: [5_400_001.0625; 3] };
        let node = root.octant(NodeKey { level: 2, x: 1, y: 2, z: 3 });
        let at = |quarters: [f64; 3]| quarters.map(|q| root.min[0] + q / 4.0);
        assert_eq!((node.min, node.max), (at([1.0, 2.0, 3.0]), at([2.0, 3.0, 4.0])));
        assert_eq!(root.octant(NodeKey::ROOT), root);
        let oblong = Aabb { min: [5_400_000.0625, -1.0, 2.0], max: [5_400_003.0625, 3.0, 2.0] };
        assert_eq!((oblong.center(), oblong.extent()), ([5_400_001.5625, 1.0, 2.0], [3.0, 4.0, 0.0]));
    }

    #[test]
    fn a_union_holds_both_and_any_inverted_side_is_empty() {
        let (a, b) = (Aabb { min: [0.0; 3], max: [1.0; 3] }, Aabb { min: [-1.0, 0.5, 2.0], max: [0.5, 3.0, 4.0] });
        let both = Aabb { min: [-1.0, 0.0, 0.0], max: [1.0, 3.0, 4.0] };
        assert_eq!((a.union(&b), b.union(&a), a.union(&Aabb::EMPTY)), (both, both, a));
        for axis in 0..3 {
            let mut inverted = a;
            inverted.min[axis] = 1.5;
            assert!(inverted.is_empty() && !a.is_empty());
            inverted.min[axis] = f64::NAN;
            assert!(inverted.is_empty());
        }
    }
}
