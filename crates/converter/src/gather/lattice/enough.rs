//! The coarsest step that a requested precision permits (`docs/accuracy.md`, §10).

use super::axis::AxisChoice;
use super::steps::{WHOLE, one_digit};
use crate::reason::LatticeBasis;
use crate::sources::tidy_product;

/// Makes the step of an axis as coarse as errors of `allowed` (world units, > 0) permit; not finer than it is.
///
/// Rounding to the nearest multiple of `k` steps `s` moves a coordinate by at most `k·s/2`. A coordinate that is itself a
/// whole number of steps moves by whole steps: by at most `⌊k/2⌋·s`, so that `k` may be `2⌊allowed/s⌋ + 1`.
pub(super) fn coarsen(choice: &mut AxisChoice, allowed: f64) {
    let step = choice.grid.step;
    let most = if choice.holds_all {
        2.0 * (allowed / step * (1.0 + WHOLE)).floor() + 1.0
    } else {
        (2.0 * allowed / step * (1.0 + WHOLE)).floor()
    };
    if most < 2.0 {
        return;
    }
    let coarser = if has_grid(choice.reason.basis) {
        tidy_product(step, one_digit(most))
    } else {
        // no source has this step: a decimal one serves as well, and does not depend on what headers say of the extent
        one_digit(2.0 * allowed)
    };
    let factor = coarser / step;
    if factor > 1.0 {
        choice.grid.step = coarser;
        choice.reason.enough = Some(tidy_product(factor, 1.0));
    }
}

/// True if coordinates of sources are on the grid, so that a multiple of its step keeps some of them as they are.
fn has_grid(basis: LatticeBasis) -> bool {
    match basis {
        LatticeBasis::Sources
        | LatticeBasis::Common
        | LatticeBasis::FinestOfSources
        | LatticeBasis::PartOfFinest
        | LatticeBasis::Divisor
        | LatticeBasis::Decimals
        | LatticeBasis::StoredStep => true,
        LatticeBasis::Open
        | LatticeBasis::Requested
        | LatticeBasis::SinglePrecision { .. }
        | LatticeBasis::PowerOfTwo
        | LatticeBasis::Usual
        | LatticeBasis::Decimal => false,
    }
}

#[cfg(test)]
mod tests {
    use pointmill_format::AxisGrid;

    use super::*;
    use crate::reason::AxisReason;

    fn choice(step: f64, basis: LatticeBasis, holds_all: bool) -> AxisChoice {
        let reason = AxisReason { basis, coarser: None, enough: None };
        AxisChoice { grid: AxisGrid { step, offset: 0.0 }, reason, is_prescribed: true, is_free: false, holds_all }
    }

    fn coarsened(step: f64, basis: LatticeBasis, holds_all: bool, allowed: f64) -> (f64, Option<f64>) {
        let mut choice = choice(step, basis, holds_all);
        coarsen(&mut choice, allowed);
        (choice.grid.step, choice.reason.enough)
    }

    /// The largest change of any integer, in steps, by rounding to multiples of `k`, ties to even.
    fn worst(k: i64) -> i64 {
        (-5 * k..=5 * k).map(|q| ((q as f64 / k as f64).round_ties_even() as i64 * k - q).abs()).max().unwrap()
    }

    #[test]
    fn the_bound_is_attained_and_never_exceeded_in_whole_steps() {
        let sources = LatticeBasis::Sources;
        for (allowed, k) in [(1, 3), (2, 5), (3, 7), (4, 9), (5, 10), (10, 20), (49, 90), (50, 100), (1000, 2000)] {
            let (step, factor) = coarsened(0.001, sources, true, allowed as f64 * 0.001);
            assert_eq!(factor, Some(k as f64), "{allowed} mm");
            assert!((step - 0.001 * k as f64).abs() < 1e-15, "{step}");
            assert!(worst(k) <= allowed, "{k}: {} steps", worst(k));
        }
        for attained in [1, 2, 3, 4] {
            assert_eq!(worst(2 * attained + 1), attained);
            assert!(worst(2 * attained + 2) > attained, "one more would be too many");
        }
        assert_eq!(coarsened(0.001, sources, true, 0.000_999), (0.001, None), "below a step nothing may move");
        assert_eq!(coarsened(0.1, sources, true, 0.3), (0.7, Some(7.0)), "0.3 / 0.1 is below 3 in doubles");
    }

    #[test]
    fn coordinates_anywhere_get_twice_what_is_allowed_as_step() {
        let step = |basis, step, allowed| coarsened(step, basis, false, allowed).0;
        assert_eq!(step(LatticeBasis::Decimal, 5e-7, 0.001), 0.002);
        assert_eq!(step(LatticeBasis::Decimal, 5e-7, 0.05), 0.1);
        assert_eq!(step(LatticeBasis::PowerOfTwo, 2f64.powi(-20), 0.0125), 0.02);
        assert_eq!(step(LatticeBasis::Decimals, 0.001, 0.001), 0.002, "a sample may be wrong");
        assert_eq!(step(LatticeBasis::Decimals, 0.001, 0.000_7), 0.001);
        assert_eq!(step(LatticeBasis::Decimal, 0.005, 0.001), 0.005, "31 bits hold no finer");
    }
}
