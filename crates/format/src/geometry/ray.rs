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
