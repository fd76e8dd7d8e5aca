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
