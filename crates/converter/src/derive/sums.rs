//! Sums over a neighbourhood, exact, so that no order of its points gives other bits.

use super::eigen::Symmetric;

/// Differences below this have squares of which so many add up in 64 bits.
const SMALL: u64 = 1 << 26;
const MANY: u32 = 1024;

/// Sums over points around one in the middle, of their differences from it in steps of the lattice.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    /// Points.
    pub(super) count: u64,
    first: [i64; 3],
    /// Products: xx, xy, xz, yy, yz, zz.
    second: [i128; 6],
    /// Those of the last points, where they are small: not among these yet.
    recent: [i64; 6],
    /// How many points that are.
    pending: u32,
}

impl Sums {
    /// Of the neighbourhood of `q`.
    #[inline]
    pub(super) fn of(q: [i32; 3], all: &[[i32; 3]]) -> Self {
        let mut sums = Self::default();
        all.iter().for_each(|place| sums.add([0, 1, 2].map(|a| i64::from(place[a]) - i64::from(q[a]))));
        sums
    }

    /// Adds a point; its difference has less than 34 bits.
    #[inline]
    pub(super) fn add(&mut self, d: [i64; 3]) {
        self.count += 1;
        self.first.iter_mut().zip(d).for_each(|(sum, d)| *sum += d);
        if d.iter().any(|v| v.unsigned_abs() >= SMALL) {
            let [x, y, z] = d.map(i128::from);
            let products = [x * x, x * y, x * z, y * y, y * z, z * z];
            self.second.iter_mut().zip(products).for_each(|(sum, p)| *sum += p);
            return;
        }
        let [x, y, z] = d;
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        self.recent.iter_mut().zip(products).for_each(|(sum, p)| *sum += p);
        self.pending += 1;
        if self.pending == MANY {
            (self.second, self.recent, self.pending) = (self.second(), [0; 6], 0);
        }
    }

    /// The sums of products of all points.
    #[inline]
    fn second(&self) -> [i128; 6] {
        std::array::from_fn(|i| self.second[i] + i128::from(self.recent[i]))
    }

    /// Adds so many points at the place in the middle.
    pub(super) fn add_middle(&mut self, count: u64) {
        self.count += count;
    }

    /// True if all points are at one place.
    pub(super) fn is_one_place(&self) -> bool {
        let [xx, _, _, yy, _, zz] = self.second();
        xx == 0 && yy == 0 && zz == 0
    }

    /// The covariance, of axes whose steps are `ratio` long.
    #[inline]
    pub(super) fn covariance(&self, ratio: [f64; 3]) -> Symmetric {
        let n = i128::from(self.count);
        let [x, y, z] = self.first.map(i128::from);
        let [xx, xy, xz, yy, yz, zz] = self.second();
        // both terms are exact: what is left over is rounded once
        let whole = [n * xx - x * x, n * xy - x * y, n * xz - x * z, n * yy - y * y, n * yz - y * z, n * zz - z * z];
        let [rx, ry, rz] = ratio;
        let steps = [rx * rx, rx * ry, rx * rz, ry * ry, ry * rz, rz * rz];
        let per = 1.0 / (self.count as f64 * self.count as f64);
        std::array::from_fn(|i| whole[i] as f64 * per * steps[i])
    }
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
    fn many_points_and_far_ones_are_added_exactly_and_one_place_is_told() {
        let most = SMALL as i32;
        let steps = [[1, 2, 3], [most - 1, 1 - most, most - 1], [most, -1, 7], [-most, most, i32::MAX], [1 - most; 3]];
        let places: Vec<[i32; 3]> = steps.iter().copied().cycle().take(6 * MANY as usize + 3).collect();
        for q in [[0; 3], [most / 2, 3, -9]] {
            let mut second = [0i128; 6];
            for place in &places {
                let [x, y, z] = [0, 1, 2].map(|a| i128::from(place[a]) - i128::from(q[a]));
                second.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]).for_each(|(sum, p)| *sum += p);
            }
            let sums = Sums::of(q, &places);
            assert_eq!((sums.second(), sums.count), (second, places.len() as u64));
            assert!(!sums.is_one_place());
        }
        let mut one = Sums::of([1; 3], &[[1; 3]; 4]);
        one.add_middle(3);
        assert!(one.is_one_place() && one.count == 7);
    }
}
