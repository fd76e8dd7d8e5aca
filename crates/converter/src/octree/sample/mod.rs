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
        Self { candidates: Vec::new(), accepted: Vec::new(), method }
    }

    /// Forgets the candidates of the last node.
    pub(crate) fn begin(&mut self) {
        self.candidates.clear();
    }

    /// Adds the points of the next child, in Morton order.
    pub(crate) fn offer(&mut self, points: impl Iterator<Item = TreePoint>) {
        self.candidates.extend(points);
    }

    /// One flag for each candidate: true if the node takes it. At least one is true if there are candidates.
    pub(crate) fn choose(&mut self, node: NodeKey) -> &[bool] {
        self.accepted.clear();
        self.accepted.resize(self.candidates.len(), false);
        match &mut self.method {
            Method::Poisson(p) => p.choose(node.level, &self.candidates, &mut self.accepted),
            Method::Cells(Sampling::Random { seed }) => {
                cells::random(node, *seed, &self.candidates, &mut self.accepted);
            }
            Method::Cells(_) => cells::nearest_to_center(node.level, &self.candidates, &mut self.accepted),
        }
        &self.accepted
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
