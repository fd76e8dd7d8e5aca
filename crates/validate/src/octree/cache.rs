//! Positions of nodes that neighbours ask for again, within a number of bytes.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Stored positions of one node, point by point.
pub(crate) type Positions = Arc<Vec<[i32; 3]>>;

/// A cache of two generations: what was not asked for during a whole generation goes. The walk is depth first, so
/// neighbours come soon or not at all, and this simple rule loses little to a true least-recently-used order.
#[derive(Debug)]
pub(crate) struct Cache {
    generations: Mutex<Generations>,
    /// Bytes of one generation.
    limit: usize,
}

#[derive(Debug, Default)]
struct Generations {
    young: HashMap<usize, Positions>,
    old: HashMap<usize, Positions>,
    young_bytes: usize,
}

impl Cache {
    /// A cache of about `bytes`.
    pub(crate) fn new(bytes: usize) -> Self {
        Self { generations: Mutex::default(), limit: bytes / 2 }
    }

    /// What is known of node `index`.
    pub(crate) fn get(&self, index: usize) -> Option<Positions> {
        let mut generations = self.generations.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = generations.young.get(&index) {
            return Some(found.clone());
        }
        let found = generations.old.remove(&index)?;
        self.insert(&mut generations, index, found.clone());
        Some(found)
    }

    /// Remembers node `index`.
    pub(crate) fn put(&self, index: usize, positions: Positions) {
        let mut generations = self.generations.lock().unwrap_or_else(PoisonError::into_inner);
        self.insert(&mut generations, index, positions);
    }

    fn insert(&self, generations: &mut Generations, index: usize, positions: Positions) {
        let bytes = positions.len() * size_of::<[i32; 3]>() + 64;
        if generations.young_bytes + bytes > self.limit {
            generations.old = std::mem::take(&mut generations.young);
            generations.young_bytes = 0;
        }
        if generations.young.insert(index, positions).is_none() {
            generations.young_bytes += bytes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_used_stays_and_the_rest_goes() {
        let cache = Cache::new(2 * 3 * (64 + 12 * 10));
        let node = || Arc::new(vec![[0; 3]; 10]);
        cache.put(0, node());
        for i in 1..20 {
            assert!(cache.get(0).is_some(), "after {i}");
            cache.put(i, node());
        }
        assert!(cache.get(1).is_none());
    }
}
