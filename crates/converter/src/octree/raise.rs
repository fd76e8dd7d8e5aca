//! The rule by which points move up the tree, the same inside a chunk and above the chunks.
//!
//! A node is a leaf if it holds no more points than the capacity, or if all of them share one place. An inner node
//! takes a sample of what its children hold; they keep the rest. A leaf that loses everything is omitted. An inner
//! node that loses everything takes one point back from below, so that no inner node is empty and yet no sample has a
//! hole. That is why nodes stay *pending* until nothing above can ask them any more; nearly always that is known at
//! once, because a node has many pairs of points of which its parent can take one only.

use pointmill_format::NodeKey;

use super::sample::Sampler;
use crate::cloud::TreePoint;
use crate::error::ConvertError;

/// An inner node that keeps at least this many points whatever its parent takes can serve every ancestor that may ask
/// later (one point each, at most 31 of them); everything below it is then final.
const ENOUGH_FOR_ALL_ANCESTORS: usize = 32;

/// A node whose points are not final.
#[derive(Debug)]
pub(super) struct Pending<P> {
    pub(super) key: NodeKey,
    /// In Morton order.
    pub(super) points: Vec<P>,
    pub(super) is_inner: bool,
    /// Children that were not written yet; empty once they are.
    pub(super) children: Vec<Pending<P>>,
}

/// What the rule needs from its surroundings.
pub(super) trait Nodes<P> {
    /// Tree coordinates of a point.
    fn tree(&self, point: P) -> TreePoint;
    /// Writes a final node.
    fn write(&mut self, key: NodeKey, points: &[P]) -> Result<(), ConvertError>;
}

impl<P: Copy> Pending<P> {
    /// A leaf.
    pub(super) fn leaf(key: NodeKey, points: Vec<P>) -> Self {
        Self { key, points, is_inner: false, children: Vec::new() }
    }

    /// The node above `children` (at least one, in order): takes its sample from them, and writes what became final.
    pub(super) fn above(
        key: NodeKey,
        mut children: Vec<Self>,
        sampler: &mut Sampler,
        nodes: &mut impl Nodes<P>,
    ) -> Result<Self, ConvertError> {
        sampler.begin();
        for child in &children {
            sampler.offer(child.points.iter().map(|p| nodes.tree(*p)));
        }
        let accepted = sampler.choose(key);
        let mut points = Vec::with_capacity(accepted.iter().map(|b| usize::from(*b)).sum());
        let mut rest = accepted;
        for child in &mut children {
            let (mine, others) = rest.split_at(child.points.len());
            rest = others;
            let mut flags = mine.iter();
            child.points.retain(|p| {
                let taken = flags.next().is_some_and(|f| *f);
                if taken {
                    points.push(*p);
                }
                !taken
            });
        }
        for child in &mut children {
            child.refill();
        }
        children.retain(|c| !c.points.is_empty());
        for child in &mut children {
            if child.points.len() >= ENOUGH_FOR_ALL_ANCESTORS {
                child.write_children(nodes)?;
            }
        }
        let is_inner = !children.is_empty();
        let mut node = Self { key, points, is_inner, children };
        if key.level == 0 || node.will_keep_enough(sampler, nodes) {
            node.write_children(nodes)?;
        }
        Ok(node)
    }

    /// True if enough disjoint pairs of points (neighbours in Morton order) exclude one another in the parent's sample.
    fn will_keep_enough(&self, sampler: &Sampler, nodes: &impl Nodes<P>) -> bool {
        let Some(parent) = self.key.parent() else { return true };
        let mut pairs = 0;
        let mut rest = &self.points[..];
        while let [a, b, ..] = rest {
            let excluded = sampler.takes_one_only(parent.level, nodes.tree(*a), nodes.tree(*b));
            pairs += usize::from(excluded);
            if pairs == ENOUGH_FOR_ALL_ANCESTORS {
                return true;
            }
            rest = &rest[if excluded { 2 } else { 1 }..];
        }
        false
    }

    /// If an inner node has no point left, takes one from the child that has most.
    fn refill(&mut self) {
        if !self.is_inner || !self.points.is_empty() {
            return;
        }
        let Some(most) = self.children.iter().map(|c| c.points.len()).max() else { return };
        if let Some(at) = self.children.iter().position(|c| c.points.len() == most) {
            let donor = &mut self.children[at];
            // The middle one in Morton order: any is right, this one is most likely near the others.
            let middle = donor.points.len() / 2;
            if middle < donor.points.len() {
                self.points.push(donor.points.remove(middle));
            }
            donor.refill();
            if donor.points.is_empty() {
                self.children.remove(at);
            }
        }
        self.is_inner = !self.children.is_empty();
    }

    /// Writes everything below that is still pending; the node's own points stay.
    pub(super) fn write_children(&mut self, nodes: &mut impl Nodes<P>) -> Result<(), ConvertError> {
        let mut children = std::mem::take(&mut self.children);
        for child in &mut children {
            child.write_children(nodes)?;
        }
        for child in &children {
            nodes.write(child.key, &child.points)?;
        }
        Ok(())
    }
}
