//! Eigenvalues and eigenvectors of symmetric 3 × 3 matrices, by Jacobi's method: plain, and as exact for small eigenvalues as
//! doubles allow.

/// Eigenvalues, ascending, and the eigenvector of the first, of length 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Eigen {
    pub(super) values: [f64; 3],
    pub(super) vector: [f64; 3],
}

/// More sweeps than any matrix takes: convergence is quadratic.
const SWEEPS: usize = 60;

/// Of a symmetric matrix.
pub(super) fn eigen(mut m: [[f64; 3]; 3]) -> Eigen {
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        if m[0][1] == 0.0 && m[0][2] == 0.0 && m[1][2] == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut m, &mut vectors, p, q);
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| m[*a][*a].total_cmp(&m[*b][*b]));
    let vector = [0, 1, 2].map(|row: usize| vectors[row][order[0]]);
    Eigen { values: order.map(|i| m[i][i]), vector }
}

/// Makes the element (p, q) 0 by a rotation.
fn rotate(m: &mut [[f64; 3]; 3], vectors: &mut [[f64; 3]; 3], p: usize, q: usize) {
    let off = m[p][q];
    // what is lost in the rounding of both diagonal elements is 0
    if off.abs() <= f64::EPSILON * 1e-3 * m[p][p].abs().min(m[q][q].abs()) || off == 0.0 {
        (m[p][q], m[q][p]) = (0.0, 0.0);
        return;
    }
    let theta = (m[q][q] - m[p][p]) / (2.0 * off);
    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let c = 1.0 / t.hypot(1.0);
    let s = t * c;
    let r = 3 - p - q;
    (m[p][p], m[q][q]) = (m[p][p] - t * off, m[q][q] + t * off);
    let (rp, rq) = (m[r][p], m[r][q]);
    (m[r][p], m[r][q]) = (c * rp - s * rq, s * rp + c * rq);
    (m[p][r], m[q][r]) = (m[r][p], m[r][q]);
    (m[p][q], m[q][p]) = (0.0, 0.0);
    for row in vectors {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    /// R · diag(values) · Rᵀ, R of a random unit quaternion; and the first column of R.
    fn matrix(random: &mut Random, values: [f64; 3]) -> ([[f64; 3]; 3], [f64; 3]) {
        let mut next = || random.below(2_000_001) as f64 / 1e6 - 1.0;
        let q: [f64; 4] = std::array::from_fn(|_| next() + 1e-3);
        let n = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        let [w, x, y, z] = q.map(|v| v / n);
        let r = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let element = |i: usize, j: usize| (0..3).map(|k| r[i][k] * values[k] * r[j][k]).sum::<f64>();
        let m = [0, 1, 2].map(|i: usize| [0, 1, 2].map(|j| element(i.max(j), i.min(j))));
        (m, [r[0][0], r[1][0], r[2][0]])
    }

    #[test]
    fn values_and_vectors_of_known_matrices_come_back() {
        let mut random = Random::new(3);
        for values in [[1.0, 2.0, 3.0], [0.0, 1.0, 1.0], [1e-9, 1.0, 5.0], [2.0, 2.0, 7.0], [1e-3, 1.0, 1e6]] {
            for _ in 0..200 {
                let (m, axis) = matrix(&mut random, values);
                let found = eigen(m);
                let largest = values[2];
                for (found, right) in found.values.iter().zip(values) {
                    assert!((found - right).abs() <= 1e-14 * largest, "{found} {right}");
                }
                let length = found.vector.iter().map(|v| v * v).sum::<f64>();
                assert!((length - 1.0).abs() < 1e-14, "{length}");
                if values[1] > 1.5 * values[0] {
                    let cosine: f64 = (0..3).map(|a| found.vector[a] * axis[a]).sum();
                    let gap = 1e-14 * largest / (values[1] - values[0]);
                    assert!(1.0 - cosine.abs() <= 1e-14 + gap * gap, "{cosine}");
                }
            }
        }
        assert_eq!(eigen([[0.0; 3]; 3]).values, [0.0; 3]);
        assert_eq!(eigen([[3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]]).vector, [0.0, 1.0, 0.0]);
    }
}
