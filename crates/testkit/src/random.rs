//! Random numbers that are the same everywhere.

/// A linear congruential generator of 64 bits, that of `fixtures/generators/batches.py`. The same seed gives the same
/// numbers on every machine.
///
/// Only the upper bits of its state are random enough to use; every method takes them.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// A generator whose numbers depend on `seed` alone.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn step(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0
    }

    /// Any 32 bits.
    pub fn next_u32(&mut self) -> u32 {
        (self.step() >> 32) as u32
    }

    /// Any 64 bits.
    pub fn next_u64(&mut self) -> u64 {
        u64::from(self.next_u32()) << 32 | u64::from(self.next_u32())
    }

    /// A number below `end`, which is 1 to 2^31.
    pub fn below(&mut self, end: u64) -> u64 {
        debug_assert!((1..=1 << 31).contains(&end), "a number below {end}");
        (self.step() >> 33) % end
    }

    /// An index of something with `len` items, at least 1.
    pub fn index(&mut self, len: usize) -> usize {
        self.below(len as u64) as usize
    }

    /// A number from 0 to 1, without 1.
    pub fn unit(&mut self) -> f64 {
        (self.step() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A number from `min` to `max`.
    pub fn between(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * self.unit()
    }

    /// One of `items`.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.index(items.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_gives_the_same_numbers_within_their_bounds() {
        let (mut a, mut b) = (Random::new(7), Random::new(7));
        for _ in 0..1000 {
            assert_eq!(a.next_u64(), b.next_u64());
            assert!(a.below(10) < 10 && b.below(10) < 10);
            let v = a.between(-2.0, 3.0);
            assert!((-2.0..=3.0).contains(&v) && v == b.between(-2.0, 3.0));
        }
        assert_eq!(Random::new(0).below(1 << 31), 1_442_695_040_888_963_407 >> 33);
    }

    #[test]
    fn every_value_comes_about_equally_often() {
        let mut random = Random::new(1);
        let mut counts = [0; 8];
        (0..8000).for_each(|_| counts[random.index(8)] += 1);
        assert!(counts.iter().all(|n| (900..1100).contains(n)), "{counts:?}");
        let bits = (0..8000).fold(0u64, |sum, _| sum + u64::from(random.next_u64().count_ones()));
        assert!((31 * 8000..33 * 8000).contains(&bits), "{bits}");
    }
}
