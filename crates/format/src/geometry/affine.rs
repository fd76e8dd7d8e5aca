//! Affine maps of world coordinates.

use std::fmt;

use super::Aabb;
#[cfg(feature = "depth")]
use super::Lattice;

/// An affine map of world coordinates that can be undone: `out[i] = Σ linear[i][j] · in[j] + translation[i]`.
///
/// ```
/// use pointmill_format::Affine;
///
/// // a quarter turn about z, then 100 to the east
/// let matrix = [0., -1., 0., 100., 1., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
/// let map = Affine::from_matrix(&matrix)?;
/// assert_eq!(map.apply([1.0, 2.0, 3.0]), [98.0, 1.0, 3.0]);
/// assert!(Affine::from_matrix(&[0.0; 16]).is_err());
/// # Ok::<(), pointmill_format::AffineFault>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    linear: [[f64; 3]; 3],
    translation: [f64; 3],
}

/// Why a matrix is no map of points that can be undone.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum AffineFault {
    /// A number is infinite or NaN.
    NotFinite,
    /// The last row is not 0 0 0 1.
    LastRow([f64; 4]),
    /// The last row is not 0 0 0 1, but the last column is: the matrix is written column by column.
    Transposed,
    /// The linear part is singular, or so small or large that its determinant cannot be computed.
    Singular,
}

impl fmt::Display for AffineFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("a number is not finite"),
            Self::LastRow([a, b, c, d]) => write!(f, "the last row is {a} {b} {c} {d}, not 0 0 0 1"),
            Self::Transposed => {
                f.write_str("the last column is 0 0 0 1, not the last row; write the matrix row by row")
            }
            Self::Singular => f.write_str("the matrix is singular: it cannot be undone"),
        }
    }
}

impl std::error::Error for AffineFault {}

/// The least determinant over the product of the lengths of the rows: below, nothing but rounding errors is left of it.
const LEAST_INDEPENDENCE: f64 = 1e-12;

impl Affine {
    /// The map that changes nothing.
    pub const IDENTITY: Self =
        Self { linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// From y up to z up, a quarter turn about x: (x, y, z) becomes (x, −z, y).
    pub const Y_UP: Self = Self { linear: [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]], translation: [0.0; 3] };

    /// The map of a 4 × 4 matrix, row by row, for column vectors: the translation is in the last column.
    ///
    /// # Errors
    /// A matrix that is not affine, singular, or not finite.
    pub fn from_matrix(m: &[f64; 16]) -> Result<Self, AffineFault> {
        if !m.iter().all(|v| v.is_finite()) {
            return Err(AffineFault::NotFinite);
        }
        let last = [0.0, 0.0, 0.0, 1.0];
        if m[12..] != last {
            let is_transposed = [m[3], m[7], m[11], m[15]] == last;
            let row = AffineFault::LastRow([m[12], m[13], m[14], m[15]]);
            return Err(if is_transposed { AffineFault::Transposed } else { row });
        }
        let map = Self {
            linear: [[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]],
            translation: [m[3], m[7], m[11]],
        };
        let lengths: f64 = map.linear.iter().map(|row| length(*row)).product();
        let is_regular = map.determinant().abs() > LEAST_INDEPENDENCE * lengths && lengths.is_finite();
        if is_regular { Ok(map) } else { Err(AffineFault::Singular) }
    }

