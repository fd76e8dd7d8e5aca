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
}
