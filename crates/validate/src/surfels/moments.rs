//! Sums over the points of a neighbourhood, exact: their covariance depends on no order and on no cancellation.

/// Number, sums and sums of products of differences of positions, steps of the lattice.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Moments {
    pub(super) points: u64,
    sums: [i128; 3],
    /// xx, xy, xz, yy, yz, zz.
    products: [i128; 6],
    /// A sum did not fit.
    overflows: bool,
}

/// The axes of [`Moments::products`].
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

impl Moments {
    /// Takes in `count` points that differ by so much from the one that the neighbourhood is of.
    pub(super) fn add(&mut self, difference: [i64; 3], count: u64) {
        self.points += count;
        let (d, count) = (difference.map(i128::from), i128::from(count));
        for (sum, d) in self.sums.iter_mut().zip(d) {
            *sum += d * count; // a dataset has fewer than 2⁶³ points
        }
        for (product, (a, b)) in self.products.iter_mut().zip(PAIRS) {
            let more = (d[a] * d[b]).checked_mul(count).and_then(|more| product.checked_add(more));
            self.overflows |= more.is_none();
            *product = more.unwrap_or(*product);
        }
    }

    /// All points are at one place: their own.
    pub(super) fn is_one_place(&self) -> bool {
        self.products.iter().all(|p| *p == 0) && !self.overflows
    }

    /// The covariance, world units, squared; `None` for sums that do not fit in 128 bits.
    pub(super) fn covariance(&self, scale: [f64; 3]) -> Option<[[f64; 3]; 3]> {
        let points = i128::from(self.points.max(1));
        let mut covariance = [[0.0; 3]; 3];
        for (product, (a, b)) in self.products.iter().zip(PAIRS) {
            let means = self.sums[a].checked_mul(self.sums[b])?;
            let exact = points.checked_mul(*product)?.checked_sub(means)?;
            let element = exact as f64 / (points as f64 * points as f64) * scale[a] * scale[b];
            (covariance[a][b], covariance[b][a]) = (element, element);
        }
        (!self.overflows).then_some(covariance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariances_are_exact_wherever_the_mean_is() {
        let far = 1i64 << 35;
        let mut moments = Moments::default();
        for d in [[far, 0, 0], [far + 2, 0, 0], [far, 4, 0], [far + 2, 4, 1]] {
            moments.add(d, 1);
        }
        let c = moments.covariance([0.5, 1.0, 1.0]).unwrap();
        assert_eq!([c[0][0], c[1][1], c[2][2], c[0][1], c[0][2], c[1][2]], [0.25, 4.0, 0.1875, 0.0, 0.125, 0.5]);
        assert!(!moments.is_one_place());
    }

    #[test]
    fn counts_are_points_and_sums_that_do_not_fit_are_known() {
        let (mut one_by_one, mut together) = (Moments::default(), Moments::default());
        (0..5).for_each(|_| one_by_one.add([3, -7, 2], 1));
        together.add([3, -7, 2], 5);
        assert_eq!(one_by_one, together);
        together.add([i64::MAX, i64::MIN, 0], 1 << 20);
        assert_eq!(together.covariance([1.0; 3]), None);
        let mut alone = Moments::default();
        alone.add([0; 3], 9);
        assert!(alone.is_one_place());
    }
}
