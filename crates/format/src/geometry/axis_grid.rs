//! Evenly spaced coordinates along one axis.

/// Coordinates that are `k · step + offset` with whole `k`: what a file that stores integers can express on one axis.
///
/// ```
/// use pointmill_format::AxisGrid;
///
/// let coarse = AxisGrid { step: 0.01, offset: 0.0 };
/// let shifted = AxisGrid { step: 0.025, offset: 100.0 };
/// assert_eq!(AxisGrid::common(&[coarse, shifted]), Some(AxisGrid { step: 0.005, offset: 0.0 }));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisGrid {
    /// Distance of neighbours, world units, > 0.
    pub step: f64,
    /// One of the coordinates.
    pub offset: f64,
}

/// Decimals that are tried for a common unit.
const MAX_DECIMALS: u32 = 12;

/// A difference of offsets this far from a whole number of steps, in steps, is rounding.
const ROUNDING: f64 = 1e-6;

impl AxisGrid {
    /// The coarsest grid that holds all points of all `grids`, with the offset of the first; `None` if there is none with
    /// a decimal unit of at least 10⁻¹², or no grid.
    #[must_use]
    pub fn common(grids: &[Self]) -> Option<Self> {
        let first = *grids.first()?;
        if grids.iter().all(|g| g.step == first.step && is_whole(g.offset - first.offset, first.step, first.offset)) {
            return Some(first);
        }
        (0..=MAX_DECIMALS).find_map(|decimals| Self::common_of(grids, first, decimals))
    }

    /// The same, with every step and difference of offsets a whole number of `10^-decimals`.
    fn common_of(grids: &[Self], first: Self, decimals: u32) -> Option<Self> {
        let unit = decimal(1, decimals)?;
        let mut divisor = 0;
        for grid in grids {
            let (between, far) = ((grid.offset - first.offset).abs(), grid.offset.abs().max(first.offset.abs()));
            if !is_multiple(grid.step, unit) || !is_whole(between, unit, far) {
                return None;
            }
            for units in [grid.step, between].map(|length| (length / unit).round()) {
                if units >= 2f64.powi(53) {
                    return None;
                }
                divisor = greatest_common_divisor(divisor, units as u64);
            }
        }
        Some(Self { step: decimal(divisor, decimals).filter(|step| *step > 0.0)?, offset: first.offset })
    }

    /// True if every point of `other` is one of this grid.
    #[must_use]
    pub fn holds(&self, other: &Self) -> bool {
        let far = self.offset.abs().max(other.offset.abs());
        is_multiple(other.step, self.step) && is_whole(other.offset - self.offset, self.step, far)
    }
}

/// True if `step` is a multiple of `unit`, but for its own last bits: it is multiplied by integers of 31 bits.
fn is_multiple(step: f64, unit: f64) -> bool {
    let units = step / unit;
    let rounding = units * 4.0 * f64::EPSILON;
    units.round() > 0.0 && rounding < 0.1 && (units - units.round()).abs() <= rounding
}

/// True if `length` is a whole number of `unit`s, but for the rounding of numbers as large as `far`.
fn is_whole(length: f64, unit: f64, far: f64) -> bool {
    let units = length / unit;
    if units == 0.0 {
        return true;
    }
    let rounding = (4.0 * f64::EPSILON * far.abs() / unit).max(units.abs() * 4.0 * f64::EPSILON).max(ROUNDING);
    rounding < 0.1 && (units - units.round()).abs() <= rounding
}

/// `units · 10^-decimals`, correctly rounded.
fn decimal(units: u64, decimals: u32) -> Option<f64> {
    format!("{units}e-{decimals}").parse().ok()
}

