//! The nodes of a COPC file, and what is checked of each alone.

use std::sync::{Mutex, PoisonError};

use pointmill_format::copc::{Dataset, Info};
use pointmill_format::octree::{Octree as _, OctreeNode};
use pointmill_format::{Lattice, NodePoints, ReadError};
use serde_json::json;

use super::boxes::Limits;
use super::seen::Seen;
use crate::accuracy::{Deviation, Ordered};
use crate::against::Sums;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::blocks::fill_blocks;
use crate::octree::expect::Geometry;
use crate::octree::lattices::Lattices;
use crate::octree::tree::TreeNode;
use crate::octree::walk;

/// What the walk needs, and what was seen so far.
pub(super) struct Nodes<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) info: &'a Info,
    pub(super) geometry: Geometry,
    /// Steps from the 0 of stored positions to that of [`Geometry::lattice`].
    pub(super) shift: [i64; 3],
    pub(super) lattices: Lattices,
    /// Where records are summed for the comparison with the sources.
    pub(super) sums: Option<&'a Sums>,
    /// The file promises that no point is out of its node by a step.
    pub(super) is_ours: bool,
    pub(super) findings: &'a Findings,
    pub(super) seen: Mutex<Seen>,
    pub(super) deviations: Ordered<usize, Deviation>,
}

impl Nodes<'_> {
    /// Values of all points, and how far decoded positions are from the points of the lattice.
    pub(super) fn finish(self) -> (Seen, Deviation) {
        let mut deviation = Deviation::default();
        self.deviations.finish().for_each(|d| deviation.merge(&d));
        (self.seen.into_inner().unwrap_or_else(PoisonError::into_inner), deviation)
    }

    /// True if no point is farther out of the box of its node than rounding brings it.
    fn boxes(&self, node: &TreeNode, positions: [&[i32]; 3], lattice: &Lattice) -> bool {
        self.findings.checked(Check::Boxes, positions[0].len() as u64);
        let limits = Limits::new(node.key, &self.geometry, lattice);
        let outside = limits.outside(positions);
        let world = outside.first.map(|stored| lattice.world(stored.map(i64::from)));
        let expected = json!({ "min": limits.node.min, "max": limits.node.max });
        for (subject, count, is_loose) in
            [("position", outside.far, false), ("position, by a step", outside.near, !self.is_ours)]
        {
            if count > 0 {
                let finding = Finding::new(Check::Boxes, subject, expected.clone(), json!(world));
                let finding = finding.at(node.key).points(count);
                self.findings.push(if is_loose { finding.warning() } else { finding });
            }
        }
        outside.far == 0
    }

    /// GPS times that the info record does not have.
    fn gps_times(&self, node: &TreeNode, points: &NodePoints) {
        let [first, last] = self.info.gps_time;
        let times = points.column::<f64>("gps-time").unwrap_or_default();
        let mut outside = times.iter().filter(|t| !(first..=last).contains(t));
        if let Some(time) = outside.next() {
            let found = format!("{time}");
            let finding = Finding::new(Check::GpsTime, "GPS time", json!([first, last]), found).at(node.key);
            self.findings.push(finding.points(1 + outside.count() as u64));
        }
    }
}

/// The node as the reader wants it.
pub(super) fn located(node: &TreeNode) -> OctreeNode {
    let mut located = OctreeNode::new(node.key);
    located.points = u64::from(node.record.points);
    (located.byte_offset, located.byte_size) = (node.record.byte_offset, node.record.byte_size);
    located
}

impl walk::Nodes for Nodes<'_> {
    fn read(&self, node: &TreeNode, points: &mut NodePoints) -> Result<(), ReadError> {
        self.dataset.read_points(&located(node), points)
    }

    fn positions(&self, _: &TreeNode, points: &NodePoints) -> Vec<[i32; 3]> {
        let [xs, ys, zs] = points.quantized().unwrap_or_default();
        let narrow = |v: i64| v.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        let shifted = |axis: usize, v: i32| narrow(i64::from(v).saturating_sub(self.shift[axis]));
        xs.iter().zip(ys).zip(zs).map(|((x, y), z)| [shifted(0, *x), shifted(1, *y), shifted(2, *z)]).collect()
    }

    fn check(&self, index: usize, node: &TreeNode, points: &NodePoints) -> bool {
        let positions = points.quantized().unwrap_or_default();
        let all_inside = self.boxes(node, positions, &self.dataset.lattice());
        self.gps_times(node, points);
        let mut seen = Seen::new(&self.dataset.info().attributes);
        seen.add(points);
        self.deviations.put(index, self.lattices.deviation(positions));
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).merge(&seen);
        if let Some(sums) = self.sums {
            sums.add(|block, sink| fill_blocks(points, sums.rules(), block, sink));
        }
        all_inside
    }
}
