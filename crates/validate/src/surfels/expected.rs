//! What the point of a neighbourhood should have (`docs/surfels.md`), and how far off that may be.

use super::eigen::eigen;
use super::nearest::Found;

/// What is expected, by arithmetic in doubles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Expected {
    /// `None`: it is one of several that fit.
    pub(super) plane: Option<Plane>,
    /// Least and greatest.
    pub(super) radius: [f64; 2],
}

/// The plane of a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    pub(super) normal: Normal,
    pub(super) curvature: f64,
}

/// The normal of a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Normal {
    /// One place or a line: 0 0 0.
    None,
    /// A line, and by how much a normal may be off it, degrees.
    Line([f64; 3], f64),
    /// One of many that fit.
    Any,
}

/// The middle eigenvalue of a neighbourhood that has no plane is this part of the largest one at most.
const NO_PLANE: f64 = 1e-10;

/// Two eigenvalues that differ by less than this of the larger one have no eigenvectors to speak of.
const GAP: f64 = 1e-3;

/// How far a normal may be off, degrees: two readings of one page, in any sensible arithmetic.
const ANGLE: f64 = 0.1;

/// What a covariance may be off, relative to its largest eigenvalue: that of sums in single precision.
const COVARIANCE: f64 = 1e-6;

/// No normal is judged that may be off by more, degrees.
const MOST: f64 = 0.5;

impl Expected {
    /// Of a neighbourhood on a lattice of these steps.
    pub(super) fn of(found: &Found, scale: [f64; 3]) -> Self {
        let disk = |points: u64| found.distance * (4.0 / points.max(1) as f64).sqrt().min(1.0);
        let radius = match (found.may_be_one_place, found.is_ambiguous) {
            (true, false) => [0.0; 2],
            (true, true) => [0.0, disk(found.points[0])],
            (false, _) => [disk(found.points[1]), disk(found.points[0])],
        };
        let covariance = found.moments.covariance(scale).filter(|_| !found.is_ambiguous);
        Self { plane: covariance.and_then(Plane::of), radius }
    }
}

impl Plane {
    /// `None` where rounding decides whether there is one.
    fn of(covariance: [[f64; 3]; 3]) -> Option<Self> {
        let found = eigen(covariance);
        let [least, middle, most] = found.values.map(|v| v.max(0.0));
        if middle <= NO_PLANE / 2.0 * most {
            return Some(Self { normal: Normal::None, curvature: 0.0 });
        }
        if middle < NO_PLANE * 2.0 * most {
            return None;
        }
        let curvature = least / (least + middle + most);
        let gap = middle - least;
        // The theorem of Davis and Kahan: if a covariance is off by e, its eigenvector turns by e over the gap to the next
        // eigenvalue at most. Both eigenvalues of a rod are small against the largest one, which e is measured by.
        let angle = ANGLE + (COVARIANCE * most / gap).to_degrees();
        let is_certain = gap > GAP * middle && angle <= MOST;
        Some(Self { normal: if is_certain { Normal::Line(found.vector, angle) } else { Normal::Any }, curvature })
    }
}

/// The angle between two lines, degrees; exact for small ones, too.
pub(super) fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let cross = [0, 1, 2].map(|i: usize| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    });
    let dot: f64 = (0..3).map(|i| a[i] * b[i]).sum();
    length(cross).atan2(dot.abs()).to_degrees()
}

pub(super) fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::nearest::{Nearest, Within};
    use super::*;

    fn nearest(points: &[[i64; 3]]) -> Expected {
        let mut nearest = Nearest::new(16, f64::INFINITY);
        for d in points {
            nearest.offer(d.iter().map(|v| (v * v) as f64).sum::<f64>() * 0.25, *d);
        }
        Expected::of(&nearest.finish(), [0.5; 3])
    }

    #[test]
    fn a_plane_a_line_a_place_and_a_ball_have_what_the_page_says() {
        let plane = nearest(&[[0; 3], [2, 0, 0], [0, 6, 0], [-2, 1, 0], [5, 5, 0]]);
        let Some(Plane { normal: Normal::Line(normal, allowed), curvature }) = plane.plane else { panic!("{plane:?}") };
        assert!(angle(normal, [0.0, 0.0, -1.0]) < 1e-9 && curvature.abs() < 1e-15 && (0.1..0.101).contains(&allowed));
        let far = 50f64.sqrt() * 0.5;
        assert_eq!(plane.radius, [far * (4.0f64 / 5.0).sqrt(); 2]);
        let line = nearest(&[[0; 3], [1, 2, 3], [2, 4, 6], [-7, -14, -21]]);
        assert_eq!(line.plane, Some(Plane { normal: Normal::None, curvature: 0.0 }));
        assert_eq!(line.radius, [(49.0f64 * 14.0).sqrt() * 0.5; 2], "four points: at most the distance");
        let place = nearest(&[[0; 3], [0; 3], [0; 3]]);
        assert_eq!(place, Expected { plane: line.plane, radius: [0.0; 2] });
        let ball = nearest(&[[0; 3], [3, 0, 0], [-3, 0, 0], [0, 3, 0], [0, -3, 0], [0, 0, 3], [0, 0, -3]]);
        let Some(Plane { normal: Normal::Any, curvature }) = ball.plane else { panic!("{ball:?}") };
        assert!((curvature - 1.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn a_thin_rod_allows_what_single_precision_does_to_it() {
        let rod = nearest(&[[0; 3], [2000, 0, 1], [-2000, 120, 2], [1000, 0, 2], [-1000, 120, 0]]);
        let Some(Plane { normal: Normal::Line(_, allowed), .. }) = rod.plane else { panic!("{rod:?}") };
        assert!((0.11..0.5).contains(&allowed), "{allowed}");
        let thin = nearest(&[[0; 3], [200_000, 0, 1], [-200_000, 9, 2], [100_000, 0, 2], [-100_000, 9, 0]]);
        assert!(matches!(thin.plane, Some(Plane { normal: Normal::Any, .. })), "{thin:?}");
    }

    #[test]
    fn radii_within_a_distance_are_a_range_where_points_are_at_it() {
        let mut within = Within::new(10.0);
        let offer = |d: [i64; 3], within: &mut Within| {
            within.offer(d.iter().map(|v| (v * v) as f64).sum::<f64>(), d);
        };
        offer([0; 3], &mut within);
        assert_eq!(Expected::of(&within.finish(), [1.0; 3]).radius, [0.0; 2], "alone");
        for i in 1..8 {
            offer([i, -i, 1], &mut within);
        }
        let expected = Expected::of(&within.finish(), [1.0; 3]);
        assert_eq!(expected.radius, [10.0 * (4.0f64 / 8.0).sqrt(); 2]);
        offer([10, 0, 0], &mut within);
        let expected = Expected::of(&within.finish(), [1.0; 3]);
        assert_eq!(expected.radius, [10.0 * (4.0f64 / 9.0).sqrt(), 10.0 * (4.0f64 / 8.0).sqrt()]);
        assert_eq!(expected.plane, None);
    }

    #[test]
    fn angles_are_between_lines() {
        assert_eq!(angle([0.0, 0.0, 1.0], [0.0, 0.0, -2.0]), 0.0);
        assert!((angle([1.0, 0.0, 0.0], [1.0, 1e-9, 0.0]) - 1e-9f64.to_degrees()).abs() < 1e-20);
        assert!((angle([1.0, 0.0, 0.0], [-1.0, 1.0, 0.0]) - 45.0).abs() < 1e-12);
    }
}
