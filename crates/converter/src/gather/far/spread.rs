//! How the coordinates of an axis spread over orders of magnitude: a histogram whose bins are as wide as a sixteenth of
//! the coordinates in them.

use std::collections::BTreeMap;

/// The points of a bin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bin {
    pub(super) points: u64,
    pub(super) min: f64,
    pub(super) max: f64,
}

/// Bins in ascending order of their coordinates.
#[derive(Debug, Clone, Default)]
pub(super) struct Spread(BTreeMap<u16, Bin>);

/// Points at one end of an axis that a gap parts from the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trimmed {
    pub(super) min: f64,
    pub(super) max: f64,
    /// Points beyond.
    pub(super) points: u64,
}

impl Spread {
    pub(super) fn add(&mut self, value: f64) {
        let bits = value.to_bits();
        let ordered = if value.is_sign_negative() { !bits } else { bits | 1 << 63 };
        let bin = self.0.entry((ordered >> 48) as u16).or_insert(Bin { points: 0, min: value, max: value });
        bin.points += 1;
        bin.min = bin.min.min(value);
        bin.max = bin.max.max(value);
    }

    pub(super) fn merge(&mut self, other: Self) {
        for (key, more) in other.0 {
            let bin = self.0.entry(key).or_insert(Bin { points: 0, ..more });
            bin.points += more.points;
            bin.min = bin.min.min(more.min);
            bin.max = bin.max.max(more.max);
        }
    }

    /// Takes away the smaller part beyond the widest gap, again and again, as long as the rest is longer than `enough` and
    /// the gap is a good part of it. Two thirds of the points always stay.
    pub(super) fn trimmed(&self, enough: f64) -> Option<Trimmed> {
        let all: Vec<Bin> = self.0.values().copied().collect();
        let points = |bins: &[Bin]| bins.iter().map(|b| b.points).sum::<u64>();
        let (mut bins, mut away) = (&all[..], 0);
        while let [first, .., last] = bins {
            let extent = last.max - first.min;
            let gap = |pair: &[Bin]| pair[1].min - pair[0].max;
            let widest = bins.windows(2).enumerate().max_by(|(_, a), (_, b)| gap(a).total_cmp(&gap(b)));
            let Some((at, pair)) = widest else { break };
            let (low, high) = bins.split_at(at + 1);
            let (few, rest) = if points(low) <= points(high) { (low, high) } else { (high, low) };
            if extent <= enough || gap(pair) * GOOD_PART < extent || 3 * (away + points(few)) >= points(&all) {
                break;
            }
            away += points(few);
            bins = rest;
        }
        Some(Trimmed { min: bins.first()?.min, max: bins.last()?.max, points: away })
    }
}

/// A gap parts far points from the rest if it is at least one in so many parts of the whole.
const GOOD_PART: f64 = 8.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn trimmed(values: &[f64], enough: f64) -> (f64, f64, u64) {
        let mut spread = Spread::default();
        values.iter().for_each(|v| spread.add(*v));
        let t = spread.trimmed(enough).unwrap();
        (t.min, t.max, t.points)
    }

    #[test]
    fn far_ends_go_however_many_magnitudes_they_span() {
        assert_eq!(trimmed(&[700.0, 800.0, 0.0, 1e18], 1e3), (0.0, 800.0, 1));
        let mut many: Vec<f64> = (0..200).map(|i| 5e6 + f64::from(i)).collect();
        many.extend([-1e12, 1e9, 1e10, 1e11, 1e12, 0.0]);
        assert_eq!(trimmed(&many, 1e3), (5e6, 5e6 + 199.0, 6));
    }

    #[test]
    fn what_fits_stays_and_so_does_the_larger_half() {
        assert_eq!(trimmed(&[0.0, 10.0, 500.0, 900.0], 1e3), (0.0, 900.0, 0));
        assert_eq!(trimmed(&[0.0, 1.0, 1e9, 1e9 + 1.0], 1e3), (0.0, 1e9 + 1.0, 0));
        assert_eq!(trimmed(&[-3.0, -2.0, -1e9], 1.0), (-1e9, -2.0, 0), "a third is no handful");
        assert_eq!(trimmed(&[-3.0, -2.0, -2.5, -1e9], 1.0), (-3.0, -2.0, 1));
        assert_eq!(trimmed(&[5.0, 5.0, 5.0, 1e9], 1.0), (5.0, 5.0, 1));
        let mut near: Vec<f64> = (0..20).map(|i| f64::from(i) / 2.0).collect();
        near.extend((0..310).map(|i| 1e8 + f64::from(i)));
        assert_eq!(trimmed(&near, 2e6), (1e8, 1e8 + 309.0, 20), "the smaller part goes, on whichever side");
    }

    #[test]
    fn histograms_of_threads_add_up() {
        let (mut a, mut b) = (Spread::default(), Spread::default());
        [1.0, 1.01].iter().for_each(|v| a.add(*v));
        [0.999, 1e7].iter().for_each(|v| b.add(*v));
        a.merge(b);
        assert_eq!(a.trimmed(1.0), Some(Trimmed { min: 0.999, max: 1.01, points: 1 }));
    }
}
