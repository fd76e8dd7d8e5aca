//! Eigenvalues of symmetric 3 × 3 matrices, and the eigenvector of the smallest: additions, multiplications, divisions and square roots
//! alone, so that every processor finds the same bits.
//!
//! Most neighbourhoods are near to a plane and far from a line. There the smallest root of the characteristic polynomial is found from
//! below (Newton's method never passes it), and the eigenvector is the normal of the plane that the rows of A − λ span. Where eigenvalues are near
//! to each other that loses digits, and rotations of Jacobi, which never do, take its place.

/// Rotations of all three pairs of axes that are enough for double precision, with some to spare: convergence is quadratic.
const SWEEPS: usize = 10;

/// A symmetric matrix: xx, xy, xz, yy, yz, zz.
pub(super) type Symmetric = [f64; 6];

/// Eigenvalues in ascending order, and the eigenvector of the first, of length 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Smallest {
    pub(super) values: [f64; 3],
    pub(super) vector: [f64; 3],
}

/// Of a matrix without negative eigenvalues whose trace is 1.
#[inline]
pub(super) fn smallest(matrix: &Symmetric) -> Smallest {
    by_polynomial(matrix).unwrap_or_else(|| by_rotations(matrix))
}

/// The middle eigenvalue must be at least this.
const FAR_FROM_LINE: f64 = 1e-2;

/// The smallest must be at most this part of the middle one.
const NEAR_PLANE: f64 = 0.7;

/// Steps of Newton's method: four or five are needed where the above holds.
const STEPS: usize = 12;

