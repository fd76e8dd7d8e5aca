//! How far single precision may move a point (§5 of the page).

/// The largest distance between a lattice point and its decoded position on an axis: rounding an offset of at most
/// `half_extent` to single, and two roundings of coordinates of up to `magnitude` to double.
pub(super) fn bound(half_extent: f64, magnitude: f64) -> f64 {
    let single = if half_extent > 0.0 { power_of_two(exponent(half_extent).max(-126) - 24) } else { 0.0 };
    single + 2.0 * power_of_two(exponent(magnitude) - 52)
}

/// ⌊log₂ v⌋ of a normal, positive number; of 0 and of what is smaller, −1023.
fn exponent(v: f64) -> i32 {
    (v.abs().to_bits() >> 52) as i32 - 1023
}

fn power_of_two(exponent: i32) -> f64 {
    2f64.powi(exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_those_of_the_page() {
        let mm = |h: f64| bound(h, 0.0) * 1000.0;
        for (h, expected) in [(1.0, 0.00006), (50.0, 0.0019), (1000.0, 0.031), (10_000.0, 0.49), (16_000.0, 0.49)] {
            assert!((mm(h) / expected - 1.0).abs() < 0.05, "{h}: {}", mm(h));
        }
        assert!((bound(0.0, 1e7) - 2.0 * 1.86e-9).abs() < 1e-11);
        assert!(bound(0.0, 0.0) < 1e-300);
    }

    #[test]
    fn the_bound_is_kept_by_every_rounding_and_nearly_attained() {
        let mut worst: f64 = 0.0;
        for i in 0..100_000u32 {
            let dx = 50.0 * f64::from(i) / 100_000.0;
            worst = worst.max((f64::from(dx as f32) - dx).abs());
        }
        let bound = bound(50.0, 0.0);
        assert!(worst <= bound && worst > 0.99 * bound, "{worst} {bound}");
    }
}
