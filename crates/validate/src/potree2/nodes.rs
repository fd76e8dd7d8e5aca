//! The nodes of a Potree 2.0 dataset, and what is checked of each alone.

use std::sync::{Mutex, PoisonError};

use pointmill_format::potree2::{Dataset, Encoding, Node};
use pointmill_format::{NodePoints, ReadError};

use super::checks::ranges::Seen;
use crate::accuracy::{Deviation, Ordered};
use crate::against::Sums;
use crate::finding::Findings;
use crate::octree::blocks::fill_blocks;
use crate::octree::expect::Geometry;
use crate::octree::lattices::Lattices;
use crate::octree::node_points;
use crate::octree::tree::TreeNode;
use crate::octree::walk;

/// The nodes, and what was seen of them so far.
pub(crate) struct Nodes<'a> {
    dataset: &'a Dataset,
    geometry: Geometry,
    lattices: Lattices,
    /// Where records are summed for the comparison with the sources.
    sums: Option<&'a Sums>,
    findings: &'a Findings,
    seen: Mutex<Seen>,
    deviations: Ordered<usize, Deviation>,
}

impl<'a> Nodes<'a> {
    pub(crate) fn new(
        dataset: &'a Dataset,
        geometry: Geometry,
        lattices: Lattices,
        sums: Option<&'a Sums>,
        findings: &'a Findings,
    ) -> Self {
        let seen = Mutex::new(Seen::new(dataset.metadata()));
        Self { dataset, geometry, lattices, sums, findings, seen, deviations: Ordered::default() }
    }

    /// Values of all points, and how far decoded positions are from the points of the lattice.
    pub(crate) fn finish(self) -> (Seen, Deviation) {
        let mut deviation = Deviation::default();
        self.deviations.finish().for_each(|d| deviation.merge(&d));
        (self.seen.into_inner().unwrap_or_else(PoisonError::into_inner), deviation)
    }
}

impl walk::Nodes for Nodes<'_> {
    fn read(&self, node: &TreeNode, points: &mut NodePoints) -> Result<(), ReadError> {
        self.dataset.read_points(&Node::new(node.key, node.record), points)
    }

    fn positions(&self, _: &TreeNode, points: &NodePoints) -> Vec<[i32; 3]> {
        let [xs, ys, zs] = points.quantized().unwrap_or_default();
        xs.iter().zip(ys).zip(zs).map(|((x, y), z)| [*x, *y, *z]).collect()
    }

    fn check(&self, index: usize, node: &TreeNode, points: &NodePoints) -> bool {
        let (key, findings) = (node.key, self.findings);
        let positions = points.quantized().unwrap_or_default();
        node_points::coordinates(key, positions, findings);
        let all_inside = node_points::boxes(key, positions, &self.geometry, findings);
        if self.dataset.metadata().encoding == Encoding::Brotli {
            node_points::order(key, positions, findings);
        }
        let mut seen = Seen::new(self.dataset.metadata());
        seen.add(points);
        self.deviations.put(index, self.lattices.deviation(positions));
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).merge(&seen);
        if let Some(sums) = self.sums {
            sums.add(|block, sink| fill_blocks(points, sums.rules(), block, sink));
        }
        all_inside
    }
}
