//! Steps that are easy to read, and the least that doubles allow.

/// The least step, world units: below it single precision of renderers ends.
const LEAST_STEP: f64 = 1e-30;

/// Quotients of decimal numbers are whole to this part of them: 0.3 / 0.1 is a little below 3.
pub(super) const WHOLE: f64 = 1e-12;

/// The smallest of 1, 2 and 5 times powers of ten that is not below `value`, as exact as a double can be.
pub(super) fn one_two_five(value: f64) -> f64 {
    let exponent = value.max(f64::MIN_POSITIVE).log10().floor() as i32 - 1;
    let steps = (exponent..exponent + 3).flat_map(|e| [1, 2, 5].map(|digit| decimal(digit, e)));
    steps.into_iter().find(|step| *step >= value).unwrap_or(f64::NAN)
}

/// The largest of 1 to 9 times powers of ten that is not above `value` > 0.
pub(super) fn one_digit(value: f64) -> f64 {
    let exponent = value.log10().floor() as i32 + 1;
    let steps = (exponent - 2..=exponent).rev().flat_map(|e| (1..=9).rev().map(move |digit| decimal(digit, e)));
    steps.into_iter().find(|step| *step <= value * (1.0 + WHOLE)).unwrap_or(f64::NAN)
}

/// The smallest power of two that is not below `value`.
pub(super) fn power_of_two(value: f64) -> f64 {
    let mut exponent = value.max(f64::MIN_POSITIVE).log2().floor() as i32 - 1;
    while 2f64.powi(exponent) < value {
        exponent += 1;
    }
    2f64.powi(exponent)
}

/// The least of 1, 2, 5, 10, 20 … that is not below `factor`: as many times coarser, millimetres stay millimetres.
pub(super) fn times_coarser(factor: f64) -> f64 {
    if factor <= 1.0 { 1.0 } else { one_two_five(factor) }
}

/// The least step for coordinates as large as `far`: two distances of doubles.
pub(super) fn least(far: f64) -> f64 {
    if far > 0.0 { (2.0 * ulp(far)).max(LEAST_STEP) } else { 0.0 }
}

/// The distance of doubles at `far` ≥ 0.
pub(in super::super) fn ulp(far: f64) -> f64 {
    far.next_up() - far
}

fn decimal(digit: u32, exponent: i32) -> f64 {
    format!("{digit}e{exponent}").parse().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_one_two_five() {
        assert_eq!([3e-7, 0.001, 0.0011, 4.0, 6.0].map(one_two_five), [5e-7, 0.001, 0.002, 5.0, 10.0]);
        assert_eq!([1.0, 1.5, 4.0, 11.0].map(times_coarser), [1.0, 2.0, 5.0, 20.0]);
        assert_eq!([0.3, 0.5, 3.0].map(power_of_two), [0.5, 0.5, 4.0]);
    }

    #[test]
    fn steps_of_one_digit_are_at_most_what_is_allowed() {
        let values = [1.0, 0.999, 21.0, 9.99, 0.002, 2.0 * 0.005, 3e-7, 0.3 / 0.1, 1e9 / 3.0];
        assert_eq!(values.map(one_digit), [1.0, 0.9, 20.0, 9.0, 0.002, 0.01, 3e-7, 3.0, 3e8]);
    }

    #[test]
    fn doubles_have_their_distances() {
        assert_eq!([1.0, 1e9, 0.0].map(least), [2f64.powi(-51), 2f64.powi(-22), 0.0]);
    }

    #[test]
    fn a_step_of_one_digit_just_below_a_power_of_ten_is_that_power() {
        // the logarithm is below 3, the quotient of decimals that is meant is 1000
        assert_eq!([1000.0 * (1.0 - 1e-13), 1000.0 * (1.0 - 1e-11)].map(one_digit), [1000.0, 900.0]);
    }
}
