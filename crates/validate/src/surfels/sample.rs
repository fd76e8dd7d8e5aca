//! A sample of the points of a dataset that does not depend on the order in which they come: those with the smallest hashes.

use std::collections::BinaryHeap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use super::columns::Surfel;
use crate::against::block::{Block, mix};
use crate::place::Place;

/// The smallest of many values, at most so many of them.
#[derive(Debug)]
pub(super) struct Smallest<T> {
    most: usize,
    kept: Mutex<BinaryHeap<(u64, T)>>,
    /// Nothing with a greater hash is kept.
    limit: AtomicU64,
}

impl<T: Ord> Smallest<T> {
    pub(super) fn new(most: usize) -> Self {
        Self { most, kept: Mutex::default(), limit: AtomicU64::new(u64::MAX) }
    }

    /// Takes in a value, if it is among the smallest so far.
    pub(super) fn offer(&self, hash: u64, value: impl FnOnce() -> T) {
        if hash > self.limit.load(Relaxed) {
            return;
        }
        let Ok(mut kept) = self.kept.lock() else { return };
        kept.push((hash, value()));
        if kept.len() > self.most {
            kept.pop();
        }
        if kept.len() == self.most
            && let Some((largest, _)) = kept.peek()
        {
            self.limit.store(*largest, Relaxed);
        }
    }

    /// Ascending.
    pub(super) fn finish(self) -> Vec<T> {
        let kept = self.kept.into_inner().unwrap_or_default();
        kept.into_sorted_vec().into_iter().map(|(_, value)| value).collect()
    }
}

/// A point that is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Query {
    /// Steps of the lattice.
    pub(super) position: [i64; 3],
    /// Bits of what it has: normal, curvature, radius.
    surfel: [u64; 5],
    pub(super) place: Place,
}

impl Query {
    pub(super) fn new(position: [i64; 3], surfel: Surfel, place: Place) -> Self {
        let [x, y, z] = surfel.normal;
        Self { position, surfel: [x, y, z, surfel.curvature, surfel.radius].map(f64::to_bits), place }
    }

    pub(super) fn surfel(&self) -> Surfel {
        let [x, y, z, curvature, radius] = self.surfel.map(f64::from_bits);
        Surfel { normal: [x, y, z], curvature, radius }
    }
}

/// Levels of an octree; other datasets have one.
const LEVELS: usize = 32;

/// Points of which the distances to queries are bounded before all points are gone through.
const SCOUTS: usize = 1 << 15;

/// Bytes of a point that is kept, at most.
const KEPT_BYTES: usize = 128;

/// What a sample takes, at most, bytes.
pub(super) const fn bytes(queries: usize) -> u64 {
    ((LEVELS * queries + SCOUTS) * KEPT_BYTES) as u64
}

/// The sample, while points come.
#[derive(Debug)]
pub(super) struct Sample {
    queries: usize,
    levels: Vec<Smallest<Query>>,
    scouts: Smallest<[i64; 3]>,
}

impl Sample {
    /// Of at most `queries` points.
    pub(super) fn new(queries: usize) -> Self {
        let levels = (0..LEVELS).map(|_| Smallest::new(queries)).collect();
        Self { queries, levels, scouts: Smallest::new(SCOUTS) }
    }

    /// Takes in a record of a block.
    pub(super) fn offer(&self, block: &Block, i: usize, place: Place, surfel: impl FnOnce() -> Surfel) {
        let position = block.position(i);
        let [hash, _] = position.iter().fold([0, 0], |state, v| mix(state, *v as u64));
        let level = match place {
            Place::Octree(key) => usize::from(key.level),
            Place::Binary(_) | Place::Batch(_) => 0,
        };
        if let Some(level) = self.levels.get(level) {
            level.offer(hash, || Query::new(position, surfel(), place));
        }
        self.scouts.offer(hash, || position);
    }

    /// Points of all levels by turns, as many of each as there are, until the sample is full; and positions of points of the whole
    /// dataset.
    pub(super) fn finish(self) -> (Vec<Query>, Vec<[i64; 3]>) {
        let levels: Vec<Vec<Query>> = self.levels.into_iter().map(Smallest::finish).collect();
        let longest = levels.iter().map(Vec::len).max().unwrap_or(0);
        let by_turns = (0..longest).flat_map(|i| levels.iter().filter_map(move |level| level.get(i)));
        (by_turns.take(self.queries).copied().collect(), self.scouts.finish())
    }
}

#[cfg(test)]
mod tests {
    use pointmill_format::NodeKey;

    use super::*;

    fn block(points: &[[i64; 3]]) -> Block {
        let mut block = Block::default();
        for (axis, values) in block.positions.iter_mut().enumerate() {
            values.extend(points.iter().map(|p| p[axis]));
        }
        block
    }

    #[test]
    fn a_sample_is_the_same_in_any_order_and_has_points_of_all_levels() {
        let place = |level: u8| NodeKey { level, x: 0, y: 0, z: 0 }.into();
        let points: Vec<[i64; 3]> = (0..5000).map(|i| [i, i * i % 977, 3 * i % 101]).collect();
        let sample = |points: &[[i64; 3]], queries: usize| {
            let sample = Sample::new(queries);
            let block = block(points);
            for (i, p) in points.iter().enumerate() {
                let level = if p[0] < 20 { 0 } else { 1 + (p[0] % 2) as u8 };
                let surfel = || Surfel { normal: [0.0, 0.0, 1.0], curvature: 0.0, radius: p[0] as f64 };
                sample.offer(&block, i, place(level), surfel);
            }
            sample.finish()
        };
        let reversed: Vec<[i64; 3]> = points.iter().rev().copied().collect();
        let (queries, scouts) = sample(&points, 100);
        assert_eq!((queries.len(), scouts.len()), (100, 5000));
        assert_eq!(sample(&reversed, 100).0, queries);
        let of = |level: u8| queries.iter().filter(|q| q.place == place(level)).count();
        assert_eq!([of(0), of(1), of(2)], [20, 40, 40]);
        assert!(queries.iter().all(|q| q.surfel().radius == q.position[0] as f64));
        let spread = queries.iter().map(|q| q.position[0] / 1000).fold([0; 5], |mut n, i| {
            n[i as usize] += 1;
            n
        });
        assert!(spread.iter().all(|n| *n >= 8), "{spread:?}");
        assert_eq!(sample(&points, 9000).0.len(), 5000);
    }
}
