//! What a renderer decides at a node: where it is seen from, and how its points are drawn.

use crate::Aabb;

/// The distance at which points change from discs to single pixels: D_T = S / tan(F_V / W).
///
/// `point_radius` S: world units, > 0. `fov_v` F_V: vertical field of view, radians. `height` W: vertical resolution,
/// pixels. Source: section 8.1 of `docs/formats/bintree.md`, after Santana et al. 2019.
pub fn switch_distance(point_radius: f64, fov_v: f64, height: f64) -> f64 {
    point_radius / (fov_v / height).tan()
}

/// D_min and D_max: from `camera` to the nearest point of the box (0 inside) and to its farthest corner, world units.
pub fn distance_range(bounds: &Aabb, camera: [f64; 3]) -> [f64; 2] {
    let axis = |a: usize| (camera[a] - bounds.min[a], bounds.max[a] - camera[a]);
    let gap = [0, 1, 2].map(|a| (-axis(a).0).max(-axis(a).1).max(0.0));
    let reach = [0, 1, 2].map(|a| axis(a).0.abs().max(axis(a).1.abs()));
    [gap, reach].map(|v| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt())
}

/// How the points of a node are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Material {
    /// One pixel per point.
    Far,
    /// A disc of the point's radius.
    Near,
    /// Both: two passes, each drops the points of the other side of the switch distance.
    Both,
}

impl Material {
    /// The choice for a box that lies between `d_min` and `d_max` from the camera ([`distance_range`]), if points change
    /// at `switch_distance`.
    #[must_use]
    pub fn choose([d_min, d_max]: [f64; 2], switch_distance: f64) -> Self {
        if d_min > switch_distance {
            Self::Far
        } else if d_max < switch_distance {
            Self::Near
        } else {
            Self::Both
        }
    }
}

/// What can be seen: inside where a·x + b·y + c·z + d ≥ 0 for every plane [a, b, c, d], world coordinates.
///
/// ```
/// use pointmill_format::{Aabb, bintree::Frustum};
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
    pub(super) const ALL: u8 = 0b11_1111;

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
    pub(super) fn cut(&self, bounds: &Aabb, planes: u8) -> Option<u8> {
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

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|c| c / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of section 8.1.
    #[test]
    fn a_disc_of_5_cm_becomes_a_pixel_at_51_57_m() {
        let d = switch_distance(0.05, 60f64.to_radians(), 1080.0);
        assert!((d - 51.566).abs() < 1e-3, "{d}");
    }

    #[test]
    fn distances_are_0_inside_and_reach_the_farthest_corner() {
        let b = Aabb { min: [0.0, 0.0, 0.0], max: [3.0, 4.0, 0.0] };
        assert_eq!(distance_range(&b, [0.0, 0.0, 0.0]), [0.0, 5.0]);
        assert_eq!(distance_range(&b, [1.0, 4.0, 0.0]), [0.0, (4.0f64 + 16.0).sqrt()]);
        assert_eq!(distance_range(&b, [6.0, 8.0, 0.0]), [5.0, 10.0]);
        assert_eq!(distance_range(&b, [3.0, 0.0, -12.0]), [12.0, 13.0]);
    }

    #[test]
    fn the_switch_distance_itself_is_drawn_with_both() {
        let choose = |range| Material::choose(range, 10.0);
        assert_eq!([[10.1, 20.0], [1.0, 9.9]].map(choose), [Material::Far, Material::Near]);
        assert_eq!([[10.0, 20.0], [1.0, 10.0], [0.0, 30.0]].map(choose), [Material::Both; 3]);
    }

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
        {
            assert!(!f.contains(outside), "{outside:?}");
        }
        let around = |p: [f64; 3]| Aabb { min: p.map(|v| v - 1.0), max: p.map(|v| v + 1.0) };
        assert!(f.may_see(&around([100.0, 10.0, 10.5])) && !f.may_see(&around([100.0, 10.0, 12.5])));
        assert_eq!(f.cut(&around([100.0, 20.0, 0.0]), Frustum::ALL), Some(0));
        assert_eq!(f.cut(&around([100.0, 50.0, 0.0]), Frustum::ALL), Some(0b10_0000));
    }
}
