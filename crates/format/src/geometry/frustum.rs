//! What a camera can see.

use super::Aabb;
use super::vectors::{cross, dot, unit};

/// What can be seen: inside where a·x + b·y + c·z + d ≥ 0 for every plane [a, b, c, d], world coordinates.
///
/// ```
/// use pointmill_format::{Aabb, Frustum};
///
/// // from the origin along y, z up, 90 degrees in both directions, from 1 to 100 units
/// let fov = 90f64.to_radians();
/// let frustum = Frustum::perspective([0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], fov, 1.0, [1.0, 100.0]);
/// assert!(frustum.contains([0.0, 10.0, 9.0]) && !frustum.contains([0.0, 10.0, 11.0]));
/// assert!(!frustum.may_see(&Aabb { min: [-1.0, -9.0, -1.0], max: [1.0, -5.0, 1.0] }), "behind the camera");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frustum {
    /// Normals point inwards; they need not have length 1.
    pub planes: [[f64; 4]; 6],
}

/// Directions are parallel below this square of the sine between them.
const PARALLEL: f64 = 1e-24;

impl Frustum {
    /// All planes: which of them a box may still be cut by.
    pub(crate) const ALL: u8 = 0b11_1111;

    /// The frustum of a perspective camera at `position`.
    ///
    /// `forward` and `up`: any length; where they are parallel, as straight down, up is chosen. `fov_v`: vertical field of view, radians, below π. `aspect`: width
    /// over height. `near`, `far`: distances along `forward`, world units.
    #[must_use]
    pub fn perspective(
        position: [f64; 3],
        forward: [f64; 3],
        up: [f64; 3],
        fov_v: f64,
        aspect: f64,
        [near, far]: [f64; 2],
    ) -> Self {
        let forward = unit(forward);
        let sideways = |up| cross(forward, unit(up));
        let right = match sideways(up) {
            across if dot(across, across) > PARALLEL => across,
            _ => {
                let least = (0..3).fold(0, |a, b| if forward[b].abs() < forward[a].abs() { b } else { a });
                sideways(std::array::from_fn(|a| if a == least { 1.0 } else { 0.0 }))
            }
        };
        let right = unit(right);
        let up = cross(right, forward);
        let slope = (fov_v / 2.0).tan();
        // A side plane holds the camera; its normal leans from the side towards the view.
        let side = |axis: [f64; 3], slope: f64| [0, 1, 2].map(|i| forward[i] * slope + axis[i]);
        let through = |normal: [f64; 3], ahead: f64| {
            let at = [0, 1, 2].map(|i| position[i] + forward[i] * ahead);
            [normal[0], normal[1], normal[2], -dot(normal, at)]
        };
        let back = |v: [f64; 3]| v.map(|c| -c);
        Self {
            planes: [
                through(side(right, slope * aspect), 0.0),
                through(side(back(right), slope * aspect), 0.0),
                through(side(up, slope), 0.0),
                through(side(back(up), slope), 0.0),
                through(forward, near),
                through(back(forward), far),
            ],
        }
    }

    /// True if the point is inside or on the border.
    #[must_use]
    pub fn contains(&self, p: [f64; 3]) -> bool {
        self.planes.iter().all(|plane| side_of(plane, p) >= 0.0)
    }

    /// False if some plane has the whole box outside. As usual a box near an edge may pass though it is out of sight.
    #[must_use]
    pub fn may_see(&self, bounds: &Aabb) -> bool {
        self.cut(bounds, Self::ALL).is_some()
    }

    /// Of the planes in the mask `planes`, those that cut the box; nothing if it is outside one of them.
    pub(crate) fn cut(&self, bounds: &Aabb, planes: u8) -> Option<u8> {
        let mut cutting = 0;
        for (i, plane) in self.planes.iter().enumerate().filter(|(i, _)| planes >> i & 1 == 1) {
            let corner =
                |far: bool| [0, 1, 2].map(|a| if (plane[a] >= 0.0) == far { bounds.max[a] } else { bounds.min[a] });
            if side_of(plane, corner(true)) < 0.0 {
                return None;
            }
            cutting |= u8::from(side_of(plane, corner(false)) < 0.0) << i;
        }
        Some(cutting)
    }
}

fn side_of(plane: &[f64; 4], p: [f64; 3]) -> f64 {
    plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] + plane[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_looks_straight_down_sees_what_is_below() {
        let up = [0.0, 0.0, 1.0];
        for (down, below) in [([0.0, 0.0, -3.0], -10.0), ([0.0, 0.0, 1.0], 10.0)] {
            let f = Frustum::perspective([5.0, 5.0, 0.0], down, up, 90f64.to_radians(), 1.0, [1.0, 50.0]);
            assert!(f.planes.iter().flatten().all(|v| v.is_finite()), "{f:?}");
            assert!(
                f.contains([5.0, 5.0, below]) && f.contains([14.0, 14.0, below]) && !f.contains([5.0, 5.0, -below])
            );
        }
    }

    #[test]
    fn a_camera_along_any_axis_whose_up_is_parallel_sees_ahead() {
        for axis in 0..3 {
            let ahead: [f64; 3] = std::array::from_fn(|a| if a == axis { 10.0 } else { 0.0 });
            let f = Frustum::perspective([0.0; 3], ahead, ahead, 90f64.to_radians(), 1.0, [1.0, 50.0]);
            let corner = |side: f64| std::array::from_fn(|a| if a == axis { 10.0 } else { side });
            assert!(f.contains(ahead) && f.contains(corner(9.9)) && f.contains(corner(-9.9)), "{f:?}");
            assert!(!f.contains(corner(10.1)) && !f.contains(corner(-10.1)), "{f:?}");
        }
    }

    #[test]
    fn a_perspective_camera_sees_ahead_and_not_aside() {
        let f = Frustum::perspective(
            [100.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [0.0, 0.0, 1.0],
            90f64.to_radians(),
            2.0,
            [1.0, 50.0],
        );
        for inside in
            [[100.0, 10.0, 0.0], [100.0, 10.0, 9.9], [100.0, 10.0, -9.9], [119.9, 10.0, 0.0], [80.1, 10.0, 0.0]]
        {
            assert!(f.contains(inside), "{inside:?}");
        }
        for outside in
            [[100.0, 0.5, 0.0], [100.0, 51.0, 0.0], [100.0, 10.0, 10.1], [120.1, 10.0, 0.0], [100.0, -10.0, 0.0]]
                .into_iter()
                .chain([[79.9, 10.0, 0.0], [100.0, 10.0, -10.1]])
        {
            assert!(!f.contains(outside), "{outside:?}");
        }
        let around = |p: [f64; 3]| Aabb { min: p.map(|v| v - 1.0), max: p.map(|v| v + 1.0) };
        assert!(f.may_see(&around([100.0, 10.0, 10.5])) && !f.may_see(&around([100.0, 10.0, 12.5])));
        assert_eq!(f.cut(&around([100.0, 20.0, 0.0]), Frustum::ALL), Some(0));
        assert_eq!(f.cut(&around([100.0, 50.0, 0.0]), Frustum::ALL), Some(0b10_0000));
        let at_near = Aabb { min: [99.5, 1.0, -0.5], max: [100.5, 3.0, 0.5] };
        assert_eq!(f.cut(&at_near, Frustum::ALL), Some(0), "a plane that a box touches does not cut it");
    }
}
