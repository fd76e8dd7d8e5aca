//! What is known of an earlier tree, and how far the new one is.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use pointmill_format::NodeKey;

use super::division::{EarlierUnit, divide};
use super::nodes::{EarlierNodes, Scratch};
use super::samples::{Samples, Sampling};
use crate::cloud::{TreePoint, xyz};
use crate::error::ConvertError;
use crate::octree::borders::Surroundings;
use crate::octree::divide::Subtree;
use crate::octree::share::needs;
use crate::octree::sink::EarlierTree;
use crate::octree::unit::{Outer, Shared};
use crate::octree::units::{Unit, Work, in_order};
use crate::plan::Duplicates;
use crate::reason::BuiltAnew;

/// A smaller leaf might have had as many points as there are levels, and have none left: what it was is not known.
const LEAST_CAPACITY: u32 = 32;

/// As many earlier units have their samples in memory.
const MOST_SAMPLES: usize = 64;

/// An earlier tree, and how far the new one is.
pub(in crate::octree) struct Earlier<'a> {
    pub(super) nodes: EarlierNodes<'a>,
    /// Its units, in their order.
    pub(super) units: Vec<EarlierUnit>,
    by_key: HashMap<NodeKey, usize>,
    /// For each of its units those before it that it has seen.
    seen: Vec<Vec<usize>>,
    /// For each new unit those before it that it sees.
    sees: Vec<Vec<usize>>,
    /// New units that are built or taken over.
    done: Vec<OnceLock<Done>>,
    /// What earlier units had taken near their borders, of those that were asked for.
    samples: Mutex<HashMap<usize, Arc<Samples>>>,
    new: &'a [Unit],
    new_by_key: HashMap<NodeKey, usize>,
    unit_points: u64,
    pub(super) shared: &'a Shared<'a>,
}

/// A new unit.
struct Done {
    is_taken_over: bool,
    /// Its nodes that have taken points near its border.
    border: Vec<NodeKey>,
}

/// Points near the border of a unit, by the node that has taken them.
type Seen = BTreeMap<(u8, [u32; 3]), Vec<TreePoint>>;

impl<'a> Earlier<'a> {
    /// `unit_points`: of the new tree; `new`: its units. [`BuiltAnew`]: nothing can be taken over.
    pub(in crate::octree) fn of(
        tree: &'a dyn EarlierTree,
        unit_points: u64,
        new: &'a [Unit],
        shared: &'a Shared<'a>,
    ) -> Result<Result<Self, BuiltAnew>, ConvertError> {
        let plan = &shared.plan;
        let is_like_it = tree.unit_points() == unit_points
            && plan.most_points == u32::MAX
            && plan.leaf_capacity >= LEAST_CAPACITY
            && plan.cloud.plan.duplicates == Duplicates::Keep;
        if !is_like_it {
            return Ok(Err(BuiltAnew::Units));
        }
        let Some(nodes) = EarlierNodes::read(tree, &shared.rt.memory)? else { return Ok(Err(BuiltAnew::Memory)) };
        let Some(found) = divide(&nodes, unit_points, shared)? else { return Ok(Err(BuiltAnew::Memory)) };
        let mut found: HashMap<NodeKey, EarlierUnit> = found.into_iter().map(|unit| (unit.key, unit)).collect();
        let subtrees = found.values().filter(|unit| !unit.is_above);
        let order = in_order(subtrees.map(|unit| Subtree { key: unit.key, chunks: Vec::new() }).collect());
        let units: Vec<EarlierUnit> = order.iter().filter_map(|unit| found.remove(&unit.key)).collect();
        if units.len() != order.len() || !found.is_empty() {
            return Ok(Err(BuiltAnew::Units));
        }
        let by_key = units.iter().enumerate().map(|(i, unit)| (unit.key, i)).collect();
        let new_by_key = new.iter().enumerate().map(|(i, unit)| (unit.key, i)).collect();
        let done = new.iter().map(|_| OnceLock::new()).collect();
        let (seen, sees, samples) = (needs(&order), needs(new), Mutex::default());
        Ok(Ok(Self { nodes, units, by_key, seen, sees, done, samples, new, new_by_key, unit_points, shared }))
    }

    /// The earlier unit that was made of the same as a new one: of as many points, or of the same children, all of which were
    /// taken over.
    pub(super) fn like(&self, index: usize) -> Option<usize> {
        let new = &self.new[index];
        let known = *self.by_key.get(&new.key)?;
        let earlier = &self.units[known];
        let is_like_it = match &new.work {
            Work::Subtree(_) => !earlier.is_above && earlier.points == new.points(),
            Work::Above(children) => {
                let is_taken_over = |key| {
                    let done = self.new_by_key.get(key).and_then(|child| self.done[*child].get());
                    done.is_some_and(|done| done.is_taken_over)
                };
                let known_children =
                    (0..8).filter_map(|child| new.key.child(child)).filter(|c| self.by_key.contains_key(c));
                earlier.is_above && children.iter().all(is_taken_over) && known_children.eq(children.iter().copied())
            }
        };
        is_like_it.then_some(known)
    }

