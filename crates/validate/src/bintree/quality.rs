//! Figures about the leaves, comparable between split rules and capacities.

use serde::Serialize;

/// How large the leaves of a binary tree are, and how exact.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LeafQuality {
    /// Leaves of the tree.
    pub leaves: u64,
    /// Points of the smallest leaf.
    pub points_min: u64,
    /// Points of a leaf on average.
    pub points_mean: f64,
    /// Points of the largest leaf.
    pub points_max: u64,
    /// Depth of the deepest leaf; the root is at 0.
    pub depth: usize,
    /// Volumes of the boxes of all leaves together, cubic world units.
    pub volume: f64,
    /// The largest distance on an axis between a decoded position and its lattice point, world units; over the leaves
    /// whose integers are certain.
    pub largest_error: f64,
    /// The largest distance that single precision allows in any of these leaves, world units.
    pub largest_bound: f64,
    /// Leaves that are too long for the integers of their points to be certain.
    pub uncertain: u64,
}
