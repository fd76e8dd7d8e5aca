//! The tree with what the index leaves unsaid, and the checks that need no point.

use pointmill_format::Aabb;
use pointmill_format::bintree::{Bintree, Header, Node, NodeKind};

use super::precision;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::place::{BinaryNode, Place};

/// A dataset, and for each node its parent and depth.
pub(super) struct Tree<'a> {
    pub(super) dataset: &'a Bintree,
    parents: Vec<u32>,
    depths: Vec<u16>,
}

impl<'a> Tree<'a> {
    pub(super) fn new(dataset: &'a Bintree) -> Self {
        let nodes = dataset.nodes().len();
        let (mut parents, mut depths) = (vec![0; nodes], vec![0; nodes]);
        for index in 0..nodes as u32 {
            for child in dataset.children(index).into_iter().flatten() {
                parents[child as usize] = index;
                depths[child as usize] = depths[index as usize] + 1; // the reader refuses depths above 512
            }
        }
        Self { dataset, parents, depths }
    }

    pub(super) fn header(&self) -> &Header {
        self.dataset.header()
    }

    pub(super) fn nodes(&self) -> &'a [Node] {
        self.dataset.nodes()
    }

    /// Nodes with their indices.
    pub(super) fn indexed(&self) -> impl DoubleEndedIterator<Item = (u32, &'a Node)> + ExactSizeIterator {
        // the reader takes no more nodes than 32 bits count
        self.nodes().iter().enumerate().map(|(index, node)| (index as u32, node))
    }

    /// Leaves with their indices.
    pub(super) fn leaves(&self) -> impl Iterator<Item = (u32, &'a Node)> {
        self.indexed().filter(|(_, node)| node.is_leaf())
    }

    /// The two children of an inner node with their indices.
    pub(super) fn children(&self, index: u32) -> Option<[(u32, &'a Node); 2]> {
        let [low, high] = self.dataset.children(index)?;
        Some([(low, self.nodes().get(low as usize)?), (high, self.nodes().get(high as usize)?)])
    }

    /// The node above with its index; none above the root.
    pub(super) fn parent(&self, index: u32) -> Option<(u32, &'a Node)> {
        let parent = if index == 0 { return None } else { self.parents[index as usize] };
        Some((parent, self.nodes().get(parent as usize)?))
    }

    /// The center of the first leaf at or below a node.
    pub(super) fn first_center(&self, index: u32) -> [f64; 3] {
        let centers = self.nodes()[index as usize..].iter().filter_map(|node| match node.kind {
            NodeKind::Leaf { center, .. } => Some(center),
            _ => None,
        });
        centers.take(1).next().unwrap_or_default()
    }

    /// True if, by the boxes of the index, single precision brings all integers back.
    pub(super) fn is_certain(&self) -> bool {
        let lattice = self.header().lattice;
        self.nodes().iter().all(|node| {
            let NodeKind::Leaf { center, .. } = node.kind else { return true };
            (0..3).all(|a| {
                let [min, max] = [node.bounds.min[a], node.bounds.max[a]];
                let half_extent = (max - center[a]).abs().max((min - center[a]).abs());
                let magnitude = min.abs().max(max.abs()).max(lattice.offset[a].abs());
                precision::bound(half_extent, magnitude) < lattice.scale[a] / 2.0
            })
        })
    }

    /// 0 for the root.
    pub(super) fn depth(&self, index: u32) -> usize {
        usize::from(self.depths[index as usize])
    }

    pub(super) fn deepest(&self) -> usize {
        self.depths.iter().max().map_or(0, |d| usize::from(*d))
    }

    /// What to call a node in findings.
    pub(super) fn place(&self, index: u32) -> Place {
        let (mut at, mut path, mut step) = (index, 0, 0);
        while at != 0 && step < BinaryNode::MAX_STEPS {
            let Some(&parent) = self.parents.get(at as usize) else { break };
            path |= u64::from(at != parent + 1) << step;
            (at, step) = (parent, step + 1);
        }
        let depth = self.depths.get(index as usize).copied().unwrap_or_default();
        Place::Binary(BinaryNode { index, depth, path })
    }

    /// No leaf above the capacity, no inner node at or below it.
    pub(super) fn check_capacity(&self, findings: &Findings) {
        let capacity = self.header().capacity;
        findings.checked(Check::Capacity, self.nodes().len() as u64);
        for (index, node) in self.indexed().filter(|(_, node)| node.is_leaf() != (node.count <= capacity)) {
            let (subject, expected) = match node.is_leaf() {
                true => ("points of a leaf", format!("at most {capacity}")),
                false => ("points of an inner node", format!("more than {capacity}, or it would be a leaf")),
            };
            let finding = Finding::new(Check::Capacity, subject, expected, node.count);
            findings.push(finding.at(self.place(index)).points(node.count));
        }
    }

    /// The box of an inner node is the union of its children's.
    pub(super) fn check_unions(&self, findings: &Findings) {
        for (index, node) in self.indexed() {
            let Some([(_, low), (_, high)]) = self.children(index) else { continue };
            findings.checked(Check::Unions, 1);
            let union = Aabb {
                min: [0, 1, 2].map(|a| low.bounds.min[a].min(high.bounds.min[a])),
                max: [0, 1, 2].map(|a| low.bounds.max[a].max(high.bounds.max[a])),
            };
            compare_boxes(Check::Unions, self.place(index), &union, &node.bounds, findings);
        }
    }
}

/// One finding for each face of a box that is not where it has to be.
pub(super) fn compare_boxes(check: Check, place: Place, expected: &Aabb, found: &Aabb, findings: &Findings) {
    for (face, expected, found) in [("min", expected.min, found.min), ("max", expected.max, found.max)] {
        for axis in (0..3).filter(|a| expected[*a] != found[*a]) {
            let subject = format!("{face} of {}", AXES[axis]);
            findings.push(Finding::new(check, subject, expected[axis], found[axis]).at(place));
        }
    }
}

/// What axes are called.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];
