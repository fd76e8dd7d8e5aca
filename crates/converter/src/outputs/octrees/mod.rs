//! What the octree formats have in common: the same settings give all of them the same nodes.

mod accuracy;
mod spacing;

use std::collections::HashSet;

pub(super) use accuracy::{errors, half_ulp};
pub(crate) use spacing::ChosenSpacing;

use super::attributes::{choose, is_derived};
use crate::cloud::Cloud;
use crate::error::ConvertError;
use crate::octree::{Octree, OctreeSettings, Sampling};
use crate::plan::{AttributeChoice, PlanError, PlanFault, Setting};
use crate::report::{ChoiceReason, PlannedChoice, TreeReport};
use crate::sources::{POSITION_BYTES, ResolvedCrs, Schema};
use crate::warning::ViewerNote;
use serde_json::{Map, Value};

/// Bytes of the points of a subtree that one thread builds. Part of the result, and the same whatever else is written in
/// the same run.
pub(super) const UNIT_BYTES: u64 = 10_000_000;

/// Points of such a subtree: larger ones leave the caches and the threads uneven.
const UNIT_POINTS: std::ops::RangeInclusive<u64> = 20_000..=300_000;

/// How the tree is made, whatever the format: formats with the same settings share one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TreeSettings {
    pub(super) sampling: Sampling,
    /// World units, in the root; `None`: it is chosen.
    pub(super) spacing: Option<f64>,
    pub(super) leaf_capacity: u32,
    /// Of an inner node.
    pub(super) most_points: u32,
}

impl TreeSettings {
    /// Refuses what cannot be used.
    pub(super) fn check(&self) -> Result<(), ConvertError> {
        let refuse = |setting, fault| Err(PlanError::new(setting, fault).into());
        if self.leaf_capacity == 0 {
            return refuse(Setting::LeafCapacity, PlanFault::Zero);
        }
        if self.spacing.is_some_and(|s| !(s > 0.0 && s.is_finite())) {
            return refuse(Setting::Spacing, PlanFault::NotPositive);
        }
        Ok(())
    }

    /// Adds them to the settings of the report.
    pub(super) fn describe(&self, settings: &mut Map<String, Value>) {
        settings.insert("sampling".into(), self.sampling.name().into());
        if let Sampling::Random { seed } = self.sampling {
            settings.insert("seed".into(), seed.into());
        }
        if let Some(spacing) = self.spacing {
            settings.insert("spacing".into(), spacing.into());
        }
        settings.insert("leaf-capacity".into(), self.leaf_capacity.into());
    }

    /// What shapes the tree. `leaf_capacity`: the default.
    pub(super) fn choices(&self, leaf_capacity: u32) -> Vec<PlannedChoice> {
        vec![
            PlannedChoice::or_default("sampling", self.sampling.name(), Sampling::Poisson.name()),
            PlannedChoice::or_chosen("spacing of the root", self.spacing, ChoiceReason::RootPoints),
            PlannedChoice::or_default("points of a leaf, at most", self.leaf_capacity, leaf_capacity),
        ]
    }

    /// The tree of a cloud.
    pub(super) fn of(&self, spacing: &ChosenSpacing, cloud: &Cloud<'_>) -> OctreeSettings {
        OctreeSettings {
            sampling: self.sampling,
            spacing: spacing.spacing,
            leaf_capacity: self.leaf_capacity,
            most_points: self.most_points,
            unit_points: self.unit_points(cloud),
        }
    }

    /// Points of a subtree that one thread builds.
    fn unit_points(&self, cloud: &Cloud<'_>) -> u64 {
        let (least, most) = UNIT_POINTS.into_inner();
        let usual = (UNIT_BYTES / chosen_bytes(cloud) as u64).clamp(least, most);
        cloud.plan.subtree_points.unwrap_or(usual).max(self.leaf_capacity.into())
    }
}

/// Bytes of a point with all attributes that the plan asks for. A format may hold fewer: what it holds shapes no tree.
fn chosen_bytes(cloud: &Cloud<'_>) -> usize {
    let of = |schema: &Schema, kept: &dyn Fn(usize) -> bool| -> usize {
        schema.attributes.iter().enumerate().filter(|(i, _)| kept(*i)).map(|(_, a)| a.size()).sum()
    };
    let (all, plan) = (&cloud.sources.attributes, cloud.plan);
    POSITION_BYTES
        + match &plan.attributes {
            AttributeChoice::Usual | AttributeChoice::All => of(all, &|_| true),
            AttributeChoice::List(names) => {
                of(all, &|i| names.contains(&all.attributes[i].name) || is_derived(&plan.derive, all, i))
            }
            AttributeChoice::Scene => {
                let schema = cloud.schema();
                let kept = choose(plan, schema, &cloud.intake.unread, &cloud.facts.ranges, &[]).kept;
                of(schema, &|i| kept.contains(&i))
            }
        }
}

/// What viewers make of the coordinate reference system.
pub(super) fn system_note(crs: &ResolvedCrs) -> Option<ViewerNote> {
    let system = || crs.label.clone();
    if crs.is_geocentric {
        Some(ViewerNote::Geocentric { system: system() })
    } else if crs.is_geographic() {
        Some(ViewerNote::Degrees { system: system() })
    } else {
        None
    }
}

/// The nodes of a tree in figures.
pub(super) fn tree_report(tree: &Octree) -> TreeReport {
    let nodes = &tree.nodes;
    let depth = nodes.iter().map(|n| usize::from(n.key.level)).max().unwrap_or(0);
    let mut report = TreeReport {
        nodes: nodes.len() as u64,
        depth: depth as u32,
        points_per_level: vec![0; depth + 1],
        nodes_per_level: vec![0; depth + 1],
        overfull_leaves: tree.overfull_leaves,
        largest_leaf: 0,
        unit_points: tree.unit_points,
    };
    let parents: HashSet<_> = nodes.iter().filter_map(|n| n.key.parent()).collect();
    for n in nodes {
        report.points_per_level[usize::from(n.key.level)] += u64::from(n.points);
        report.nodes_per_level[usize::from(n.key.level)] += 1;
        if !parents.contains(&n.key) {
            report.largest_leaf = report.largest_leaf.max(u64::from(n.points));
        }
    }
    report
}
