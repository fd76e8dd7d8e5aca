//! The nearest points of a place, in an order that depends on these points alone.

/// A point near a place: the square of its distance, then its coordinates. Points of the same distance come in the order of their
/// coordinates, so it does not matter in which order they are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Near(u128);

/// The sign bit: with it turned, integers are in the order of their bits.
const SIGN: u32 = 1 << 31;

impl Near {
    /// `squared`: 0 or more.
    #[inline(always)]
    pub(super) fn new(squared: f32, [x, y, z]: [i32; 3]) -> Self {
        let bits = |v: i32| u128::from(v.cast_unsigned() ^ SIGN);
        Self(u128::from(squared.to_bits()) << 96 | bits(x) << 64 | bits(y) << 32 | bits(z))
    }

    #[inline(always)]
    fn squared(self) -> f32 {
        f32::from_bits((self.0 >> 96) as u32)
    }

    /// Its coordinates.
    #[inline(always)]
    pub(super) fn place(self) -> [i32; 3] {
        [64, 32, 0].map(|shift| ((self.0 >> shift) as u32 ^ SIGN).cast_signed())
    }
}

/// The nearest ones so far, nearest first.
#[derive(Debug)]
pub(super) struct Nearest {
    all: Vec<Near>,
    most: usize,
}

impl Nearest {
    pub(super) fn new(most: usize) -> Self {
        Self { all: Vec::with_capacity(most), most }
    }

    pub(super) fn clear(&mut self) {
        self.all.clear();
    }

    /// What is farther does not matter any more.
    #[inline(always)]
    pub(super) fn bound(&self) -> f32 {
        if self.all.len() < self.most { f32::INFINITY } else { self.all[self.most - 1].squared() }
    }

    /// Takes a point, if it is one of the nearest.
    #[inline(always)]
    pub(super) fn offer(&mut self, near: Near) {
        let mut at = if self.all.len() < self.most {
            self.all.push(near);
            self.all.len() - 1
        } else if near < self.all[self.most - 1] {
            self.most - 1
        } else {
            return;
        };
        while at > 0 && near < self.all[at - 1] {
            self.all[at] = self.all[at - 1];
            at -= 1;
        }
        self.all[at] = near;
    }

    /// Nearest first.
    pub(super) fn all(&self) -> &[Near] {
        &self.all
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    #[test]
    fn the_nearest_ones_in_order_however_they_are_found() {
        let mut random = Random::new(4);
        for most in [1, 3, 16] {
            for points in [0, 2, 16, 300] {
                let places: Vec<[i32; 3]> = (0..points).map(|_| [(); 3].map(|()| random.below(9) as i32 - 4)).collect();
                let near = |p: [i32; 3]| Near::new(p.iter().map(|v| (v * v) as f32).sum(), p);
                let mut nearest = Nearest::new(most);
                places.iter().for_each(|p| nearest.offer(near(*p)));
                let mut expected = places.clone();
                expected.sort_by_key(|p| (p.iter().map(|v| v * v).sum::<i32>(), *p));
                expected.truncate(most);
                let found: Vec<[i32; 3]> = nearest.all().iter().map(|near| near.place()).collect();
                assert_eq!(found, expected, "{most} of {points}");
                assert_eq!(nearest.bound() == f32::INFINITY, points < most);
            }
        }
    }
}
