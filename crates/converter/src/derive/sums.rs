//! Sums over a neighbourhood, exact, so that no order of its points gives other bits.

use super::eigen::Symmetric;

/// Differences below this have squares of which a thousand add up in 64 bits.
const SMALL: i64 = 1 << 26;

/// Sums over points around one in the middle, of their differences from it in steps of the lattice.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Sums {
    /// Points.
    pub(super) count: u64,
    first: [i64; 3],
    /// Products: xx, xy, xz, yy, yz, zz.
    second: [i128; 6],
}

impl Sums {
    /// Of the neighbourhood of `q`.
    #[inline]
    pub(super) fn of(q: [i32; 3], all: &[[i32; 3]]) -> Self {
        let difference = |place: &[i32; 3]| [0, 1, 2].map(|a| i64::from(place[a]) - i64::from(q[a]));
        let (mut first, mut second, mut largest) = ([0i64; 3], [0i64; 6], 0);
        for place in all {
            let d = difference(place);
            largest = d.iter().fold(largest, |most: i64, v| most.max(v.abs()));
            first.iter_mut().zip(d).for_each(|(sum, d)| *sum += d);
            second.iter_mut().zip(products(d)).for_each(|(sum, p)| *sum = sum.wrapping_add(p));
        }
        if largest < SMALL {
            return Self { count: all.len() as u64, first, second: second.map(i128::from) };
        }
        let mut sums = Self::default();
        all.iter().for_each(|place| sums.add(difference(place)));
        sums
    }

    /// Adds a point; its difference has less than 34 bits.
    #[inline]
    pub(super) fn add(&mut self, d: [i64; 3]) {
        let [x, y, z] = d.map(i128::from);
        self.count += 1;
        self.first.iter_mut().zip(d).for_each(|(sum, d)| *sum += d);
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        self.second.iter_mut().zip(products).for_each(|(sum, p)| *sum += p);
    }

    /// Adds so many points at the place in the middle.
    pub(super) fn add_middle(&mut self, count: u64) {
        self.count += count;
    }

    /// True if all points are at one place.
    pub(super) fn is_one_place(&self) -> bool {
        let [xx, _, _, yy, _, zz] = self.second;
        xx == 0 && yy == 0 && zz == 0
    }

    /// The covariance, of axes whose steps are `ratio` long.
    #[inline]
    pub(super) fn covariance(&self, ratio: [f64; 3]) -> Symmetric {
        let n = i128::from(self.count);
        let [x, y, z] = self.first.map(i128::from);
        let [xx, xy, xz, yy, yz, zz] = self.second;
        // both terms are exact: what is left over is rounded once
        let whole = [n * xx - x * x, n * xy - x * y, n * xz - x * z, n * yy - y * y, n * yz - y * z, n * zz - z * z];
        let [rx, ry, rz] = ratio;
        let steps = [rx * rx, rx * ry, rx * rz, ry * ry, ry * rz, rz * rz];
        let per = 1.0 / (self.count as f64 * self.count as f64);
        std::array::from_fn(|i| whole[i] as f64 * per * steps[i])
    }
}

#[inline(always)]
fn products([x, y, z]: [i64; 3]) -> [i64; 6] {
    let times = i64::wrapping_mul;
    [times(x, x), times(x, y), times(x, z), times(y, y), times(y, z), times(z, z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_covariance_is_that_of_the_points_wherever_and_however_far_they_are() {
        let cross = [[0, 0, 0], [2, 0, 0], [-2, 0, 0], [0, 4, 0], [0, -4, 0]];
        for middle in [[0; 3], [7, -9, i32::MAX - 9], [i32::MIN + 20, 5, 5]] {
            let places = cross.map(|p| [0, 1, 2].map(|a| p[a] + middle[a]));
            for q in [middle, places[1]] {
                let covariance = Sums::of(q, &places).covariance([1.0, 0.5, 3.0]);
                assert_eq!(
                    covariance,
                    [8.0 / 5.0, 0.0, 0.0, 0.25 * 32.0 / 5.0, 0.0, 0.0].map(|v: f64| (v * 25.0) / 25.0)
                );
            }
        }
        let far = [[i32::MIN, 0, 3], [i32::MAX, 0, 3]];
        let covariance = Sums::of(far[0], &far).covariance([1.0; 3]);
        assert_eq!(covariance, [((1u64 << 32) - 1) as f64 * ((1u64 << 32) - 1) as f64 / 4.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn both_ways_of_adding_are_the_same_and_one_place_is_told() {
        let places = [[5, 6, 7], [-90_000_000, 4, 3], [90_000_000, -4, 100]];
        let mut sums = Sums::default();
        places.iter().for_each(|p| sums.add([0, 1, 2].map(|a| i64::from(p[a] - places[0][a]))));
        assert_eq!(Sums::of(places[0], &places), sums);
        assert!(!sums.is_one_place());
        let mut one = Sums::of([1; 3], &[[1; 3]; 4]);
        one.add_middle(3);
        assert!(one.is_one_place() && one.count == 7);
    }
}