    /// Multiplies each axis by a factor, finite and not 0.
    #[must_use]
    pub fn scaling([x, y, z]: [f64; 3]) -> Self {
        Self { linear: [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]], translation: [0.0; 3] }
    }

    /// This map first, then `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let column = |j: usize| self.linear.map(|row| row[j]);
        let columns = [0, 1, 2].map(|j| next.turn(column(j)));
        Self {
            linear: std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i])),
            translation: next.apply(self.translation),
        }
    }

    /// The image of a point.
    #[must_use]
    pub fn apply(&self, point: [f64; 3]) -> [f64; 3] {
        let turned = self.turn(point);
        std::array::from_fn(|i| turned[i] + self.translation[i])
    }

    /// The image of a difference of points: the linear part alone.
    #[must_use]
    pub fn turn(&self, v: [f64; 3]) -> [f64; 3] {
        self.linear.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }

    /// The first row that takes points where no coordinate can be ([`Lattice::is_sound_offset`]).
    #[cfg(feature = "depth")]
    pub(crate) fn misplaced_row(&self) -> Option<usize> {
        let factors = Lattice::FINEST_STEP..=1.0 / Lattice::FINEST_STEP;
        let largest = |row: &[f64; 3]| row.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
        let is_sound =
            |(row, offset): (&[f64; 3], f64)| factors.contains(&largest(row)) && Lattice::is_sound_offset(offset);
        self.linear.iter().zip(self.translation).position(|row| !is_sound(row))
    }

    /// The linear part, by row.
    pub const fn linear(&self) -> &[[f64; 3]; 3] {
        &self.linear
    }

    /// The image of the origin.
    pub const fn translation(&self) -> [f64; 3] {
        self.translation
    }

    /// The box around the image of a box.
    #[must_use]
    pub fn bounds(&self, bounds: &Aabb) -> Aabb {
        let mut out = Aabb { min: self.translation, max: self.translation };
        for (i, row) in self.linear.iter().enumerate() {
            for (j, factor) in row.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
                let ends = [factor * bounds.min[j], factor * bounds.max[j]];
                out.min[i] += ends[0].min(ends[1]);
                out.max[i] += ends[0].max(ends[1]);
            }
        }
        out
    }

    /// If each axis of the image follows one axis alone: that axis and its factor, for x, y and z of the image.
    pub fn axes(&self) -> Option<[(usize, f64); 3]> {
        let mut axes = [(0, 0.0); 3];
        for (axis, row) in axes.iter_mut().zip(&self.linear) {
            let mut factors = row.iter().copied().enumerate().filter(|(_, factor)| *factor != 0.0);
            *axis = factors.next()?;
            if factors.next().is_some() {
                return None;
            }
        }
        Some(axes)
    }

    /// What turns normals: the transposed inverse of the linear part, by row. Lengths change, but for a rotation.
    #[must_use]
    pub fn of_normals(&self) -> [[f64; 3]; 3] {
        let determinant = self.determinant();
        self.cofactors().map(|row| row.map(|v| v / determinant))
    }

    fn determinant(&self) -> f64 {
        let (row, cofactors) = (self.linear[0], self.cofactors()[0]);
        row[0] * cofactors[0] + row[1] * cofactors[1] + row[2] * cofactors[2]
    }

    fn cofactors(&self) -> [[f64; 3]; 3] {
        let m = &self.linear;
        std::array::from_fn(|i| {
            let (a, b) = ((i + 1) % 3, (i + 2) % 3);
            std::array::from_fn(|j| {
                let (c, d) = ((j + 1) % 3, (j + 2) % 3);
                m[a][c] * m[b][d] - m[a][d] * m[b][c]
            })
        })
    }
}

impl fmt::Display for Affine {
    /// The 16 numbers that [`Self::from_matrix`] takes, separated by blanks.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for ([a, b, c], t) in self.linear.iter().zip(self.translation) {
            write!(f, "{a} {b} {c} {t} ")?;
        }
        f.write_str("0 0 0 1")
    }
}

