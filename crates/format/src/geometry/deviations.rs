//! How far positions are from those that they stand for.

/// What sums over points tell of the differences of positions, decoded less meant. World units.
///
/// ```
/// use pointmill_format::Deviations;
///
/// let mut d = Deviations::default();
/// d.add([0.5, 0.0, -0.25]);
/// d.add([-0.5, 0.0, -0.25]);
/// assert_eq!((d.points, d.max, d.sum), (2, [0.5, 0.0, 0.25], [0.0, 0.0, -0.5]));
/// ```
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Deviations {
    /// Points that were looked at.
    pub points: u64,
    /// Largest, without its sign.
    pub max: [f64; 3],
    /// Sum, with signs.
    pub sum: [f64; 3],
    /// Sum of squares.
    pub squares: [f64; 3],
    /// Square of the largest distance in space.
    pub max_squared_3d: f64,
}

impl Deviations {
    /// Takes in a point.
    #[inline]
    pub fn add(&mut self, difference: [f64; 3]) {
        let squares = difference.map(|d| d * d);
        let distance = squares[0] + squares[1] + squares[2];
        for a in 0..3 {
            let size = difference[a].abs();
            // not `f64::max`: one instruction, and no difference is NaN
            self.max[a] = if size > self.max[a] { size } else { self.max[a] };
            self.sum[a] += difference[a];
            self.squares[a] += squares[a];
        }
        self.max_squared_3d = if distance > self.max_squared_3d { distance } else { self.max_squared_3d };
        self.points += 1;
    }

    /// Takes in other points. Sums of doubles depend on the order in their last bits.
    pub fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for a in 0..3 {
            self.max[a] = self.max[a].max(other.max[a]);
            self.sum[a] += other.sum[a];
            self.squares[a] += other.squares[a];
        }
        self.max_squared_3d = self.max_squared_3d.max(other.max_squared_3d);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn largest_and_sums_of_all_axes_whatever_the_sign() {
        let (mut a, mut b) = (Deviations::default(), Deviations::default());
        a.add([-3.0, 0.5, 0.0]);
        b.add([1.0, -2.0, 2.0]);
        b.add([1.0, 0.0, 0.0]);
        a.merge(&b);
        assert_eq!((a.points, a.max, a.sum), (3, [3.0, 2.0, 2.0], [-1.0, -1.5, 2.0]));
        assert_eq!((a.squares, a.max_squared_3d), ([11.0, 4.25, 4.0], 9.25));
        b.merge(&a);
        assert_eq!((b.points, b.max, b.max_squared_3d), (5, [3.0, 2.0, 2.0], 9.25));
    }

    #[test]
    fn sums_of_doubles_err_by_no_more_than_their_roundings() {
        // the doubles next to 0.1 and 1/3: the exact sum is that many times their mantissas, in 128 bits
        const POINTS: u32 = 1 << 21;
        let (tenth, third) = (0.1f64, 1.0 / 3.0f64);
        let mut d = Deviations::default();
        (0..POINTS).for_each(|_| d.add([tenth, -third, 0.0]));
        let exact = |v: f64, unit: i32| u128::from(POINTS) * (v / 2f64.powi(unit)) as u128;
        for (sum, v, unit) in [(d.sum[0], tenth, -56), (-d.sum[1], third, -54)] {
            let error = exact(v, unit) as i128 - (sum / 2f64.powi(unit)) as i128;
            // (n - 1) · 2^-53 of the sum of the sizes
            let bound = (exact(v, unit) * u128::from(POINTS - 1)) >> 53;
            assert!(error != 0 && error.unsigned_abs() <= bound, "{error} of {bound}");
        }
    }

    #[test]
    fn distances_are_of_all_three_axes() {
        for (difference, squared) in [([2.0, 0.0, 0.0], 4.0), ([0.0, -2.0, 0.0], 4.0), ([1.0, -2.0, 2.0], 9.0)] {
            let mut d = Deviations::default();
            d.add(difference);
            assert_eq!((d.max_squared_3d, d.max), (squared, difference.map(f64::abs)));
        }
    }
}
