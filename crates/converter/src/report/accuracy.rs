//! How far the positions that a reader decodes are from those of the sources (`docs/accuracy.md`).

use pointmill_format::Deviations;
use serde::{Serialize, Serializer};

/// The accuracy of the positions of a dataset. Figures are in world units of the dataset.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Accuracy {
    /// What the lattice of the run did: its points against the positions of the sources.
    pub lattice: PositionErrors,
    /// What the format did: what a reader decodes against the points of the lattice.
    pub format: PositionErrors,
    /// Both: what a reader decodes against the positions of the sources.
    pub total: PositionErrors,
    /// Points whose integers come back.
    pub integers: Integers,
    /// Different positions that became one.
    pub merged: Merged,
    /// The same figures in metres, where x and y are longitude and latitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metres: Option<Metres>,
}

/// How far positions of points are from others: what is decoded less what it stands for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PositionErrors {
    /// Largest by axis, without its sign.
    pub max: [f64; 3],
    /// Largest distance in space, or a bound of it that is not above the length of `max`.
    pub max_3d: f64,
    /// Root of the mean square by axis.
    pub rms: [f64; 3],
    /// Root of the mean square of the distance in space.
    pub rms_3d: f64,
    /// Mean by axis, with its sign: the bias.
    pub mean: [f64; 3],
    /// Where the figures come from.
    pub how: How,
}

/// Where figures come from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum How {
    /// There is no error, and it is known why.
    #[default]
    Exact,
    /// No error is larger, and all are the rounding of doubles.
    Rounding,
    /// Every point was looked at.
    Measured,
    /// No error is larger; of `mean`: it is not farther from zero.
    Bound,
}

/// Points that a reader can round to the integers that they had in their scan.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Integers {
    /// Points of the dataset.
    pub points: u64,
    /// Those whose decoded position, rounded to the lattice of their scan (of the dataset where the scan has none),
    /// gives the same integers. Where the lattice and the format lose points, at least these many.
    pub same: u64,
}

/// Points that share their position with points that were apart.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Merged {
    /// Points of the sources that share a point of the lattice with another position of the sources; `None`: not
    /// counted.
    pub lattice: Option<u64>,
    /// Points whose decoded position is that of another point of the lattice too; `None`: not counted.
    pub format: Option<u64>,
}

/// Figures in metres on WGS 84, as bounds: a degree of longitude counts as at the latitude of the cloud nearest to the
/// equator, one of latitude as at the farthest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Metres {
    /// As in [`Accuracy::lattice`].
    pub lattice: PositionErrors,
    /// As in [`Accuracy::format`].
    pub format: PositionErrors,
    /// As in [`Accuracy::total`].
    pub total: PositionErrors,
}

impl How {
    /// The word in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Rounding => "rounding",
            Self::Measured => "measured",
            Self::Bound => "bound",
        }
    }
}

impl Serialize for How {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl PositionErrors {
    /// The figures of points that were looked at.
    pub(crate) fn measured(of: &Deviations) -> Self {
        let points = of.points.max(1) as f64;
        if of.max == [0.0; 3] {
            return Self::default();
        }
        Self {
            max: of.max,
            max_3d: length(of.max).min(above(of.max_squared_3d.sqrt())),
            rms: of.squares.map(|sum| (sum / points).sqrt()),
            rms_3d: (of.squares.iter().sum::<f64>() / points).sqrt(),
            mean: of.sum.map(|sum| sum / points),
            how: How::Measured,
        }
    }

    /// No error on an axis is above `max`, which is what doubles of that size are rounded by.
    pub(crate) fn rounding(max: [f64; 3]) -> Self {
        if max == [0.0; 3] {
            return Self::default();
        }
        Self { max, max_3d: length(max), rms: max, rms_3d: length(max), mean: max, how: How::Rounding }
    }

    /// No error on an axis is above `max`.
    pub(crate) fn bound(max: [f64; 3]) -> Self {
        let errors = Self::rounding(max);
        if errors.is_zero() { errors } else { Self { how: How::Bound, ..errors } }
    }

    /// True if no position differs.
    pub fn is_zero(&self) -> bool {
        self.max == [0.0; 3]
    }