/// The greatest common divisor; that of 0 and n is n.
fn greatest_common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    fn common(grids: &[(f64, f64)]) -> Option<(f64, f64)> {
        let grids: Vec<_> = grids.iter().map(|(step, offset)| AxisGrid { step: *step, offset: *offset }).collect();
        AxisGrid::common(&grids).map(|g| (g.step, g.offset))
    }

    #[test]
    fn grids_that_share_points_have_a_common_grid() {
        assert_eq!(common(&[(0.01, 100.0), (0.001, 5_000_000.0)]), Some((0.001, 100.0)));
        assert_eq!(common(&[(0.001, 0.0), (0.001, 500_000.000_5)]), Some((0.0005, 0.0)));
        assert_eq!(common(&[(0.002, 0.0), (0.005, 0.0)]), Some((0.001, 0.0)));
        assert_eq!(common(&[(0.007_812_5, 1.0), (0.007_812_5, 3.0)]), Some((0.007_812_5, 1.0)));
        assert_eq!(common(&[(1e-8, 0.0), (0.01, 0.0)]), Some((1e-8, 0.0)));
        assert_eq!(common(&[(0.01, 1e17), (0.01, 1e17)]), Some((0.01, 1e17)));
        assert_eq!(common(&[(0.1, 0.0), (1.0 / 3.0, 0.0)]), None);
        assert_eq!(common(&[]), None);
    }

    #[test]
    fn offsets_beyond_the_precision_of_doubles_make_no_finer_grid() {
        assert_eq!(common(&[(1e-9, 0.0), (1e-9, 123_456_789.123_456_8)]), None);
        assert_eq!(common(&[(0.5, 1e17), (0.25, 1e17 + 64.0)]), None);
    }

    #[test]
    fn a_step_that_was_a_single_is_not_the_decimal_next_to_it() {
        let single = f64::from(0.001f32);
        assert_ne!(common(&[(single, 0.0), (0.001, 0.0)]).map(|g| g.0), Some(0.001), "0.1 m off after 2^31 steps");
        assert!(!AxisGrid { step: 0.001, offset: 0.0 }.holds(&AxisGrid { step: single, offset: 0.0 }));
    }

    #[test]
    fn a_finer_aligned_grid_holds_a_coarser_one() {
        let fine = AxisGrid { step: 0.001, offset: 476_000.0 };
        assert!(fine.holds(&AxisGrid { step: 0.01, offset: 0.0 }));
        assert!(!fine.holds(&AxisGrid { step: 0.01, offset: 0.000_5 }));
        assert!(!fine.holds(&AxisGrid { step: 0.0015, offset: 0.0 }));
    }

    #[test]
    fn quotients_just_below_a_whole_number_are_that_number() {
        // as doubles, 0.3 / 0.1 is below 3 and 0.7 / 0.1 below 7
        assert_eq!(common(&[(0.3, 0.0), (0.2, 0.0)]), Some((0.1, 0.0)));
        assert_eq!(common(&[(0.1, 0.0), (0.1, 0.7)]), Some((0.1, 0.0)));
        assert_eq!(common(&[(0.2, 0.0), (0.2, 0.3)]), Some((0.1, 0.0)));
        let tenths = AxisGrid { step: 0.1, offset: 0.0 };
        assert!(tenths.holds(&AxisGrid { step: 0.3, offset: 0.7 }));
        assert!(tenths.holds(&AxisGrid { step: 0.3, offset: -0.7 }));
    }

    #[test]
    fn steps_that_are_no_decimals_are_common_if_they_are_the_same() {
        let third = 1.0 / 3.0;
        assert_eq!(common(&[(third, 0.0), (third, 0.0)]), Some((third, 0.0)));
        assert_eq!(common(&[(third, 0.7), (third, 2.7)]), Some((third, 0.7)), "two apart are six steps");
        assert_eq!(common(&[(third, 0.7), (third, 2.6)]), None);
    }

    #[test]
    fn what_lies_between_offsets_counts_not_where_they_are() {
        assert_eq!(common(&[(0.5, 0.1), (1.0, 0.6)]), Some((0.5, 0.1)));
        let grid = AxisGrid { step: 0.5, offset: 0.1 };
        assert!(grid.holds(&AxisGrid { step: 1.0, offset: 0.6 }) && !grid.holds(&AxisGrid { step: 1.0, offset: 0.4 }));
        // so many units that doubles do not count them
        assert!(!AxisGrid { step: 1e-15, offset: 0.0 }.holds(&AxisGrid { step: 1.0, offset: 0.0 }));
    }

    #[test]
    fn tolerances_are_last_bits_of_the_numbers_that_are_divided() {
        let ulps = |v: f64, n: i32| v + f64::from(n) * (v.next_up() - v);
        let ones = AxisGrid { step: 1.0, offset: 0.0 };
        let is_held = |step| ones.holds(&AxisGrid { step, offset: 0.0 });
        assert!(is_held(ulps(1000.0, 3)) && !is_held(ulps(1000.0, 9)));
        // offsets on both sides of 0 are farther apart than either is from it
        let far = AxisGrid { step: 1.0, offset: -1e10 };
        let to = |offset| far.holds(&AxisGrid { step: 1.0, offset });
        assert!(to(ulps(1e10, 6)) && !to(ulps(1e10, 12)));
    }
}
