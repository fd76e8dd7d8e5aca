//! How an inner node chooses its points from those of its children.
//!
//! All samplers see the candidates in Morton order, in tree coordinates, and depend on nothing else: the same points,
//! the same sample, whatever the threads, the budget and the order of the inputs.

mod cells;
mod poisson;
mod spacing;

use pointmill_format::NodeKey;

pub(crate) use spacing::SPACING_BITS;
pub use spacing::Sampling;

use crate::cloud::TreePoint;
use spacing::cell_shift;

/// Chooses samples; one for each thread.
pub(crate) struct Sampler {
    node: NodeKey,
    candidates: Vec<TreePoint>,
    accepted: Vec<bool>,
    method: Method,
}

enum Method {
    Poisson(Box<poisson::Poisson>),
    Cells(Sampling),
}

impl Sampler {
    pub(crate) fn new(sampling: Sampling) -> Self {
        let method = match sampling {
            Sampling::Poisson => Method::Poisson(Box::default()),
            other => Method::Cells(other),
        };
        Self { node: NodeKey::ROOT, candidates: Vec::new(), accepted: Vec::new(), method }
    }

    /// Begins with a node.
    pub(crate) fn begin(&mut self, node: NodeKey) {
        self.candidates.clear();
        if let Method::Poisson(p) = &mut self.method {
            p.begin();
        }
        self.node = node;
    }

    /// Says how many candidates of the node there will be.
    pub(crate) fn expect(&mut self, candidates: u64) {
        if let Method::Poisson(p) = &mut self.method {
            p.expect(candidates);
        }
    }

    /// Memory that the points taken so far need, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        match &self.method {
            Method::Poisson(p) => p.bytes(),
            Method::Cells(_) => 0,
        }
    }

    /// Adds the points of the next child, or a part of them, in Morton order.
    pub(crate) fn offer(&mut self, points: impl Iterator<Item = TreePoint>) {
        self.candidates.extend(points);
    }

    /// One flag for each candidate since the last call: true if the node takes it. Of all candidates of a node at least one
    /// is taken. Between two calls for a node, no part may be cut ([`Self::may_be_cut`]).
    pub(crate) fn choose(&mut self) -> &[bool] {
        self.accepted.clear();
        self.accepted.resize(self.candidates.len(), false);
        let node = self.node;
        match &mut self.method {
            Method::Poisson(p) => p.choose(node.level, &self.candidates, &mut self.accepted),
            Method::Cells(Sampling::Random { seed }) => {
                cells::random(node, *seed, &self.candidates, &mut self.accepted);
            }
            Method::Cells(_) => cells::nearest_to_center(node.level, &self.candidates, &mut self.accepted),
        }
        self.candidates.clear();
        &self.accepted
    }

    /// True if candidates of a node of `level` that follow each other may come in two parts.
    pub(crate) fn may_be_cut(level: u8, a: TreePoint, b: TreePoint) -> bool {
        let shift = cell_shift(level) + poisson::TILE_BITS;
        a.cell(shift) != b.cell(shift)
    }

    /// True if a node of `level` cannot take both points, whatever else it is offered.
    pub(crate) fn takes_one_only(&self, level: u8, a: TreePoint, b: TreePoint) -> bool {
        let shift = cell_shift(level);
        match self.method {
            Method::Poisson(_) => {
                let squared: u64 = (0..3).map(|i| u64::from(a[i].abs_diff(b[i])).pow(2)).sum();
                squared < 1 << (2 * shift)
            }
            Method::Cells(_) => a.cell(shift) == b.cell(shift),
        }
    }
}
