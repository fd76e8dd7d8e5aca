//! What a neighbourhood says of the surface through a point.

use super::eigen::smallest;
use super::space::Space;
use super::sums::Sums;

/// A neighbourhood whose middle eigenvalue is at most this part of the largest lies on a line.
const LINE: f64 = 1e-10;

/// Points that a disk of the radius holds, at the density of the neighbourhood.
const POINTS_IN_DISK: f64 = 4.0;

/// The surface through a point; zeros where there is none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Surface {
    /// Of length 1, with either sign.
    pub(super) normal: [f32; 3],
    /// Of the squared deviations from the mean, the part along the normal: 0 to 1/3.
    pub(super) curvature: f32,
    /// World units.
    pub(super) radius: f32,
}

impl Surface {
    /// Of a neighbourhood that reaches so far, world units.
    #[inline]
    pub(super) fn of(sums: &Sums, reach: f64, space: &Space) -> Self {
        if sums.is_one_place() {
            return Self::default();
        }
        let radius = (reach * (POINTS_IN_DISK / sums.count as f64).sqrt().min(1.0)) as f32;
        let covariance = sums.covariance(space.ratio);
        // of a size that no sum of squares overflows
        let size = covariance[0] + covariance[3] + covariance[5];
        if size.is_nan() || size <= 0.0 {
            return Self { radius, ..Self::default() }; // steps of one axis vanish beside those of another
        }
        let found = smallest(&covariance.map(|v| v / size));
        let [least, middle, largest] = found.values;
        if sums.count < 3 || middle <= LINE * largest {
            return Self { radius, ..Self::default() };
        }
        let curvature = (least.max(0.0) / (least.max(0.0) + middle + largest)) as f32;
        Self { normal: found.vector.map(|v| v as f32), curvature, radius }
    }
}

/// The normal that points to the side of `direction`; up, if it is nothing or lies in the plane.
pub(super) fn towards(normal: [f32; 3], direction: [f32; 3]) -> [f32; 3] {
    let dot: f64 = (0..3).map(|a| f64::from(normal[a]) * f64::from(direction[a])).sum();
    if dot > 0.0 {
        positive(normal)
    } else if dot < 0.0 {
        turned(normal)
    } else {
        up(normal)
    }
}

/// The normal that points up; of vertical planes to the north, else to the east.
pub(super) fn up(normal: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = normal;
    if z < 0.0 || z == 0.0 && (y < 0.0 || y == 0.0 && x < 0.0) { turned(normal) } else { positive(normal) }
}

/// The normal whose longest component is positive.
pub(super) fn any_side(normal: [f32; 3]) -> [f32; 3] {
    let longest = normal.iter().fold(0.0f32, |most, v| if v.abs() > most.abs() { *v } else { most });
    if longest < 0.0 { turned(normal) } else { positive(normal) }
}

fn turned(normal: [f32; 3]) -> [f32; 3] {
    positive(normal.map(|v| -v))
}

/// Without negative zeros, whose bits are others.
fn positive(normal: [f32; 3]) -> [f32; 3] {
    normal.map(|v| v + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(points: &[[i64; 3]], reach: f64) -> Surface {
        let mut sums = Sums::default();
        points.iter().for_each(|p| sums.add(*p));
        Surface::of(&sums, reach, &Space::new([0.5; 3]))
    }

    #[test]
    fn planes_have_normals_and_lines_and_places_have_none() {
        let plane = surface(&[[0, 0, 0], [9, 0, 0], [0, 7, 0], [5, 5, 0]], 4.0);
        assert_eq!((up(plane.normal), plane.curvature, plane.radius), ([0.0, 0.0, 1.0], 0.0, 4.0));
        let line = [[0, 0, 0], [1, 2, 3], [1000, 2000, 3000], [-77, -154, -231]];
        assert_eq!(surface(&line, 2.0), Surface { radius: 2.0, ..Surface::default() });
        assert_eq!(surface(&[[0, 0, 0], [5, 0, 0]], 2.0).normal, [0.0; 3]);
        assert_eq!(surface(&[[0; 3]; 20], 2.0), Surface::default());
        assert_eq!(surface(&[[0; 3]], 2.0), Surface::default());
        let sixteen: Vec<[i64; 3]> = (0..16).map(|i| [i % 4, i / 4, 0]).collect();
        assert_eq!(surface(&sixteen, 3.0).radius, 1.5);
    }

    #[test]
    fn a_ball_has_the_greatest_curvature() {
        let ball = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
        let curvature = surface(&ball, 1.0).curvature;
        assert!((curvature - 1.0 / 3.0).abs() < 1e-7, "{curvature}");
    }

    #[test]
    fn normals_point_to_the_side_that_is_asked_for() {
        let n = [0.6, 0.0, -0.8];
        assert_eq!(towards(n, [5.0, 0.0, 0.0]), n);
        assert_eq!(towards(n, [0.0, 0.0, 7.0]), [-0.6, 0.0, 0.8]);
        assert_eq!(towards(n, [0.0; 3]), [-0.6, 0.0, 0.8]);
        assert_eq!(up([0.0, -1.0, 0.0]), [0.0, 1.0, 0.0]);
        assert_eq!(up([-1.0, 0.0, 0.0]).map(f32::to_bits), [1.0f32, 0.0, 0.0].map(f32::to_bits));
        assert_eq!(up([0.0, 0.6, 0.8]), [0.0, 0.6, 0.8]);
        assert_eq!(any_side([0.6, 0.0, -0.8]), [-0.6, 0.0, 0.8]);
        assert_eq!(any_side([0.8, 0.0, -0.6]), [0.8, 0.0, -0.6]);
    }
}