#[inline]
fn by_polynomial(&[xx, xy, xz, yy, yz, zz]: &Symmetric) -> Option<Smallest> {
    // λ³ - trace λ² + minors λ - determinant
    let trace = xx + yy + zz;
    let (m_x, m_y, m_z) = (yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
    let minors = m_x + m_y + m_z;
    let determinant = xx * m_x - xy * (xy * zz - xz * yz) + xz * (xy * yz - xz * yy);
    if minors < FAR_FROM_LINE / 3.0 {
        return None; // the middle eigenvalue is less than it has to be
    }
    let mut least = 0.0f64;
    for _ in 0..STEPS {
        let value = ((least - trace) * least + minors) * least - determinant;
        let slope = (3.0 * least - 2.0 * trace) * least + minors;
        let step = value / slope;
        least -= step;
        if step.abs() <= f64::EPSILON {
            break;
        }
    }
    // the others: their sum and their product
    let (sum, product) = (trace - least, minors - least * (trace - least));
    let root = (sum * sum - 4.0 * product).max(0.0).sqrt();
    let largest = (sum + root) / 2.0;
    let middle = product / largest;
    let is_clear = (FAR_FROM_LINE..=1.0).contains(&middle) && least.abs() <= 1.0 && least <= NEAR_PLANE * middle;
    if !is_clear {
        return None; // also where something is not a number
    }
    let (x, y, z) = ([xx - least, xy, xz], [xy, yy - least, yz], [xz, yz, zz - least]);
    let candidates = [cross(x, y), cross(x, z), cross(y, z)];
    let squares = candidates.map(|v| v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    let best =
        if squares[0] >= squares[1] && squares[0] >= squares[2] { 0 } else { 1 + usize::from(squares[2] > squares[1]) };
    let length = squares[best].sqrt();
    Some(Smallest { values: [least, middle, largest], vector: candidates[best].map(|v| v / length) })
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Of any matrix of finite entries.
fn by_rotations(matrix: &Symmetric) -> Smallest {
    let [xx, xy, xz, yy, yz, zz] = *matrix;
    let mut m = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        let others = m[0][1].abs() + m[0][2].abs() + m[1][2].abs();
        let all = m[0][0].abs() + m[1][1].abs() + m[2][2].abs();
        if others <= all * f64::EPSILON / 64.0 {
            break;
        }
        rotate::<0, 1, 2>(&mut m, &mut vectors);
        rotate::<0, 2, 1>(&mut m, &mut vectors);
        rotate::<1, 2, 0>(&mut m, &mut vectors);
    }
    let diagonal = [m[0][0], m[1][1], m[2][2]];
    let mut order = [0, 1, 2];
    order.sort_by(|a: &usize, b| diagonal[*a].total_cmp(&diagonal[*b]));
    let vector = vectors[order[0]];
    let length = (vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]).sqrt();
    Smallest { values: order.map(|i| diagonal[i]), vector: vector.map(|v| v / length) }
}

/// Turns axes P and Q so that their entry vanishes; R is the third one. Rows of `vectors` are the axes.
#[inline(always)]
fn rotate<const P: usize, const Q: usize, const R: usize>(m: &mut [[f64; 3]; 3], vectors: &mut [[f64; 3]; 3]) {
    let entry = m[P][Q];
    if entry == 0.0 {
        return;
    }
    // the smaller of the two angles (Golub and Van Loan, section 8.5)
    let tau = (m[Q][Q] - m[P][P]) / (2.0 * entry);
    let t = if tau >= 0.0 { 1.0 / (tau + (1.0 + tau * tau).sqrt()) } else { 1.0 / (tau - (1.0 + tau * tau).sqrt()) };
    let c = 1.0 / (1.0 + t * t).sqrt();
    let s = t * c;
    m[P][P] -= t * entry;
    m[Q][Q] += t * entry;
    (m[P][Q], m[Q][P]) = (0.0, 0.0);
    let (p, q) = (m[R][P], m[R][Q]);
    m[R][P] = c * p - s * q;
    m[R][Q] = s * p + c * q;
    (m[P][R], m[Q][R]) = (m[R][P], m[R][Q]);
    let (p, q) = (vectors[P], vectors[Q]);
    vectors[P] = [0, 1, 2].map(|i| c * p[i] - s * q[i]);
    vectors[Q] = [0, 1, 2].map(|i| s * p[i] + c * q[i]);
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn times([xx, xy, xz, yy, yz, zz]: &Symmetric, v: [f64; 3]) -> [f64; 3] {
        [xx * v[0] + xy * v[1] + xz * v[2], xy * v[0] + yy * v[1] + yz * v[2], xz * v[0] + yz * v[1] + zz * v[2]]
    }

    fn check(found: &Smallest, matrix: &Symmetric, accuracy: f64) {
        let Smallest { values, vector } = *found;
        let size = matrix.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        assert!(values.is_sorted(), "{values:?}");
        let length: f64 = vector.iter().map(|v| v * v).sum();
        assert!((length - 1.0).abs() < 1e-15, "{length}");
        let image = times(matrix, vector);
        for a in 0..3 {
            assert!((image[a] - values[0] * vector[a]).abs() <= accuracy * size, "{matrix:?}: {image:?} {values:?}");
        }
        // coefficients of the characteristic polynomial
        let [xx, xy, xz, yy, yz, zz] = *matrix;
        let minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz;
        let [a, b, c] = values;
        assert!((a + b + c - xx - yy - zz).abs() <= 4.0 * accuracy * size);
        assert!((a * b + a * c + b * c - minors).abs() <= 10.0 * accuracy * size * size);
    }

    /// A random one without negative eigenvalues, its axes of such sizes.
    fn random_matrix(random: &mut Random, sizes: [f64; 3]) -> Symmetric {
        let mut sum = [0.0; 6];
        for axis in sizes {
            let mut next = || random.below(1 << 30) as f64 / (1 << 29) as f64 - 1.0;
            let v = [next(), next(), next()];
            for (k, (a, b)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
                sum[k] += axis * v[a] * v[b];
            }
        }
        sum
    }

    #[test]
    fn the_residual_is_bounded_for_matrices_of_all_shapes_and_sizes() {
        let mut random = Random::new(12);
        let mut clear = 0;
        for i in 0..200_000 {
            let flat = [1.0, 1e-3, 1e-8, 1e-12, 0.0];
            let sum = random_matrix(&mut random, [1.0, flat[i % 5], flat[i / 5 % 5]]);
            let size = [1.0, 1e-30, 1e30][i / 25 % 3];
            let scaled = sum.map(|v| v * size);
            check(&by_rotations(&scaled), &scaled, 1e-15);
            let trace = sum[0] + sum[3] + sum[5];
            let unit = sum.map(|v| v / trace);
            check(&smallest(&unit), &unit, 3e-14);
            if let Some(found) = by_polynomial(&unit) {
                clear += 1;
                let other = by_rotations(&unit);
                let cos: f64 = (0..3).map(|a| found.vector[a] * other.vector[a]).sum();
                let sin = cross(found.vector, other.vector).iter().map(|v| v * v).sum::<f64>().sqrt();
                assert!(sin < 1e-11 && cos.abs() > 0.99, "{unit:?}: {sin}");
                assert!((found.values[0] - other.values[0]).abs() < 1e-13);
            }
        }
        assert!(clear > 50_000, "{clear}");
    }

    #[test]
    fn equal_and_vanishing_eigenvalues_are_no_trouble() {
        let third = 1.0 / 3.0;
        let matrices = [
            [0.0; 6],
            [third, 0.0, 0.0, third, 0.0, third],
            [third, third / 2.0, third / 2.0, third, third / 2.0, third],
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.5, 0.0, 0.0, 0.5, 0.0, 0.0],
        ];
        for matrix in matrices {
            check(&smallest(&matrix), &matrix, 1e-15);
        }
        let found = by_rotations(&[4.0, 0.0, 0.0, 9.0, 0.0, 1.0]);
        assert_eq!(found, Smallest { values: [1.0, 4.0, 9.0], vector: [0.0, 0.0, 1.0] });
    }
}