fn length(v: [f64; 3]) -> f64 {
    v[0].hypot(v[1]).hypot(v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(linear: [[f64; 3]; 3], t: [f64; 3]) -> [f64; 16] {
        let [a, b, c] = linear;
        [a[0], a[1], a[2], t[0], b[0], b[1], b[2], t[1], c[0], c[1], c[2], t[2], 0.0, 0.0, 0.0, 1.0]
    }

    #[test]
    fn y_up_is_a_rotation() {
        assert_eq!(Affine::Y_UP.apply([1.0, 2.0, 3.0]), [1.0, -3.0, 2.0]);
        assert_eq!(Affine::Y_UP.determinant(), 1.0);
        assert_eq!(Affine::Y_UP.axes(), Some([(0, 1.0), (2, -1.0), (1, 1.0)]));
        assert_eq!(Affine::Y_UP.of_normals(), *Affine::Y_UP.linear());
    }

    #[test]
    fn one_map_after_the_other() {
        let shift = Affine::from_matrix(&matrix(*Affine::IDENTITY.linear(), [10.0, 20.0, 30.0])).unwrap();
        let both = Affine::scaling([2.0; 3]).then(&Affine::Y_UP).then(&shift);
        assert_eq!(both.apply([1.0, 2.0, 3.0]), [12.0, 14.0, 34.0]);
        assert_eq!(shift.then(&Affine::Y_UP).apply([0.0; 3]), [10.0, -30.0, 20.0]);
    }

    #[test]
    fn bounds_hold_the_images_of_all_corners() {
        let turn = Affine::from_matrix(&matrix([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, -1.0]], [5.0, 0.0, 0.0]));
        let b = turn.unwrap().bounds(&Aabb { min: [0.0; 3], max: [10.0, 5.0, 1.0] });
        assert_eq!((b.min, b.max), ([1.0, 0.0, -1.0], [11.0, 11.0, 0.0]));
    }

    #[test]
    fn normals_stay_at_right_angles_where_axes_are_stretched() {
        let stretch = Affine::scaling([2.0, 1.0, -1.0]);
        // the plane x + y = 0 with the normal (1, 1, 0) and the tangent (1, -1, 0)
        let normal = stretch.of_normals().map(|row| row[0] + row[1]);
        let tangent = stretch.turn([1.0, -1.0, 0.0]);
        assert_eq!(normal.iter().zip(tangent).map(|(a, b)| a * b).sum::<f64>(), 0.0);
    }

    #[test]
    fn what_cannot_be_undone_is_refused() {
        let regular = [[2.0, 0.0, 0.0], [0.0, 1e-9, 0.0], [0.0, 0.0, -3.0]];
        assert!(Affine::from_matrix(&matrix(regular, [1e9; 3])).is_ok(), "small is not singular");
        let flat = [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 0.0, 1.0]];
        let sevenths = [[0.1, 0.7, 0.0], [0.3, 2.1, 0.0], [0.0, 0.0, 1.0]];
        for linear in [flat, sevenths, [[0.0; 3]; 3], [[1e200, 0.0, 0.0], [0.0, 1e200, 0.0], [0.0, 0.0, 1.0]]] {
            assert_eq!(Affine::from_matrix(&matrix(linear, [0.0; 3])), Err(AffineFault::Singular), "{linear:?}");
        }
        let mut m = matrix(regular, [f64::NAN, 0.0, 0.0]);
        assert_eq!(Affine::from_matrix(&m), Err(AffineFault::NotFinite));
        (m[3], m[12], m[15]) = (0.0, 7.0, 1.0);
        assert_eq!(Affine::from_matrix(&m), Err(AffineFault::Transposed));
        (m[3], m[12], m[15]) = (1.0, 0.0, 2.0);
        assert_eq!(Affine::from_matrix(&m), Err(AffineFault::LastRow([0.0, 0.0, 0.0, 2.0])));
    }

    #[test]
    fn images_far_from_0_are_doubles() {
        // all factors are sums of powers of two: nothing is rounded, but in single precision
        let linear = [[0.75, -0.5, 0.25], [0.5, 0.75, -0.25], [0.25, -0.25, 1.5]];
        let map = Affine::from_matrix(&matrix(linear, [1e6, -2e6, 0.5])).unwrap();
        assert_eq!(map.turn([5_000_001.0, 0.25, -0.25]), [3_750_000.562_5, 2_500_000.75, 1_249_999.812_5]);
        assert_eq!(map.apply([5_000_001.0, 0.25, -0.25]), [4_750_000.562_5, 500_000.75, 1_250_000.312_5]);
    }

    #[test]
    fn what_is_written_is_what_is_read() {
        // 2 · (3·5 − 1·(−1)) − 1 · (0.5·5 − 1·2) + 4 · (0.5·(−1) − 3·2): the product of no row alone
        let linear = [[2.0, 1.0, 4.0], [0.5, 3.0, 1.0], [2.0, -1.0, 5.0]];
        let map = Affine::from_matrix(&matrix(linear, [7.0, -8.0, 9.5])).unwrap();
        assert_eq!((map.linear(), map.translation(), map.determinant()), (&linear, [7.0, -8.0, 9.5], 5.5));
        assert_eq!(map.to_string(), "2 1 4 7 0.5 3 1 -8 2 -1 5 9.5 0 0 0 1");
        assert!(AffineFault::Singular.to_string().contains("singular"));
        // the transposed inverse: its rows times those of the matrix are the unit matrix
        for (i, normal) in map.of_normals().iter().enumerate() {
            for (j, row) in linear.iter().enumerate() {
                let product: f64 = normal.iter().zip(row).map(|(a, b)| a * b).sum();
                // five operations on numbers below 16 / 5.5, the quotients among them
                assert!((product - f64::from(u8::from(i == j))).abs() < 5.0 * 16.0 * f64::EPSILON, "{i} {j}");
            }
        }
    }
}
