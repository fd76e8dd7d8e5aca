//! How an inner node chooses its points from those of its children.
//!
//! All samplers see the candidates in Morton order, in tree coordinates, and what neighbours of the same level that
//! were sampled before have taken near the border; they depend on nothing else.

mod cells;
mod neighbours;
mod poisson;
mod spacing;
mod taken;
mod tile;

use pointmill_format::NodeKey;

pub use spacing::Sampling;
pub(crate) use spacing::Spacing;

use crate::cloud::{TREE_BITS, TreePoint};
use crate::runtime::Vectors;
use cells::Candidates;
use neighbours::{OverBorder, TILE_BITS, tile_code};
use spacing::squared_distance;

/// Chooses samples; one for each thread.
pub(crate) struct Sampler {
    spacing: Spacing,
    node: NodeKey,
    /// The lower corner of the node.
    corner: TreePoint,
    candidates: Vec<TreePoint>,
    accepted: Vec<bool>,
    over_border: OverBorder,
    /// Points taken so far that neighbours must know.
    border: Vec<TreePoint>,
    method: Method,
}

enum Method {
    Poisson(Box<poisson::Poisson>),
    Cells { sampling: Sampling, are_free: Vec<bool> },
}

impl Sampler {
    pub(crate) fn new(sampling: Sampling, spacing: Spacing) -> Self {
        let method = match sampling {
            Sampling::Poisson => Method::Poisson(Box::new(poisson::Poisson::new(spacing, Vectors::best()))),
            other => Method::Cells { sampling: other, are_free: Vec::new() },
        };
        Self {
            spacing,
            node: NodeKey::ROOT,
            corner: TreePoint([0; 3]),
            candidates: Vec::new(),
            accepted: Vec::new(),
            over_border: OverBorder::default(),
            border: Vec::new(),
            method,
        }
    }

    /// Begins with a node; `over_border`: what others of its level have taken closer to it than the spacing.
    pub(crate) fn begin(&mut self, node: NodeKey, over_border: &[TreePoint]) {
        self.candidates.clear();
        self.border.clear();
        if let Method::Poisson(p) = &mut self.method {
            p.begin();
        }
        self.node = node;
        let bits = TREE_BITS - u32::from(node.level);
        self.corner = TreePoint([node.x, node.y, node.z].map(|c| (u64::from(c) << bits) as u32));
        self.over_border.begin(node.level, self.corner, self.spacing, over_border);
    }

    /// Memory that a node of so many candidates needs at most, bytes.
    pub(crate) fn expected_bytes(&self, candidates: u64) -> u64 {
        match &self.method {
            Method::Poisson(p) => p.expected_bytes(candidates),
            Method::Cells { .. } => 0,
        }
    }

    /// Says how many candidates of the node there will be.
    pub(crate) fn expect(&mut self, candidates: u64) {
        if let Method::Poisson(p) = &mut self.method {
            p.expect(candidates);
        }
    }

