//! Figures per level about the quality of the sampling, comparable between programs.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::outcome::LevelQuality;

/// Fixed point, so that sums do not depend on the order in which threads add: 2⁻²⁰ spacings.
const FIXED: f64 = (1u64 << 20) as f64;

/// Figures of one node, gathered by one thread. Distances over the spacing; infinite: none found.
#[derive(Debug)]
pub(crate) struct NodeFigures {
    nearest_sum: u64,
    nearest_count: u64,
    nearest_min: f64,
    isolated: u64,
    seam_min: f64,
    seam_points: u64,
    seam_close: u64,
}

impl Default for NodeFigures {
    fn default() -> Self {
        Self {
            nearest_sum: 0,
            nearest_count: 0,
            nearest_min: f64::INFINITY,
            isolated: 0,
            seam_min: f64::INFINITY,
            seam_points: 0,
            seam_close: 0,
        }
    }
}

impl NodeFigures {
    /// The nearest other point of the same node.
    pub(crate) fn nearest(&mut self, distance: f64) {
        if distance <= 8.0 {
            self.nearest_sum += (distance * FIXED) as u64;
            self.nearest_count += 1;
            self.nearest_min = self.nearest_min.min(distance);
        } else {
            self.isolated += 1;
        }
    }

    /// The nearest point of another inner node of the level.
    pub(crate) fn across(&mut self, distance: f64, close: bool) {
        if distance <= 2.0 {
            self.seam_points += 1;
            self.seam_close += u64::from(close);
            self.seam_min = self.seam_min.min(distance);
        }
    }
}

/// Figures of one level, gathered by all threads. Minima and maxima are bits of doubles ≥ 0, which sort like them.
#[derive(Debug)]
pub(crate) struct Tally {
    nearest_sum: AtomicU64,
    nearest_count: AtomicU64,
    nearest_min: AtomicU64,
    isolated: AtomicU64,
    hole_squared: AtomicU64,
    hole_seen: AtomicU64,
    seam_min: AtomicU64,
    seam_points: AtomicU64,
    seam_close: AtomicU64,
}

impl Default for Tally {
    fn default() -> Self {
        let none = || AtomicU64::new(f64::INFINITY.to_bits());
        let zero = || AtomicU64::new(0);
        Self {
            nearest_sum: zero(),
            nearest_count: zero(),
            nearest_min: none(),
            isolated: zero(),
            hole_squared: zero(),
            hole_seen: zero(),
            seam_min: none(),
            seam_points: zero(),
            seam_close: zero(),
        }
    }
}

impl Tally {
    pub(crate) fn add_node(&self, node: &NodeFigures) {
        self.nearest_sum.fetch_add(node.nearest_sum, Relaxed);
        self.nearest_count.fetch_add(node.nearest_count, Relaxed);
        self.nearest_min.fetch_min(node.nearest_min.to_bits(), Relaxed);
        self.isolated.fetch_add(node.isolated, Relaxed);
        self.seam_min.fetch_min(node.seam_min.to_bits(), Relaxed);
        self.seam_points.fetch_add(node.seam_points, Relaxed);
        self.seam_close.fetch_add(node.seam_close, Relaxed);
    }

    /// Square of the largest hole so far, world units.
    pub(crate) fn hole_squared(&self) -> f64 {
        f64::from_bits(self.hole_squared.load(Relaxed))
    }

    /// Takes in the square of a hole, world units.
    pub(crate) fn widen_hole(&self, squared: f64) {
        self.hole_seen.store(1, Relaxed);
        self.hole_squared.fetch_max(squared.to_bits(), Relaxed);
    }

    /// The figures of the level.
    pub(crate) fn figures(&self, level: u8, spacing: f64) -> LevelQuality {
        let finite = |a: &AtomicU64| Some(f64::from_bits(a.load(Relaxed))).filter(|v| v.is_finite());
        let count = self.nearest_count.load(Relaxed);
        LevelQuality {
            level,
            nodes: 0,
            inner_nodes: 0,
            points: 0,
            spacing,
            nearest_min: finite(&self.nearest_min),
            nearest_mean: (count > 0).then(|| self.nearest_sum.load(Relaxed) as f64 / FIXED / count as f64),
            isolated: self.isolated.load(Relaxed),
            largest_hole: (self.hole_seen.load(Relaxed) == 1).then(|| self.hole_squared().sqrt() / spacing),
            seam_min: finite(&self.seam_min),
            seam_points: self.seam_points.load(Relaxed),
            seam_close: self.seam_close.load(Relaxed),
        }
    }
}
