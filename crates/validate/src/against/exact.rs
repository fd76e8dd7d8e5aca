//! Integers of a source on another lattice, without the rounding of doubles: which of two lattice points is nearer is
//! then certain, and a tie is a tie.

use pointmill_format::AxisGrid;

/// `job = (source · times + plus) / parts`, to the nearest, ties to even.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Exact {
    times: i128,
    plus: i128,
    parts: i128,
    /// World units of one.
    unit: f64,
}

impl Exact {
    /// From integers on `source` to integers on `job`, if one decimal unit measures both.
    pub(crate) fn new(source: AxisGrid, job: AxisGrid) -> Option<Self> {
        let unit = AxisGrid::common(&[source, job])?.step;
        let whole = |length: f64| Some((length / unit).round()).filter(|n| n.abs() < 2f64.powi(62)).map(|n| n as i128);
        let (times, parts) = (whole(source.step)?, whole(job.step)?);
        (parts > 0).then_some(Self { times, plus: whole(source.offset - job.offset)?, parts, unit })
    }

    /// The nearest integer on the job's lattice.
    pub(crate) fn nearest(&self, source: i32) -> i64 {
        let units = i128::from(source) * self.times + self.plus;
        if self.parts == 1 {
            return units as i64;
        }
        let below = units.div_euclid(self.parts);
        let twice = 2 * units.rem_euclid(self.parts);
        let is_up = twice > self.parts || (twice == self.parts && below % 2 != 0);
        (below + i128::from(is_up)) as i64
    }

    /// True if every integer is one of the job's.
    pub(crate) fn is_whole(&self) -> bool {
        self.parts == 1
    }

    /// By how much [`Self::nearest`] moves an integer, world units. Doubles far from 0 could not tell.
    pub(crate) fn change(&self, source: i32) -> f64 {
        if self.parts == 1 {
            return 0.0;
        }
        let units = i128::from(source) * self.times + self.plus;
        (i128::from(self.nearest(source)) * self.parts - units) as f64 * self.unit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_go_to_the_even_side_wherever_they_lie() {
        let grid = |step, offset| AxisGrid { step, offset };
        let exact = Exact::new(grid(0.001, 0.0), grid(0.002, 0.0)).unwrap();
        assert_eq!([-3, -1, 1, 2, 3, 5].map(|q| exact.nearest(q)), [-2, 0, 0, 1, 2, 2]);
        assert_eq!([-3, 1, 2].map(|q| exact.change(q)), [-0.001, -0.001, 0.0]);
        let far = Exact::new(grid(0.001, 500_000.0), grid(0.005, 0.0)).unwrap();
        assert_eq!([2, 3, 7].map(|q| far.nearest(q)), [100_000_000, 100_000_001, 100_000_001]);
        assert_eq!(Exact::new(grid(1.0 / 3.0, 0.0), grid(0.1, 0.0)), None);
    }
}
