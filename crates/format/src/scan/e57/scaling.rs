//! Colour and intensity to 16 bits: which values become 0 and 65,535.
//!
//! The first that says something counts:
//! 1. the limits that the scan declares (`colorLimits`, `intensityLimits`);
//! 2. the range of the field in the prototype, for colours that of all three together, so that no channel is
//!    stretched more than another;
//! 3. the usual range ([0, 1], [0, 255] or [0, 65535]) that holds a sample of the values, else what the sample spans;
//!    then with a warning.

use super::fields::{Encoding, Field};
use super::xml::Limit;

/// `value ↦ (value − low) · factor`, rounded (halves up) and kept within 0 and 65,535; NaN and infinity become 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scaling {
    low: f64,
    factor: f64,
}

/// What became of a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Scaled {
    /// It is within the range, or so near that it rounds to its end.
    Within(u16),
    /// It is not, and takes the nearest end, or 0 if it is not finite.
    Outside(u16),
}

impl Scaling {
    /// `low` becomes 0 and `high` (> `low`) 65,535.
    pub(super) fn new((low, high): (f64, f64)) -> Self {
        Self { low, factor: 65_535.0 / (high - low) }
    }

    #[inline(always)]
    pub(super) fn apply(self, value: f64) -> Scaled {
        let scaled = (value - self.low) * self.factor + 0.5;
        if (0.0..65_536.0).contains(&scaled) {
            Scaled::Within(scaled as u16)
        } else {
            // a cast saturates
            Scaled::Outside(if value.is_finite() { scaled as u16 } else { 0 })
        }
    }
}

/// The declared ranges of red, green and blue.
pub(super) fn colours(limits: Option<[[Limit; 2]; 3]>, fields: [&Field; 3]) -> Option<[(f64, f64); 3]> {
    let [red, green, blue] = limits?;
    Some([declared(red, fields[0])?, declared(green, fields[1])?, declared(blue, fields[2])?])
}

/// A range, if the limits make one.
pub(super) fn declared(limits: [Limit; 2], field: &Field) -> Option<(f64, f64)> {
    let meant = |limit: Limit| match (limit, field.encoding) {
        (Limit::Stored(v), Encoding::Scaled { scale, offset, .. }) => v * scale + offset,
        (Limit::Stored(v) | Limit::Value(v), _) => v,
    };
    let [low, high] = limits.map(meant);
    // writers without limits write 0 and 0, or the ends of their type
    (low < high && low > -1e30 && high < 1e30).then_some((low, high))
}

/// The union of the ranges, if all fields have one.
pub(super) fn union(fields: &[&Field]) -> Option<(f64, f64)> {
    let ranges = fields.iter().map(|f| f.range).collect::<Option<Vec<_>>>()?;
    Some(ranges.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |u, r| (u.0.min(r.0), u.1.max(r.1))))
}

/// The range to take for sampled values between `low` and `high`.
pub(super) fn usual((low, high): (f64, f64), is_float: bool) -> (f64, f64) {
    let usual = if is_float { &[1.0, 255.0, 65_535.0][..] } else { &[255.0, 65_535.0] };
    match usual.iter().find(|u| low >= 0.0 && high <= **u) {
        Some(u) => (0.0, *u),
        None if low < high => (low, high),
        None if low.is_finite() => (low.min(0.0), high.max(0.0)),
        None => (0.0, 1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle_of_a_range() {
        use Scaled::{Outside, Within};
        let s = Scaling::new((0.0, 255.0));
        assert_eq!([0.0, 1.0, 128.0, 255.0].map(|v| s.apply(v)), [0, 257, 32_896, 65_535].map(Within));
        let s = Scaling::new((-66.0, 66.0));
        assert_eq!([-66.0, 0.0, 66.0, 66.0005].map(|v| s.apply(v)), [0, 32_768, 65_535, 65_535].map(Within));
        assert_eq!([67.0, -1e9].map(|v| s.apply(v)), [65_535, 0].map(Outside));
        assert_eq!([f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(|v| s.apply(v)), [Outside(0); 3]);
        let s = Scaling::new((0.0, 65_535.0));
        assert!((0..=u16::MAX).all(|v| s.apply(f64::from(v)) == Within(v)));
    }

    #[test]
    fn a_sample_chooses_the_usual_range_that_holds_it() {
        assert_eq!(usual((0.1, 0.7), true), (0.0, 1.0));
        assert_eq!(usual((0.0, 1.0), false), (0.0, 255.0));
        assert_eq!(usual((3.0, 256.0), true), (0.0, 65_535.0));
        assert_eq!(usual((-2048.0, 2047.0), true), (-2048.0, 2047.0));
        assert_eq!(usual((-3.0, -3.0), true), (-3.0, 0.0));
        assert_eq!(usual((f64::INFINITY, f64::NEG_INFINITY), true), (0.0, 1.0));
    }
}
