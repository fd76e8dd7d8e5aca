//! Eight numbers at once, in a form that compilers make vectors of.

/// Numbers that are compared at once.
pub(super) const LANES: usize = 8;

/// Bit `i` is set if number `i` is at most `bound`.
#[inline(always)]
pub(super) fn at_most(values: &[f32; LANES], bound: f32) -> u32 {
    let mut hits = [0u32; LANES];
    for (i, hit) in hits.iter_mut().enumerate() {
        *hit = u32::from(values[i] <= bound) << i;
    }
    hits.into_iter().fold(0, |any, hit| any | hit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_equal_count_and_others_do_not() {
        let values = [1.0, 2.0, 3.0, f32::NAN, f32::NEG_INFINITY, 2.0f32.next_up(), 0.0, f32::INFINITY];
        assert_eq!(at_most(&values, 2.0), 0b0101_0011);
        assert_eq!(at_most(&values, f32::INFINITY), 0b1111_0111);
    }
}
