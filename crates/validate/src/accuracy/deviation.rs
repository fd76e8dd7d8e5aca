//! Differences of positions, summed up.

use std::sync::Mutex;

/// Sums over points of what is decoded less what it stands for, world units.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Deviation {
    pub(crate) points: u64,
    pub(crate) max: [f64; 3],
    pub(crate) sum: [f64; 3],
    pub(crate) squares: [f64; 3],
    /// Square of the largest distance in space.
    pub(crate) farthest: f64,
    /// The largest coordinates, without their signs: rounding depends on them.
    pub(crate) size: [f64; 3],
}

impl Deviation {
    /// Takes in a point. `size`: the largest coordinates that were added up to tell where it is.
    pub(crate) fn add(&mut self, difference: [f64; 3], size: [f64; 3]) {
        self.points += 1;
        let mut distance = 0.0;
        for a in 0..3 {
            let d = difference[a];
            self.max[a] = self.max[a].max(d.abs());
            self.sum[a] += d;
            self.squares[a] += d * d;
            self.size[a] = self.size[a].max(size[a].abs());
            distance += d * d;
        }
        self.farthest = self.farthest.max(distance);
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for a in 0..3 {
            self.max[a] = self.max[a].max(other.max[a]);
            self.sum[a] += other.sum[a];
            self.squares[a] += other.squares[a];
            self.size[a] = self.size[a].max(other.size[a]);
        }
        self.farthest = self.farthest.max(other.farthest);
    }
}

/// What threads found of parts, put together in the order of the parts: sums of doubles depend on it.
#[derive(Debug)]
pub(crate) struct Ordered<K, V>(Mutex<Vec<(K, V)>>);

impl<K, V> Default for Ordered<K, V> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<K: Ord, V> Ordered<K, V> {
    /// Takes in what was found of the part `key`.
    pub(crate) fn put(&self, key: K, value: V) {
        if let Ok(mut all) = self.0.lock() {
            all.push((key, value));
        }
    }

    /// All of them, in order.
    pub(crate) fn finish(self) -> impl Iterator<Item = V> {
        let mut all = self.0.into_inner().unwrap_or_default();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all.into_iter().map(|(_, value)| value)
    }
}