    /// True if no position differs by more than doubles of its size are rounded: 0.07 as a double and 7 steps of 0.01
    /// have other last bits.
    pub fn is_rounding(&self) -> bool {
        matches!(self.how, How::Exact | How::Rounding)
    }

    /// The same figures, of which it is known that they are rounding.
    pub(crate) fn as_rounding(mut self) -> Self {
        if !self.is_zero() {
            self.how = How::Rounding;
        }
        self
    }

    /// These errors after `first`: sums, which no error exceeds. If there is one kind only, its figures are exact.
    #[must_use]
    pub(crate) fn after(&self, first: &Self) -> Self {
        if first.is_zero() {
            return *self;
        }
        if self.is_zero() {
            return *first;
        }
        let sum = |a: f64, b: f64| above(a + b);
        let by_axis = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| sum(a[i], b[i]));
        let bias = |a: f64, b: f64| {
            let is_known = first.how == How::Measured && self.how == How::Measured;
            if is_known { a + b } else { sum(a.abs(), b.abs()).copysign(a) }
        };
        let max = by_axis(first.max, self.max);
        Self {
            max,
            max_3d: sum(first.max_3d, self.max_3d).min(length(max)),
            rms: by_axis(first.rms, self.rms),
            rms_3d: sum(first.rms_3d, self.rms_3d),
            mean: std::array::from_fn(|a| bias(first.mean[a], self.mean[a])),
            how: if first.is_rounding() && self.is_rounding() { How::Rounding } else { How::Bound },
        }
    }

    /// In other units: those of each axis times its factor.
    #[must_use]
    pub(crate) fn scaled(&self, factors: [f64; 3]) -> Self {
        if self.is_zero() {
            return *self;
        }
        let times = |v: [f64; 3]| std::array::from_fn(|a| v[a] * factors[a]);
        let (max, rms) = (times(self.max), times(self.rms));
        let how = if self.is_rounding() { How::Rounding } else { How::Bound };
        Self { max, max_3d: length(max), rms, rms_3d: length(rms), mean: times(self.mean), how }
    }
}

/// The length of a vector, not rounded down.
pub(crate) fn length(v: [f64; 3]) -> f64 {
    match v.iter().filter(|c| **c != 0.0).count() {
        0 | 1 => v.iter().sum(),
        _ => above(v.iter().map(|c| c * c).sum::<f64>().sqrt()),
    }
}

