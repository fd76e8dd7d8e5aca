//! Figures per level about the quality of the sampling, comparable between programs.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::octree::grid::Nearest;
use crate::outcome::LevelQuality;

/// Fixed point, so that sums do not depend on the order in which threads add: 2⁻²⁰ spacings.
const FIXED: f64 = (1u64 << 20) as f64;

/// Neighbours are looked for so far, spacings.
const FAR: f64 = 8.0;

/// Bins of the nearest distances, for each spacing.
const BINS: f64 = 512.0;

/// Points that have another one of their level nearer than this are close, spacings: less than the spacing by more than
/// any rounding.
const CLOSE: f64 = 0.999;

/// Figures of one node, gathered by one thread. Distances over the spacing; infinite: none found.
#[derive(Debug)]
pub(crate) struct NodeFigures {
    /// The node has a single point, which it may hold for no other reason than not to be empty.
    lone: bool,
    sampled: u64,
    nearest_sum: u64,
    nearest_count: u64,
    nearest_min: f64,
    isolated: u64,
    close: u64,
    close_inside: u64,
    close_across: u64,
    seam_min: f64,
    seam_points: u64,
    seam_close: u64,
    seam_faults: u64,
}

impl NodeFigures {
    /// Of a node with `points` points.
    pub(crate) fn new(points: usize) -> Self {
        Self {
            lone: points == 1,
            sampled: 0,
            nearest_sum: 0,
            nearest_count: 0,
            nearest_min: f64::INFINITY,
            isolated: 0,
            close: 0,
            close_inside: 0,
            close_across: 0,
            seam_min: f64::INFINITY,
            seam_points: 0,
            seam_close: 0,
            seam_faults: 0,
        }
    }

    /// Takes in a point; returns how far the nearest other point of its level is, over `spacing`.
    pub(crate) fn add(&mut self, nearest: &Nearest, spacing: f64, allowed_squared: f64) -> f64 {
        let inside = nearest.own.sqrt() / spacing;
        let across_squared = nearest.neighbour.min(nearest.lone);
        let across = across_squared.sqrt() / spacing;
        self.sampled += 1;
        if inside <= FAR {
            self.nearest_sum += (inside * FIXED) as u64;
            self.nearest_count += 1;
            self.nearest_min = self.nearest_min.min(inside);
        } else {
            self.isolated += 1;
        }
        if across <= 2.0 {
            self.seam_points += 1;
            self.seam_min = self.seam_min.min(across);
        }
        self.seam_close += u64::from(across_squared < allowed_squared);
        self.seam_faults += u64::from(!self.lone && nearest.neighbour < allowed_squared);
        self.close_inside += u64::from(inside < CLOSE);
        self.close_across += u64::from(across < CLOSE);
        self.close += u64::from(inside.min(across) < CLOSE);
        inside.min(across)
    }
}

/// Figures of one level, gathered by all threads. Minima and maxima are bits of doubles ≥ 0, which sort like them.
#[derive(Debug)]
pub(crate) struct Tally {
    sampled: AtomicU64,
    nearest_sum: AtomicU64,
    nearest_count: AtomicU64,
    nearest_min: AtomicU64,
    /// Points by the distance to the nearest of their level, up to [`FAR`].
    nearest_bins: Box<[AtomicU64]>,
    isolated: AtomicU64,
    close: AtomicU64,
    close_inside: AtomicU64,
    close_across: AtomicU64,
    hole_squared: AtomicU64,
    offered: AtomicU64,
    offered_within_1: AtomicU64,
    below: AtomicU64,
    below_within_1: AtomicU64,
    below_within_1_5: AtomicU64,
    seam_min: AtomicU64,
    seam_points: AtomicU64,
    seam_close: AtomicU64,
    seam_faults: AtomicU64,
}

impl Default for Tally {
    fn default() -> Self {
        let none = || AtomicU64::new(f64::INFINITY.to_bits());
        let zero = || AtomicU64::new(0);
        Self {
            sampled: zero(),
            nearest_sum: zero(),
            nearest_count: zero(),
            nearest_min: none(),
            nearest_bins: std::iter::repeat_with(zero).take((FAR * BINS) as usize).collect(),
            isolated: zero(),
            close: zero(),
            close_inside: zero(),
            close_across: zero(),
            hole_squared: zero(),
            offered: zero(),
            offered_within_1: zero(),
            below: zero(),
            below_within_1: zero(),
            below_within_1_5: zero(),
            seam_min: none(),
            seam_points: zero(),
            seam_close: zero(),
            seam_faults: zero(),
        }
    }
}

