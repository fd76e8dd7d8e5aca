//! The nearest points of a place: which these are depends on the points alone, not on the order in which they are found.

use crate::runtime::{Compare, LANES};

/// So many points of the least distance. Of points at the same distance those with the smaller coordinates count.
///
/// They are in no order: the farthest is known, and a nearer point takes its place. For the few points of a neighbourhood that is
/// two or three vectors of comparisons, without a branch that the processor has to guess.
#[derive(Debug)]
pub(super) struct Nearest {
    most: usize,
    count: usize,
    /// Squares of distances; behind the last one they are less than any, up to whole vectors.
    squared: Vec<f32>,
    places: Vec<[i32; 3]>,
    /// Index of the farthest, once there are `most`.
    farthest: usize,
    /// What is farther does not matter any more.
    bound: f32,
}

impl Nearest {
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            count: 0,
            squared: vec![f32::NEG_INFINITY; most.next_multiple_of(LANES)],
            places: vec![[0; 3]; most],
            farthest: 0,
            bound: f32::INFINITY,
        }
    }

    /// Begins anew, with points within the square of a distance: there must be as many as are wanted.
    #[inline(always)]
    pub(super) fn begin(&mut self, within: f32) {
        (self.count, self.bound) = (0, within);
    }

    /// How many are wanted.
    pub(super) fn most(&self) -> usize {
        self.most
    }

    /// True if there are as many as are wanted.
    #[inline(always)]
    pub(super) fn is_full(&self) -> bool {
        self.count == self.most
    }

    /// What is farther does not matter any more.
    #[inline(always)]
    pub(super) fn bound(&self) -> f32 {
        self.bound
    }

    /// The square of the greatest distance; infinite, if there are fewer points than are wanted.
    #[inline(always)]
    pub(super) fn reach(&self) -> f32 {
        if self.count < self.most { f32::INFINITY } else { self.bound }
    }

    /// Takes a point within the bound, if it is one of the nearest.
    #[inline(always)]
    pub(super) fn offer(&mut self, lanes: impl Compare, squared: f32, place: [i32; 3]) {
        if self.count < self.most {
            (self.squared[self.count], self.places[self.count]) = (squared, place);
            self.count += 1;
            if self.count == self.most {
                self.find_farthest(lanes);
            }
        } else if squared < self.bound || squared == self.bound && place < self.places[self.farthest] {
            (self.squared[self.farthest], self.places[self.farthest]) = (squared, place);
            self.find_farthest(lanes);
        }
    }

    #[inline(always)]
    fn find_farthest(&mut self, lanes: impl Compare) {
        let (vectors, _) = self.squared.as_chunks::<LANES>();
        let mut most = [f32::NEG_INFINITY; LANES];
        for vector in vectors {
            for (most, v) in most.iter_mut().zip(vector) {
                *most = if *v > *most { *v } else { *most };
            }
        }
        let bound = most.into_iter().fold(f32::NEG_INFINITY, |a, b| if b > a { b } else { a });
        self.bound = bound;
        let mut found = None;
        for (i, vector) in vectors.iter().enumerate() {
            // none is greater: those that are not less are equal
            let mut equal = lanes.at_most(&vector.map(|v| -v), -bound);
            while equal != 0 {
                let at = i * LANES + equal.trailing_zeros() as usize;
                equal &= equal - 1;
                if found.is_none_or(|found: usize| self.places[at] > self.places[found]) {
                    found = Some(at);
                }
            }
        }
        self.farthest = found.unwrap_or(0);
    }

    /// All of them.
    pub(super) fn places(&self) -> &[[i32; 3]] {
        &self.places[..self.count]
    }

    /// The farthest of them.
    pub(super) fn farthest(&self) -> Option<[i32; 3]> {
        if self.count == self.most {
            return self.places.get(self.farthest).copied();
        }
        let all = self.squared[..self.count].iter().zip(self.places());
        all.max_by(|a, b| a.0.total_cmp(b.0).then_with(|| a.1.cmp(b.1))).map(|(_, place)| *place)
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;
    use crate::runtime::Portable;

    #[test]
    fn the_nearest_ones_however_they_are_found() {
        let mut random = Random::new(4);
        let mut nearest_of: Vec<Nearest> = [3, 8, 16, 17].map(Nearest::new).into();
        for points in [0usize, 2, 16, 300, 4, 40] {
            let places: Vec<[i32; 3]> = (0..points).map(|_| [(); 3].map(|()| random.below(9) as i32 - 4)).collect();
            let square = |p: &[i32; 3]| p.iter().map(|v| v * v).sum::<i32>();
            let mut expected = places.clone();
            expected.sort_by_key(|p| (square(p), *p));
            for nearest in &mut nearest_of {
                nearest.begin(f32::INFINITY);
                for p in &places {
                    if square(p) as f32 <= nearest.bound() {
                        nearest.offer(Portable, square(p) as f32, *p);
                    }
                }
                let mut found = nearest.places().to_vec();
                found.sort_by_key(|p| (square(p), *p));
                let expected = &expected[..points.min(nearest.most)];
                assert_eq!(found, expected, "{} of {points}", nearest.most);
                let farthest = expected.last().map(square);
                assert_eq!(nearest.farthest().as_ref().map(square), farthest);
                let reach = if points < nearest.most { None } else { farthest };
                assert_eq!(nearest.reach(), reach.map_or(f32::INFINITY, |v| v as f32));
            }
        }
    }
}
