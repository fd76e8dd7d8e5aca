//! The nodes of a Potree 1.x dataset, and what is checked of each alone.

use std::sync::{Mutex, PoisonError};

use pointmill_format::potree1::{Dataset, NodeFiles};
use pointmill_format::{Aabb, NodeKey, NodePoints, Positions, ReadError};
use serde_json::json;

use super::records::{Columns, fill_blocks};
use super::steps::Steps;
use crate::accuracy::{Deviation, Ordered};
use crate::against::Sums;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::expect::Geometry;
use crate::octree::node_points;
use crate::octree::tree::TreeNode;
use crate::octree::walk;

/// What the walk needs, and what was seen so far.
pub(crate) struct Nodes<'a> {
    pub(crate) dataset: &'a Dataset,
    /// Of a node, where the dataset promises it.
    pub(crate) most_points: Option<u64>,
    pub(crate) geometry: Geometry,
    pub(crate) steps: &'a Steps,
    /// Where records are summed for the comparison with the sources, and the columns that are compared.
    pub(crate) sums: Option<(&'a Sums, &'a Columns)>,
    pub(crate) findings: &'a Findings,
    pub(crate) seen: Mutex<Aabb>,
    pub(crate) deviations: Ordered<usize, Deviation>,
}

impl Nodes<'_> {
    /// The box of all points, and how far decoded positions are from the points of the lattice.
    pub(crate) fn finish(self) -> (Aabb, Deviation) {
        let mut deviation = Deviation::default();
        self.deviations.finish().for_each(|d| deviation.merge(&d));
        (self.seen.into_inner().unwrap_or_else(PoisonError::into_inner), deviation)
    }

    /// Stored coordinates in the node's own box, which begins at 0: closed, a step and what rounding can come to wider.
    fn stored_in_box(&self, key: NodeKey, stored: &[Vec<i32>; 3]) -> u64 {
        let (node, scale) = (self.geometry.node_box(key), self.dataset.metadata().scale);
        let last = [0, 1, 2].map(|a| {
            let steps = (node.max[a] - node.min[a] + self.geometry.tolerance(a)) / scale + 1.0;
            steps.floor().min(f64::from(i32::MAX)) as i32
        });
        let [xs, ys, zs] = stored;
        let is_outside = |((x, y), z): &((&i32, &i32), &i32)| **x > last[0] || **y > last[1] || **z > last[2];
        xs.iter().zip(ys).zip(zs).filter(is_outside).count() as u64
    }

    /// World coordinates in the node's box.
    fn world_in_box(&self, key: NodeKey, points: &NodePoints) -> u64 {
        let (node, scale) = (self.geometry.node_box(key), self.dataset.metadata().scale);
        let is_outside = |p: [f64; 3]| {
            (0..3).any(|a| {
                let slack = scale + self.geometry.tolerance(a);
                !(node.min[a] - slack..=node.max[a] + slack).contains(&p[a])
            })
        };
        (0..points.len()).filter(|i| points.world(*i).is_some_and(is_outside)).count() as u64
    }
}

impl walk::Nodes for Nodes<'_> {
    fn read(&self, node: &TreeNode, points: &mut NodePoints) -> Result<(), ReadError> {
        self.dataset.read_points(node.key, points)
    }

    fn positions(&self, node: &TreeNode, points: &NodePoints) -> Vec<[i32; 3]> {
        let [xs, ys, zs] = [0, 1, 2].map(|axis| self.steps.axis(node.key, points, axis));
        let narrow = |v: i64| v.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        xs.into_iter().zip(ys).zip(zs).map(|((x, y), z)| [x, y, z].map(narrow)).collect()
    }

    fn check(&self, index: usize, node: &TreeNode, points: &NodePoints) -> bool {
        let (key, findings) = (node.key, self.findings);
        let is_stored = self.dataset.metadata().files == NodeFiles::Bin;
        findings.checked(Check::Boxes, points.len() as u64);
        let outside = match points.positions() {
            Positions::Quantized(stored) if is_stored => {
                node_points::coordinates(key, stored.each_ref().map(Vec::as_slice), findings);
                self.stored_in_box(key, stored)
            }
            Positions::World(_) if is_stored => {
                findings.checked(Check::Coordinates, points.len() as u64);
                let finding = Finding::new(Check::Coordinates, "stored coordinates", "below 2^31", "2^31 or more");
                findings.push(finding.at(key));
                0
            }
            _ => self.world_in_box(key, points),
        };
        if outside > 0 {
            let node = self.geometry.node_box(key);
            let expected = json!({ "min": node.min, "max": node.max });
            findings.push(Finding::new(Check::Boxes, "position", expected, "outside").at(key).points(outside));
        }
        let mut seen = Aabb::EMPTY;
        (0..points.len()).filter_map(|i| points.world(i)).for_each(|p| seen.grow(p));
        let is_one_place = node.record.child_mask == 0 && seen.min == seen.max;
        if let Some(most) = self.most_points.filter(|most| points.len() as u64 > *most && !is_one_place) {
            let finding =
                Finding::new(Check::NodeCounts, "points of the node", format!("at most {most}"), points.len());
            findings.push(finding.at(key));
        }
        let mut all = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        *all = all.union(&seen);
        drop(all);
        self.deviations.put(index, self.steps.deviation(key, points));
        if let Some((sums, columns)) = self.sums {
            sums.add(|block, sink| fill_blocks(key, points, (self.steps, columns), sums.rules(), block, sink));
        }
        outside == 0
    }
}

/// The box of the points against what is stated. If not every node could be read (`complete` is false), only points beyond
/// it are found.
pub(crate) fn tight_box(dataset: &Dataset, geometry: &Geometry, seen: &Aabb, complete: bool, findings: &Findings) {
    let Some(stated) = dataset.metadata().tight_box else {
        findings.skip(Check::TightBox, "cloud.js has no tightBoundingBox");
        return;
    };
    if seen.is_empty() {
        return;
    }
    findings.checked(Check::TightBox, 6);
    let sides = [("lower corner", stated.min, seen.min, -1.0), ("upper corner", stated.max, seen.max, 1.0)];
    for (subject, stated, seen, side) in sides {
        let wrong = |a: usize| {
            let beyond = (seen[a] - stated[a]) * side;
            let tolerance = dataset.metadata().scale + geometry.tolerance(a);
            if complete { beyond.abs() > tolerance } else { beyond > tolerance }
        };
        if (0..3).any(wrong) {
            let subject = format!("{subject} of tightBoundingBox");
            findings.push(Finding::new(Check::TightBox, subject, json!(seen), json!(stated)));
        }
    }
}
