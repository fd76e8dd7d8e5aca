//! What is under the cursor.

use super::Aabb;
use super::vectors::{cross, dot};

/// A ray that is wide enough to meet points: from `origin` along `direction`, all that lies within
/// `radius + spread · distance` of it.
///
/// ```
/// use pointmill_format::Ray;
///
/// // five pixels wide, if 1080 pixels are 60 degrees
/// let pixel = (60f64.to_radians() / 1080.0).tan();
/// let ray = Ray::new([0.0; 3], [0.0, 2.0, 0.0], 0.0).map(|ray| ray.with_spread(5.0 * pixel));
/// assert!(ray.is_some());
/// assert!(Ray::new([0.0; 3], [0.0; 3], 0.0).is_none(), "no direction");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    origin: [f64; 3],
    direction: [f64; 3],
    radius: f64,
    spread: f64,
}

impl Ray {
    /// `origin` in world coordinates, `direction` of any length, `radius` ≥ 0 in world units. Nothing if a number is
    /// not finite or the direction has no length.
    #[must_use]
    pub fn new(origin: [f64; 3], direction: [f64; 3], radius: f64) -> Option<Self> {
        // Scaled first, so that no square overflows or vanishes.
        let largest = direction.iter().fold(0.0, |l: f64, v| l.max(v.abs()));
        let scaled = direction.map(|v| v / largest);
        let length = dot(scaled, scaled).sqrt();
        let direction = scaled.map(|v| v / length);
        let finite = origin.iter().chain(&direction).all(|v| v.is_finite());
        (finite && radius.is_finite() && radius >= 0.0).then_some(Self { origin, direction, radius, spread: 0.0 })
    }

    /// The same ray, wider by `spread` ≥ 0 for each unit of distance: for a tolerance of n pixels the n-fold of the
    /// tangent of a pixel's angle. What is not a finite number ≥ 0 counts as 0.
    #[must_use]
    pub fn with_spread(self, spread: f64) -> Self {
        Self { spread: if spread.is_finite() { spread.max(0.0) } else { 0.0 }, ..self }
    }

    /// The distance along the ray at which it enters `bounds`, enlarged by its greatest width there: no point in the box
    /// is met before. Nothing if it misses.
    #[must_use]
    pub fn enter(&self, bounds: &Aabb) -> Option<f64> {
        let Self { origin: o, direction: d, radius, spread } = *self;
        // Of the rounding below nothing may be lost: it is proportional to the coordinates.
        let mut width = radius;
        if spread > 0.0 {
            let ahead = |a: usize| ((bounds.min[a] - o[a]) * d[a]).max((bounds.max[a] - o[a]) * d[a]);
            width += spread * (ahead(0) + ahead(1) + ahead(2)).max(0.0);
        }
        let (mut t_in, mut t_out) = (0.0_f64, f64::INFINITY);
        for a in 0..3 {
            let (min, max) = (bounds.min[a], bounds.max[a]);
            let margin = width * (1.0 + 1e-12) + 1e-15 * (min.abs().max(max.abs()) + o[a].abs());
            let (low, high) = (min - margin - o[a], max + margin - o[a]);
            if d[a] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (t0, t1) = (low / d[a], high / d[a]);
            t_in = t_in.max(t0.min(t1));
            t_out = t_out.min(t0.max(t1));
        }
        (t_in <= t_out).then_some(t_in)
    }

