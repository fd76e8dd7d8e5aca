//! The median of what came last.

/// Five values in order, of which the largest and the smallest are replaced in turn, as LASzip's predictor of
/// coordinates does: the largest until a value comes that is not below the median, then the smallest until one comes
/// that is not above it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Median {
    values: [i32; 5],
    drops_largest: bool,
}

impl Median {
    pub(super) const fn new() -> Self {
        Self { values: [0; 5], drops_largest: true }
    }

    #[inline(always)]
    pub(super) fn get(&self) -> i32 {
        self.values[2]
    }

    /// Without a branch that depends on the values.
    #[inline(always)]
    pub(super) fn add(&mut self, value: i32) {
        let (median, drops_smallest) = (self.values[2], usize::from(!self.drops_largest));
        self.drops_largest = (value < median) | ((value == median) & !self.drops_largest);
        let kept: [i32; 4] = std::array::from_fn(|i| self.values[drops_smallest + i]);
        self.values = [
            kept[0].min(value),
            kept[0].max(kept[1].min(value)),
            kept[1].max(kept[2].min(value)),
            kept[2].max(kept[3].min(value)),
            kept[3].max(value),
        ];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stay_in_order_and_the_ends_are_replaced_in_turn() {
        let mut median = Median::new();
        let mut after = |values: &[i32]| {
            values.iter().for_each(|value| median.add(*value));
            (median.values, median.drops_largest)
        };
        assert_eq!(after(&[-5]), ([-5, 0, 0, 0, 0], true), "below the median: the largest is dropped again");
        assert_eq!(after(&[7]), ([-5, 0, 0, 0, 7], false));
        assert_eq!(after(&[9]), ([0, 0, 0, 7, 9], false), "the smallest, until a value is not above the median");
        assert_eq!(after(&[8]), ([0, 0, 7, 8, 9], false));
        assert_eq!(after(&[7]), ([0, 7, 7, 8, 9], true));
        assert_eq!(after(&[i32::MIN, i32::MAX]), ([i32::MIN, 0, 7, 7, i32::MAX], false));
    }
}
