//! How many decimals coordinates have: those of text, and of doubles that were decimals once.

use pointmill_format::AxisGrid;

/// More decimals than this are the noise of arithmetic.
const MOST: u32 = 12;

/// A decimal grid is not coarser than this part of the extent, or a small cloud would have no room for levels.
pub(super) const PARTS_OF_EXTENT: f64 = 1024.0;

/// The least number of decimals that all values so far are written with; `None` once one has more than [`MOST`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Decimals(Option<u32>);

impl Default for Decimals {
    fn default() -> Self {
        Self(Some(0))
    }
}

/// Powers of ten, all exact.
const POWERS: [f64; MOST as usize + 1] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12];

impl Decimals {
    /// Takes a finite value into account.
    pub(super) fn see(&mut self, value: f64) {
        let mut has_more = false;
        while let Some(decimals) = self.0 {
            match has_at_most(value, decimals) {
                Some(true) => break,
                Some(false) => {
                    has_more = true;
                    self.0 = (decimals < MOST).then_some(decimals + 1);
                }
                // no decimal down to the last digits of the double: noise
                None if has_more => self.0 = None,
                // doubles of that size cannot tell
                None => break,
            }
        }
    }

    /// The decimals as a grid, at most a part of `extent`; `None` if there are too many.
    pub(super) fn grid(self, extent: f64) -> Option<AxisGrid> {
        let mut decimals = self.0?;
        while decimals < MOST && extent > 0.0 && extent * POWERS[decimals as usize] < PARTS_OF_EXTENT {
            decimals += 1;
        }
        Some(AxisGrid { step: 1.0 / POWERS[decimals as usize], offset: 0.0 })
    }
}

/// Whether `value` is a number with so many decimals, but for what a multiplication and an addition are rounded to (files
/// whose coordinates were computed from integers); `None` if doubles of that size cannot tell.
fn has_at_most(value: f64, decimals: u32) -> Option<bool> {
    let power = POWERS[decimals as usize];
    let units = (value * power).round();
    let rounding = 2.0 * f64::EPSILON * value.abs();
    let roundings = 1.0 / (rounding * power);
    let error = (units / power - value).abs();
    match () {
        () if value.fract() == 0.0 => Some(true),
        () if roundings > MANY => Some(error <= rounding),
        () if roundings > SOME => Some(error == 0.0),
        () => None,
    }
}

/// A decimal is more than this many roundings of doubles, or every double would have it.
const SOME: f64 = 4.0;

/// The same where it may be off by one, or noise would pass for it.
const MANY: f64 = 1000.0;

/// `step · factor`, without the rounding of the product where a decimal is meant.
pub(crate) fn tidy_product(step: f64, factor: f64) -> f64 {
    let product = step * factor;
    format!("{product:.12e}").parse().ok().filter(|t: &f64| ((t - product) / product).abs() < 1e-13).unwrap_or(product)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(values: &[f64]) -> Option<f64> {
        let mut decimals = Decimals::default();
        values.iter().for_each(|v| decimals.see(*v));
        decimals.grid(f64::INFINITY).map(|g| g.step)
    }

    #[test]
    fn decimals_are_those_of_the_longest_value() {
        assert_eq!(step(&[345_678.123, -0.5, 5_432_109.456]), Some(0.001));
        assert_eq!(step(&[1.0, 20.0]), Some(1.0));
        assert_eq!(step(&[13.404_954_12]), Some(1e-8));
        assert_eq!(step(&[0.1 + 0.2, 1001.0 * 0.001]), Some(0.001), "0.30000000000000004 is a decimal, computed");
        assert_eq!(step(&[5_432_109.456_789_012]), None, "the last digits of a double are none");
        assert_eq!(step(&[std::f64::consts::PI, 1.0]), None);
        assert_eq!(step(&[f64::from(0.1f32)]), None);
        assert_eq!(step(&[1e18, 0.25]), Some(0.01), "no double of that size has decimals to go by");
    }

    #[test]
    fn products_of_decimals_are_decimals() {
        assert_eq!((tidy_product(0.001, 5.0), tidy_product(1e-7, 10_000.0)), (0.005, 0.001));
    }

    #[test]
    fn whole_numbers_of_a_small_extent_get_room_for_levels() {
        let mut decimals = Decimals::default();
        [0.0, 1.0, 2.0].iter().for_each(|v| decimals.see(*v));
        assert_eq!(decimals.grid(2.0).unwrap().step, 0.001);
        assert_eq!(decimals.grid(0.0).unwrap().step, 1.0);
    }
}