    /// Notes what a new unit has taken near its border, before those begin that see it.
    pub(in crate::octree) fn note(&self, index: usize, outer: &Outer, is_taken_over: bool) {
        let border = outer.iter().map(|(key, _)| *key).collect();
        let _ = self.done[index].set(Done { is_taken_over, border }); // once for each
    }

    /// True if a new unit sees just what the earlier one had seen; all before it are done.
    pub(super) fn sees_the_same(&self, index: usize, earlier: usize) -> Result<bool, ConvertError> {
        let unit = self.new[index].key;
        let deepest = if self.units[earlier].is_above { unit.level } else { u8::MAX };
        let mut before: HashSet<usize> = self.seen[earlier].iter().copied().collect();
        let (mut now, mut then) = (Seen::new(), Seen::new());
        for &other in &self.sees[index] {
            let Some(done) = self.done[other].get() else { return Ok(false) };
            let same = self.by_key.get(&self.new[other].key).filter(|_| done.is_taken_over);
            if same.is_some_and(|same| before.remove(same)) {
                continue; // what was taken over has the same borders
            }
            for key in done.border.iter().filter(|key| (unit.level..=deepest).contains(&key.level)) {
                let Some(mut near) = self.near(unit, *key, &mut now) else { continue };
                self.shared.borders.get(*key, &mut near)?;
            }
        }
        for other in before {
            for sample in &self.samples(other)?.nodes {
                if !(unit.level..=deepest).contains(&sample.key.level) {
                    continue;
                }
                let Some(near) = self.near(unit, sample.key, &mut then) else { continue };
                sample.points.iter().copied().for_each(near);
                if sample.is_doubtful && then.get(&place(sample.key)).is_some_and(|points| !points.is_empty()) {
                    return Ok(false);
                }
            }
        }
        Ok(settled(now) == settled(then))
    }

    /// Adds points of a node that the nodes of a unit see to `seen`.
    fn near<'s>(&self, unit: NodeKey, key: NodeKey, seen: &'s mut Seen) -> Option<impl FnMut(TreePoint) + use<'s>> {
        let near = Surroundings::of(unit, self.shared.borders.spacing().reach(key.level)?);
        let points = seen.entry(place(key)).or_default();
        Some(move |point| {
            if near.hold(point) {
                points.push(point);
            }
        })
    }

    /// What an earlier unit had taken near its border.
    fn samples(&self, unit: usize) -> Result<Arc<Samples>, ConvertError> {
        let known = || self.samples.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(samples) = known().get(&unit) {
            return Ok(Arc::clone(samples));
        }
        let (mut scratch, mut records) = (Scratch::default(), Vec::new());
        let stride = self.shared.lists.stride;
        let own = |key, out: &mut Vec<TreePoint>| {
            records.clear();
            self.nodes.records(key, &mut scratch, &mut records)?;
            out.extend(records.chunks_exact(stride).map(|record| self.shared.plan.cloud.frame.tree(record)));
            Ok(())
        };
        let samples = Arc::new(self.samples_with(&self.units[unit], own)?);
        let mut known = known();
        if known.len() >= MOST_SAMPLES {
            known.clear();
        }
        known.insert(unit, Arc::clone(&samples));
        Ok(samples)
    }

    /// The same; `own`: appends the points of a node.
    pub(super) fn samples_with(
        &self,
        unit: &EarlierUnit,
        own: impl FnMut(NodeKey, &mut Vec<TreePoint>) -> Result<(), ConvertError>,
    ) -> Result<Samples, ConvertError> {
        let Shared { plan, lists, borders, .. } = self.shared;
        if !unit.is_above && unit.points > self.unit_points {
            return Ok(Samples::default()); // of one place: a leaf
        }
        let mut taken = Vec::new();
        lists.each(&unit.taken, |records| {
            taken.extend(records.chunks_exact(lists.stride).map(|record| plan.cloud.frame.tree(record)));
            Ok(true)
        })?;
        let (leaf_capacity, found) = (plan.leaf_capacity.into(), Samples::default());
        let spacing = borders.spacing();
        let (nodes, is_above) = (&self.nodes, unit.is_above);
        let mut sampling = Sampling { nodes, spacing, leaf_capacity, unit: unit.key, is_above, own, found };
        sampling.of(unit.key, taken)?;
        Ok(sampling.found)
    }
}

fn place(key: NodeKey) -> (u8, [u32; 3]) {
    (key.level, xyz(key))
}

/// The points of each node in order, without nodes that have none.
fn settled(mut seen: Seen) -> Seen {
    seen.retain(|_, points| !points.is_empty());
    seen.values_mut().for_each(|points| points.sort_unstable_by_key(|point| point.0));
    seen
}