/// A little more than `v`, by more than the rounding of a few operations.
pub(crate) fn above(v: f64) -> f64 {
    v * (1.0 + 4.0 * f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(differences: &[[f64; 3]]) -> Deviations {
        let mut d = Deviations::default();
        differences.iter().for_each(|v| d.add(*v));
        d
    }

    #[test]
    fn figures_of_points_are_those_of_the_textbook() {
        let e = PositionErrors::measured(&of(&[[3.0, 0.0, 0.0], [-1.0, 4.0, 0.0]]));
        assert_eq!((e.max, e.mean, e.how), ([3.0, 4.0, 0.0], [1.0, 2.0, 0.0], How::Measured));
        assert_eq!(e.rms, [5f64.sqrt(), 8f64.sqrt(), 0.0]);
        assert_eq!(e.rms_3d, 13f64.sqrt());
        assert!(e.max_3d >= 17f64.sqrt() && e.max_3d < 17f64.sqrt() * 1.000_001);
        assert_eq!(PositionErrors::measured(&of(&[[0.0; 3]])), PositionErrors::default());
    }

    #[test]
    fn errors_of_two_kinds_add_up_to_a_bound_and_one_kind_stays_as_it_is() {
        let (lattice, format) = ([[0.5, -0.25, 0.0], [0.25, 0.5, 0.0]], [[0.125, -0.5, 0.0], [-0.125, 0.25, 0.0]]);
        let [first, second] = [&lattice, &format].map(|d| PositionErrors::measured(&of(d)));
        let none = PositionErrors::default();
        assert_eq!((second.after(&none), none.after(&first)), (second, first));
        let total = second.after(&first);
        let both: Vec<[f64; 3]> =
            lattice.iter().zip(format).map(|(l, f)| std::array::from_fn(|a| l[a] + f[a])).collect();
        let truth = PositionErrors::measured(&of(&both));
        assert_eq!((total.mean, total.how), (truth.mean, How::Bound));
        assert!((0..3).all(|a| total.max[a] >= truth.max[a] && total.rms[a] >= truth.rms[a]));
        assert!(total.max_3d >= truth.max_3d && total.rms_3d >= truth.rms_3d);
    }

    #[test]
    fn a_bound_is_a_bound_of_the_mean_too() {
        let first = PositionErrors::measured(&of(&[[-0.5, 0.0, 0.0]]));
        let total = PositionErrors::rounding([1e-9, 1e-9, 0.0]).after(&first);
        assert!(total.mean[0] <= -0.500_000_001 && total.mean[1] >= 1e-9);
    }

    #[test]
    fn roots_of_mean_squares_are_doubles() {
        // 4097² has 25 bits, one more than single precision
        let e = PositionErrors::measured(&of(&[[4097.0, 0.0, -4097.0], [-4097.0, 0.0, 4097.0]]));
        assert_eq!((e.rms, e.mean), ([4097.0, 0.0, 4097.0], [0.0; 3]));
        assert_eq!(e.rms_3d, 33_570_818f64.sqrt());
    }

    #[test]
    fn figures_in_other_units_are_bounds_of_the_length() {
        let e = PositionErrors::measured(&of(&[[3.0, 0.0, 0.0], [-1.0, 4.0, 0.0]])).scaled([2.0, 0.5, 3.0]);
        assert_eq!((e.max, e.mean, e.how), ([6.0, 2.0, 0.0], [2.0, 1.0, 0.0], How::Bound));
        assert_eq!(e.rms, [2.0 * 5f64.sqrt(), 0.5 * 8f64.sqrt(), 0.0]);
        assert_eq!((e.max_3d, e.rms_3d), (above(40f64.sqrt()), length(e.rms)));
        let rounding = PositionErrors::rounding([1e-9, 0.0, 0.0]).scaled([8.0; 3]);
        assert_eq!((rounding.max, rounding.how), ([8e-9, 0.0, 0.0], How::Rounding));
        assert_eq!(PositionErrors::default().scaled([2.0; 3]), PositionErrors::default());
    }

    #[test]
    fn lengths_are_exact_on_an_axis_and_a_little_more_elsewhere() {
        assert_eq!([length([0.0; 3]), length([0.0, 3.0, 0.0]), length([0.1, 0.0, 0.0])], [0.0, 3.0, 0.1]);
        assert_eq!((above(1.0), length([0.0, 3.0, 4.0])), (1.0 + 2f64.powi(-50), above(5.0)));
        assert_eq!(length([2.0, 3.0, 6.0]), above(7.0));
    }

    #[test]
    fn sums_of_rounding_are_rounding_and_all_others_are_bounds() {
        let (rounding, bound) = (PositionErrors::rounding([1e-9; 3]), PositionErrors::bound([1e-3; 3]));
        let measured = PositionErrors::measured(&of(&[[-0.5, 0.25, 0.0]]));
        let how = |a: PositionErrors, b: PositionErrors| a.after(&b).how;
        assert_eq!(how(rounding, rounding), How::Rounding);
        assert_eq!([how(rounding, bound), how(bound, rounding), how(measured, rounding)], [How::Bound; 3]);
        // of a measured mean and a bound the sizes add up, whatever the signs
        let mean = PositionErrors::bound([0.125; 3]).after(&measured).mean;
        assert_eq!(mean, [-above(0.625), above(0.375), above(0.125)]);
        assert_eq!(measured.after(&PositionErrors::bound([0.125; 3])).mean, [above(0.625), above(0.375), above(0.125)]);
        assert_eq!((rounding.as_rounding().how, bound.as_rounding().how), (How::Rounding, How::Rounding));
        assert_eq!(PositionErrors::default().as_rounding(), PositionErrors::default());
        // the length of the largest by axis where that is less than the sum of the lengths
        let across = PositionErrors::bound([3.0, 0.0, 0.0]).after(&PositionErrors::bound([0.0, 4.0, 0.0]));
        assert_eq!(across.max_3d, length([above(3.0), above(4.0), 0.0]));
    }

    #[test]
    fn words_of_reports_say_how_a_figure_is_known() {
        let all = [How::Exact, How::Rounding, How::Measured, How::Bound];
        assert_eq!(all.map(How::name), ["exact", "rounding", "measured", "bound"]);
    }
}