impl Tally {
    pub(crate) fn add_node(&self, node: &NodeFigures) {
        self.nearest_min.fetch_min(node.nearest_min.to_bits(), Relaxed);
        self.seam_min.fetch_min(node.seam_min.to_bits(), Relaxed);
        for (sum, of_node) in [
            (&self.sampled, node.sampled),
            (&self.nearest_sum, node.nearest_sum),
            (&self.nearest_count, node.nearest_count),
            (&self.isolated, node.isolated),
            (&self.close, node.close),
            (&self.close_inside, node.close_inside),
            (&self.close_across, node.close_across),
            (&self.seam_points, node.seam_points),
            (&self.seam_close, node.seam_close),
            (&self.seam_faults, node.seam_faults),
        ] {
            sum.fetch_add(of_node, Relaxed);
        }
    }

    /// Takes in how far the nearest other point of the level is from a point of it, over the spacing.
    pub(crate) fn add_nearest(&self, distance: f64) {
        if let Some(bin) = self.nearest_bins.get((distance * BINS) as usize) {
            bin.fetch_add(1, Relaxed);
        }
    }

    /// Square of the largest hole so far, world units.
    pub(crate) fn hole_squared(&self) -> f64 {
        f64::from_bits(self.hole_squared.load(Relaxed))
    }

    /// Takes in the square of a hole, world units.
    pub(crate) fn widen_hole(&self, squared: f64) {
        self.hole_squared.fetch_max(squared.to_bits(), Relaxed);
    }

    /// Takes in points of deeper levels, and how many of them have one drawn at this level within 1 and 1.5 spacings.
    /// Those of the next level are what was `offered` to this one.
    pub(crate) fn add_below(&self, points: u64, within_1: u64, within_1_5: u64, offered: bool) {
        if offered {
            self.offered.fetch_add(points, Relaxed);
            self.offered_within_1.fetch_add(within_1, Relaxed);
        }
        self.below.fetch_add(points, Relaxed);
        self.below_within_1.fetch_add(within_1, Relaxed);
        self.below_within_1_5.fetch_add(within_1_5, Relaxed);
    }

    /// Points of inner nodes.
    pub(crate) fn sampled(&self) -> u64 {
        self.sampled.load(Relaxed)
    }

    /// Of these, how many have one of another inner node nearer than the spacing, where neither is the only one of its
    /// node.
    pub(crate) fn seam_faults(&self) -> u64 {
        self.seam_faults.load(Relaxed)
    }

    /// The figures of the level.
    pub(crate) fn figures(&self, level: u8, spacing: f64) -> LevelQuality {
        let finite = |a: &AtomicU64| Some(f64::from_bits(a.load(Relaxed))).filter(|v| v.is_finite());
        let count = self.nearest_count.load(Relaxed);
        let below = self.below.load(Relaxed);
        LevelQuality {
            level,
            nodes: 0,
            inner_nodes: 0,
            points: 0,
            spacing,
            sampled: self.sampled(),
            nearest_min: finite(&self.nearest_min),
            nearest_mean: (count > 0).then(|| self.nearest_sum.load(Relaxed) as f64 / FIXED / count as f64),
            nearest_median: self.nearest_median(),
            isolated: self.isolated.load(Relaxed),
            close: self.close.load(Relaxed),
            close_inside: self.close_inside.load(Relaxed),
            close_across: self.close_across.load(Relaxed),
            largest_hole: (below > 0).then(|| self.hole_squared().sqrt() / spacing),
            offered: self.offered.load(Relaxed),
            offered_within_1: self.offered_within_1.load(Relaxed),
            below,
            below_within_1: self.below_within_1.load(Relaxed),
            below_within_1_5: self.below_within_1_5.load(Relaxed),
            seam_min: finite(&self.seam_min),
            seam_points: self.seam_points.load(Relaxed),
            seam_close: self.seam_close.load(Relaxed),
        }
    }

    /// The middle of the bin that holds the median.
    fn nearest_median(&self) -> Option<f64> {
        let half = self.nearest_bins.iter().map(|b| b.load(Relaxed)).sum::<u64>().div_ceil(2);
        let mut counted = 0;
        let bin = self.nearest_bins.iter().position(|b| {
            counted += b.load(Relaxed);
            counted >= half
        })?;
        (half > 0).then(|| (bin as f64 + 0.5) / BINS)
    }
}