    /// Distance along the ray and squared distance from it, if `p` is within its width and not beyond `nearest`.
    #[inline]
    #[must_use]
    pub fn meet(&self, p: [f64; 3], nearest: f64) -> Option<(f64, f64)> {
        let v = [p[0] - self.origin[0], p[1] - self.origin[1], p[2] - self.origin[2]];
        let t = dot(v, self.direction);
        // Not a number is not met. A cross product, as |v|² − t² would lose all digits far away.
        if !(0.0..=nearest).contains(&t) {
            return None;
        }
        let away = cross(v, self.direction);
        let (away2, width) = (dot(away, away), self.radius + self.spread * t);
        (away2 <= width * width).then_some((t, away2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORIGIN: [f64; 3] = [1.0, 2.0, 3.0];
    const ALONG: [f64; 3] = [1.0 / 3.0, -2.0 / 3.0, 2.0 / 3.0];
    const ASIDE: [[f64; 3]; 2] = [[2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0], [-2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0]];

    fn slanted(radius: f64, spread: f64) -> Ray {
        Ray::new(ORIGIN, [2.0, -4.0, 4.0], radius).unwrap().with_spread(spread)
    }

    fn point(along: f64, aside: [f64; 2]) -> [f64; 3] {
        std::array::from_fn(|a| ORIGIN[a] + along * ALONG[a] + aside[0] * ASIDE[0][a] + aside[1] * ASIDE[1][a])
    }

    fn up_y(origin: [f64; 3], radius: f64) -> Ray {
        Ray::new(origin, [0.0, 7.0, 0.0], radius).unwrap()
    }

    #[test]
    fn points_within_the_width_at_their_distance_are_met() {
        let is_met = |ray: Ray, p| ray.meet(p, 20.0).is_some();
        for [u, v] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [0.6, 0.8]] {
            let at = |along, away: f64| point(along, [away * u, away * v]);
            let (t, away2) = slanted(0.5, 0.0).meet(at(10.0, 0.4), 20.0).unwrap();
            assert!((t - 10.0).abs() < 1e-12 && (away2 - 0.16).abs() < 1e-12, "{t} {away2}");
            assert!(!is_met(slanted(0.5, 0.0), at(10.0, 0.6)));
            assert!(is_met(slanted(0.5, 0.1), at(10.0, 1.4)) && !is_met(slanted(0.5, 0.1), at(10.0, 1.6)));
            assert!(is_met(slanted(0.5, 0.1), at(2.0, 0.6)) && !is_met(slanted(0.5, 0.1), at(2.0, 0.8)));
            assert!(!is_met(slanted(5.0, 0.0), at(-1.0, 0.1)) && !is_met(slanted(5.0, 0.0), at(20.1, 0.1)));
        }
        let upwards = up_y([0.0; 3], 0.5).with_spread(0.25);
        assert_eq!(upwards.meet([1.5, 4.0, 0.0], 4.0), Some((4.0, 2.25)), "the borders belong to it");
        assert_eq!(upwards.meet([0.0; 3], 0.0), Some((0.0, 0.0)));
        assert_eq!(upwards.meet([f64::NAN; 3], 1.0), None);
        for none in [-1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(slanted(0.5, none), slanted(0.5, 0.0));
        }
    }

    #[test]
    fn boxes_are_entered_where_they_begin_less_the_width() {
        let near = |found: Option<f64>, expected: f64| found.is_some_and(|t| (t - expected).abs() < 1e-9);
        let enter = |radius, spread, x: [f64; 2], y: [f64; 2]| {
            let bounds = Aabb { min: [x[0], y[0], -1.0], max: [x[1], y[1], 1.0] };
            up_y([0.0; 3], radius).with_spread(spread).enter(&bounds)
        };
        let (ahead, behind) = ([10.0, 12.0], [-12.0, -10.0]);
        assert!(near(enter(0.0, 0.0, [-1.0, 1.0], ahead), 10.0) && near(enter(0.5, 0.0, [-1.0, 1.0], ahead), 9.5));
        assert_eq!(
            (enter(0.0, 1.0, [-1.0, 1.0], behind), enter(0.0, 0.0, [-1.0, 1.0], [-2.0, 2.0])),
            (None, Some(0.0))
        );
        for side in [[2.0, 3.0], [-3.0, -2.0]] {
            assert_eq!(enter(1.5, 0.0, side, ahead), None);
            // the far end of the box is 12 ahead: 3 wide there
            assert!(near(enter(2.5, 0.0, side, ahead), 7.5) && near(enter(0.0, 0.25, side, ahead), 7.0));
            assert_eq!(enter(0.0, 0.16, side, ahead), None);
        }
        let around = |p: [f64; 3]| Aabb { min: p.map(|v| v - 0.5), max: p.map(|v| v + 0.5) };
        assert!(near(slanted(0.0, 0.0).enter(&around(point(10.0, [0.0; 2]))), 9.25));
        let aside = around(point(10.0, [3.0, 0.0]));
        assert_eq!(slanted(0.0, 0.0).enter(&aside), None);
        // the corner farthest ahead is at 10 5/6
        assert!(near(slanted(3.0, 0.0).enter(&aside), 6.25) && near(slanted(0.0, 0.3).enter(&aside), 5.875));
    }

    #[test]
    fn no_point_that_is_met_is_in_a_box_that_is_missed() {
        let of = |p: [f64; 3]| Aabb { min: p, max: p };
        for (far, radius) in [(0.0, 1000.0), (1e6, 1e-3), (-1e6, 1e-3), (3e6, 0.1)] {
            let mut met = 0;
            for i in 1..=400 {
                let radius = radius * (1.0 + f64::from(i) / 400.0);
                let ray = up_y([far, 0.0, far], radius);
                for p in [[far + radius, 5.0, far], [far, 5.0, far - radius]] {
                    if ray.meet(p, 10.0).is_some() {
                        met += 1;
                        assert!(ray.enter(&of(p)).is_some(), "{p:?} of {ray:?}");
                    }
                }
            }
            assert!(met > 100, "{met}");
        }
        let without_width = up_y([0.0, -5.0, 0.0], 0.0).enter(&of([0.0; 3]));
        assert!(without_width.is_some_and(|t| t > 4.999 && t <= 5.0), "{without_width:?}");
    }
}