    /// Memory that the points taken so far and those around the node need, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        let taken = match &self.method {
            Method::Poisson(p) => p.bytes(),
            Method::Cells { .. } => 0,
        };
        taken + self.over_border.bytes() + size_of_val(self.border.as_slice()) as u64
    }

    /// Gives back the memory of the last node.
    pub(crate) fn release(&mut self) {
        if let Method::Poisson(p) = &mut self.method {
            p.release();
        }
        self.over_border = OverBorder::default();
        self.border = Vec::new();
    }

    /// Adds the points of the next child, or a part of them, in Morton order.
    pub(crate) fn offer(&mut self, points: impl Iterator<Item = TreePoint>) {
        self.candidates.extend(points);
    }

    /// One flag for each candidate since the last call: true if the node takes it. Where neighbours have taken nothing,
    /// at least one of all candidates of a node is taken. Between two calls for a node, no part may be cut
    /// ([`Self::may_be_cut`]).
    pub(crate) fn choose(&mut self) -> &[bool] {
        self.accepted.clear();
        self.accepted.resize(self.candidates.len(), false);
        let level = self.node.level;
        match (&mut self.method, self.spacing.unit_bits(level)) {
            // The spacing is less than one unit: only repeated places conflict, and they are neighbours in Morton
            // order.
            (_, None) => {
                for (i, accepted) in self.accepted.iter_mut().enumerate() {
                    *accepted = i == 0 || self.candidates[i] != self.candidates[i - 1];
                }
            }
            (Method::Poisson(p), Some(unit_bits)) => {
                p.choose(unit_bits, self.corner, &self.candidates, &mut self.over_border, &mut self.accepted);
            }
            (Method::Cells { sampling, are_free }, Some(shift)) => {
                let conflict_below = self.spacing.squared(level);
                free(&self.candidates, shift, self.corner, conflict_below, &mut self.over_border, are_free);
                let candidates = Candidates { points: &self.candidates, are_free, shift };
                match sampling {
                    Sampling::Random { seed } => cells::random(self.node, *seed, &candidates, &mut self.accepted),
                    _ => cells::nearest_to_center(&candidates, &mut self.accepted),
                }
            }
        }
        self.note_border();
        self.candidates.clear();
        &self.accepted
    }

    /// Notes which of the points just taken lie closer to the border of the node than the spacing.
    fn note_border(&mut self) {
        let Some(reach) = self.spacing.reach(self.node.level) else { return };
        if self.node.level == 0 {
            return;
        }
        let inner = (1u32 << (TREE_BITS - u32::from(self.node.level))) - 2 * reach;
        for (t, _) in self.candidates.iter().zip(&self.accepted).filter(|(_, taken)| **taken) {
            let is_inside = (0..3).all(|a| (t[a] - self.corner[a]).wrapping_sub(reach) < inner);
            if !is_inside {
                self.border.push(*t);
            }
        }
    }

    /// The points taken from the node so far that lie closer to its border than the spacing.
    pub(crate) fn border(&self) -> &[TreePoint] {
        &self.border
    }

    /// True if candidates of a node of `level` that follow each other may come in two parts.
    pub(crate) fn may_be_cut(&self, level: u8, a: TreePoint, b: TreePoint) -> bool {
        let shift = self.spacing.unit_bits(level).map_or(0, |bits| bits + TILE_BITS);
        a.cell(shift) != b.cell(shift)
    }

    /// True if a node of `level` cannot take both points, whatever else it is offered.
    pub(crate) fn takes_one_only(&self, level: u8, a: TreePoint, b: TreePoint) -> bool {
        match (&self.method, self.spacing.unit_bits(level)) {
            (_, None) => a == b,
            // well below it, so that no rounding matters
            (Method::Poisson(_), Some(_)) => squared_distance(a, b) < self.spacing.squared(level) * (1.0 - 1e-9),
            (Method::Cells { .. }, Some(shift)) => a.cell(shift) == b.cell(shift),
        }
    }
}

/// Finds the candidates that are not too near to what neighbours have taken.
fn free(
    candidates: &[TreePoint],
    unit_bits: u32,
    corner: TreePoint,
    conflict_below: f64,
    over_border: &mut OverBorder,
    are_free: &mut Vec<bool>,
) {
    let shift = unit_bits + TILE_BITS;
    are_free.clear();
    are_free.resize(candidates.len(), true);
    let mut at = 0;
    while let Some(first) = candidates.get(at) {
        let tile = first.cell(shift);
        let run = candidates[at..].iter().take_while(|t| t.cell(shift) == tile).count();
        let near = over_border.of_tile(tile_code(*first, corner, shift));
        if !near.is_empty() {
            for i in at..at + run {
                are_free[i] = near.iter().all(|(_, p)| squared_distance(*p, candidates[i]) >= conflict_below);
            }
        }
        at += run;
    }
}

#[cfg(test)]
mod tests;
