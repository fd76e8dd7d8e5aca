//! Eigenvalues and eigenvectors of symmetric 3 × 3 matrices, by rotations of Jacobi: additions, multiplications, divisions and
//! square roots alone, so that every processor finds the same bits.

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

/// Entries must be finite.
#[inline]
pub(super) fn smallest(matrix: &Symmetric) -> Smallest {
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
    for i in 0..3 {
        let (p, q) = (vectors[P][i], vectors[Q][i]);
        vectors[P][i] = c * p - s * q;
        vectors[Q][i] = s * p + c * q;
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn times([xx, xy, xz, yy, yz, zz]: &Symmetric, v: [f64; 3]) -> [f64; 3] {
        [xx * v[0] + xy * v[1] + xz * v[2], xy * v[0] + yy * v[1] + yz * v[2], xz * v[0] + yz * v[1] + zz * v[2]]
    }

    fn check(matrix: &Symmetric) {
        let Smallest { values, vector } = smallest(matrix);
        let size = matrix.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        assert!(values.is_sorted());
        let length: f64 = vector.iter().map(|v| v * v).sum();
        assert!((length - 1.0).abs() < 1e-15, "{length}");
        let image = times(matrix, vector);
        for a in 0..3 {
            assert!((image[a] - values[0] * vector[a]).abs() <= 1e-15 * size, "{matrix:?}: {image:?} {values:?}");
        }
        // coefficients of the characteristic polynomial
        let [xx, xy, xz, yy, yz, zz] = *matrix;
        let minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz;
        let [a, b, c] = values;
        assert!((a + b + c - xx - yy - zz).abs() <= 4e-15 * size);
        assert!((a * b + a * c + b * c - minors).abs() <= 1e-14 * size * size);
    }

    #[test]
    fn the_residual_is_bounded_for_matrices_of_all_shapes_and_sizes() {
        let mut random = Random::new(12);
        for i in 0..200_000 {
            let flat = [1.0, 1e-3, 1e-8, 1e-12, 0.0];
            let sizes = [1.0, flat[i % 5], flat[i / 5 % 5]];
            let size = [1.0, 1e-30, 1e30][i / 25 % 3];
            let mut sum = [0.0; 6];
            for axis in sizes {
                let mut next = || random.below(1 << 30) as f64 / (1 << 29) as f64 - 1.0;
                let v = [next(), next(), next()];
                for (k, (a, b)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
                    sum[k] += axis * v[a] * v[b] * size;
                }
            }
            check(&sum);
        }
    }

    #[test]
    fn equal_and_vanishing_eigenvalues_are_no_trouble() {
        for matrix in
            [[0.0; 6], [1.0, 0.0, 0.0, 1.0, 0.0, 1.0], [2.0, 1.0, 1.0, 2.0, 1.0, 2.0], [5.0, 0.0, 0.0, 0.0, 0.0, 0.0]]
        {
            check(&matrix);
        }
        assert_eq!(
            smallest(&[4.0, 0.0, 0.0, 9.0, 0.0, 1.0]),
            Smallest { values: [1.0, 4.0, 9.0], vector: [0.0, 0.0, 1.0] }
        );
    }
}
