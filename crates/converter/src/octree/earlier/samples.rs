//! What the nodes of an earlier unit had taken near its border, before nodes above took points from them.
//!
//! Points go up the tree through each node, so that the sample of an inner node was what it has and what nodes above it have
//! of its cube. An inner node that lost everything took one point back ([`crate::octree::raise`]), which may not have been
//! of its sample, and has one point at most then: of such nodes the sample is not known.

use pointmill_format::NodeKey;

use super::division::is_one_place;
use super::nodes::EarlierNodes;
use crate::cloud::{TreePoint, morton};
use crate::error::ConvertError;
use crate::octree::borders::Inside;
use crate::octree::sample::Spacing;

/// The samples of a unit near its border.
#[derive(Default)]
pub(super) struct Samples {
    pub(super) nodes: Vec<Sample>,
}

/// What a node had taken near the border of its unit.
pub(super) struct Sample {
    pub(super) key: NodeKey,
    pub(super) points: Vec<TreePoint>,
    /// Perhaps not all of these.
    pub(super) is_doubtful: bool,
}

impl Samples {
    /// True if the sample of a node is not known.
    pub(super) fn are_doubtful(&self) -> bool {
        self.nodes.iter().any(|sample| sample.is_doubtful)
    }
}

/// Works out the samples of a unit; `own`: appends the points of a node.
pub(super) struct Sampling<'a, F> {
    pub(super) nodes: &'a EarlierNodes<'a>,
    pub(super) spacing: Spacing,
    pub(super) leaf_capacity: u64,
    pub(super) unit: NodeKey,
    /// The unit is a node alone.
    pub(super) is_above: bool,
    pub(super) own: F,
    pub(super) found: Samples,
}

impl<F: FnMut(NodeKey, &mut Vec<TreePoint>) -> Result<(), ConvertError>> Sampling<'_, F> {
    /// Those of a node and of all below it; `points`: those that nodes above have of its cube.
    pub(super) fn of(&mut self, key: NodeKey, mut points: Vec<TreePoint>) -> Result<(), ConvertError> {
        // on deeper levels nodes see nothing of one another
        let Some(reach) = self.spacing.reach(key.level) else { return Ok(()) };
        let all = self.nodes.points(key) + points.len() as u64;
        let has_children = self.nodes.has_children(key);
        if !has_children && all <= self.leaf_capacity {
            return Ok(()); // a leaf takes no sample
        }
        (self.own)(key, &mut points)?;
        if !has_children && is_one_place(points.iter().copied()) {
            return Ok(());
        }
        let inside = Inside::of(self.unit, reach);
        let outer: Vec<TreePoint> = points.iter().filter(|point| !inside.holds(**point)).copied().collect();
        if !outer.is_empty() {
            let is_doubtful = self.nodes.own_points(key) < 2;
            self.found.nodes.push(Sample { key, points: outer, is_doubtful });
        }
        if self.is_above {
            return Ok(());
        }
        let mut parts: [Vec<TreePoint>; 8] = Default::default();
        points.iter().for_each(|point| parts[usize::from(morton::child_index(*point, key.level))].push(*point));
        drop(points);
        for (child, part) in (0..8).filter_map(|c| key.child(c)).zip(parts) {
            if self.nodes.points(child) + part.len() as u64 > 0 {
                self.of(child, part)?;
            }
        }
        Ok(())
    }
}
