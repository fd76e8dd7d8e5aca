//! The rule by which points move up the tree, the same inside a chunk and above the chunks.
//!
//! A node is a leaf if it holds no more points than the capacity, or if all of them share one place. An inner node
//! takes a sample of what its children hold; they keep the rest. A leaf that loses everything is omitted. An inner
//! node that loses everything, or all of whose candidates are too near to points of its neighbours, takes one point back
//! from below, so that no inner node is empty and yet no sample has a hole. That is why nodes stay *pending* until nothing above can ask them any more; nearly always that is known at
//! once, because a node has many pairs of points of which its parent can take one only.

use pointmill_format::NodeKey;

use super::sample::Sampler;
use crate::cloud::TreePoint;
use crate::error::ConvertError;

/// An inner node that keeps at least this many points whatever its parent takes can serve every ancestor that may ask
/// later (one point each, at most 31 of them); everything below it is then final.
pub(super) const ENOUGH_FOR_ALL_ANCESTORS: usize = 32;

/// A node whose points are not final; `L`: a list of points.
#[derive(Debug)]
pub(super) struct Pending<L> {
    pub(super) key: NodeKey,
    /// In Morton order.
    pub(super) points: L,
    pub(super) is_inner: bool,
    /// Children that were not written yet; empty once they are.
    pub(super) children: Vec<Pending<L>>,
}

/// A list of points in Morton order.
pub(super) trait Points {
    /// Their number.
    fn count(&self) -> u64;
}

/// What the rule needs from its surroundings.
pub(super) trait Nodes<L: Points> {
    /// Chooses the points of the node above `children`; these keep the rest.
    fn sample(&mut self, key: NodeKey, children: &mut [Pending<L>]) -> Result<L, ConvertError>;

    /// The most points that an inner node keeps.
    fn most_points(&self) -> u64;

    /// Gives points back to `children`, of whom they were taken, evenly: [`Self::most_points`] stay.
    fn give_back(&mut self, key: NodeKey, points: L, children: &mut [Pending<L>]) -> Result<L, ConvertError>;

    /// The points of lists that follow one another, in one.
    fn join(&mut self, lists: Vec<L>) -> Result<L, ConvertError>;

    /// Moves the middle one of a list into a list of its own.
    fn take_middle(&mut self, from: &mut L) -> Result<L, ConvertError>;

    /// True if `enough` disjoint pairs of points (neighbours in Morton order) exclude one another in a sample of `level`.
    fn excludes(&mut self, level: u8, points: &L, enough: usize) -> Result<bool, ConvertError>;

    /// Writes a final node.
    fn write(&mut self, key: NodeKey, points: L) -> Result<(), ConvertError>;
}

/// Whether the `i`th of `all` points is among `most` that are spread evenly over them.
pub(super) fn stays(i: u64, all: u64, most: u64) -> bool {
    let before = |i: u64| u128::from(i) * u128::from(most) / u128::from(all.max(1));
    before(i + 1) > before(i)
}

impl<L: Points> Pending<L> {
    /// A leaf.
    pub(super) fn leaf(key: NodeKey, points: L) -> Self {
        Self { key, points, is_inner: false, children: Vec::new() }
    }

    /// The node above `children` (at least one, in order): takes its sample from them, and writes what became final.
    pub(super) fn above(
        key: NodeKey,
        mut children: Vec<Self>,
        nodes: &mut impl Nodes<L>,
    ) -> Result<Self, ConvertError> {
        let mut points = nodes.sample(key, &mut children)?;
        if points.count() > nodes.most_points() {
            points = nodes.give_back(key, points, &mut children)?;
        }
        for child in &mut children {
            child.refill(nodes)?;
        }
        children.retain(|c| c.points.count() > 0);
        for child in &mut children {
            if child.points.count() >= ENOUGH_FOR_ALL_ANCESTORS as u64 {
                child.write_children(nodes)?;
            }
        }
        let is_inner = !children.is_empty();
        let mut node = Self { key, points, is_inner, children };
        if node.will_keep_enough(nodes)? {
            node.write_children(nodes)?;
        }
        Ok(node)
    }

    /// The node above `children`: a leaf if they have no more than `capacity` points together, as where duplicates were
    /// dropped.
    pub(super) fn above_or_leaf(
        key: NodeKey,
        children: Vec<Self>,
        capacity: u32,
        nodes: &mut impl Nodes<L>,
    ) -> Result<Self, ConvertError> {
        let points: u64 = children.iter().map(|c| c.points.count()).sum();
        if points > u64::from(capacity) || children.iter().any(|c| c.is_inner) {
            return Self::above(key, children, nodes);
        }
        let points = nodes.join(children.into_iter().map(|c| c.points).collect())?;
        Ok(Self::leaf(key, points))
    }

    /// True if nothing above can take so many points that the node needs one from below.
    fn will_keep_enough(&self, nodes: &mut impl Nodes<L>) -> Result<bool, ConvertError> {
        match self.key.parent() {
            None => Ok(true),
            Some(parent) => nodes.excludes(parent.level, &self.points, ENOUGH_FOR_ALL_ANCESTORS),
        }
    }

    /// If an inner node has no point, takes one from the child that has most.
    fn refill(&mut self, nodes: &mut impl Nodes<L>) -> Result<(), ConvertError> {
        if !self.is_inner || self.points.count() > 0 {
            return Ok(());
        }
        let Some(most) = self.children.iter().map(|c| c.points.count()).max() else { return Ok(()) };
        if let Some(at) = self.children.iter().position(|c| c.points.count() == most) {
            let donor = &mut self.children[at];
            donor.refill(nodes)?;
            if donor.points.count() > 0 {
                // The middle one in Morton order: any is right, this one is most likely near the others.
                self.points = nodes.take_middle(&mut donor.points)?;
            }
            donor.refill(nodes)?;
            if donor.points.count() == 0 {
                self.children.remove(at);
            }
        }
        self.is_inner = !self.children.is_empty();
        Ok(())
    }

    /// Writes everything below that is still pending; the node's own points stay.
    pub(super) fn write_children(&mut self, nodes: &mut impl Nodes<L>) -> Result<(), ConvertError> {
        let mut children = std::mem::take(&mut self.children);
        for child in &mut children {
            child.write_children(nodes)?;
        }
        for child in children {
            nodes.write(child.key, child.points)?;
        }
        Ok(())
    }
}

/// Counts disjoint pairs of neighbours that exclude one another in a sample of a level, as points come in order.
pub(super) struct Pairs {
    level: u8,
    last: Option<TreePoint>,
    pub(super) count: usize,
}

impl Pairs {
    pub(super) fn new(level: u8) -> Self {
        Self { level, last: None, count: 0 }
    }

    pub(super) fn add(&mut self, sampler: &Sampler, next: TreePoint) {
        let excluded = self.last.is_some_and(|last| sampler.takes_one_only(self.level, last, next));
        self.count += usize::from(excluded);
        self.last = (!excluded).then_some(next);
    }
}
