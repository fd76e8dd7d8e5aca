//! What is told of an octree: its metadata and its part of the report.

use pointmill_format::potree2::{AttributeStats, Encoding as StoredEncoding, HierarchyBytes, Metadata, NodeEntry};
use pointmill_format::{Aabb, Attribute, AttributeType, Lattice};
use serde_json::Map;

use super::HIERARCHY_STEP;
use crate::build::chunk::Accounts;
use crate::convert::Run;
use crate::describe::{name_of, sampling_name};
use crate::gather::Range;
use crate::job::Job;
use crate::needs;
use crate::plan::{AttributeChoice, Encoding};
use crate::report::{DroppedAttribute, TreeReport};
use crate::sample::SPACING_BITS;

/// Attributes that go into an octree, and those that do not.
pub(crate) struct Choice {
    /// Indices of the schema, in output order.
    pub(crate) kept: Vec<usize>,
    pub(crate) dropped: Vec<DroppedAttribute>,
}

/// All, those that vary, or those that were named.
pub(crate) fn choose_attributes(choice: &AttributeChoice, job: &Job, ranges: &[Range]) -> Choice {
    let all = 0..job.schema.attributes.len();
    match choice {
        AttributeChoice::Usual | AttributeChoice::All => Choice { kept: all.collect(), dropped: Vec::new() },
        AttributeChoice::Scene => {
            let (mut kept, mut dropped) = (Vec::new(), Vec::new());
            for i in all {
                match ranges[i].constant() {
                    Some(values) => {
                        let text: Vec<String> = values.iter().map(f64::to_string).collect();
                        let name = job.schema.attributes[i].name.clone();
                        let why = format!("constant {}", text.join(" "));
                        dropped.push(DroppedAttribute { name, why, constant: Some(values.to_vec()) });
                    }
                    None => kept.push(i),
                }
            }
            Choice { kept, dropped }
        }
        AttributeChoice::List(names) => {
            // A name that is not there was refused before anything was read.
            let mut kept: Vec<usize> = Vec::new();
            for i in names.iter().filter_map(|name| job.schema.find(name)) {
                if !kept.contains(&i) {
                    kept.push(i);
                }
            }
            let dropped = needs::dropped(&job.schema, &job.unread, |i| kept.contains(&i), "not asked for");
            Choice { kept, dropped }
        }
    }
}

/// The metadata of the dataset.
pub(super) fn metadata(run: &Run<'_>, choice: &Choice, accounts: &Accounts, hierarchy: &HierarchyBytes) -> Metadata {
    let Run { plan, job, gathered, facts, .. } = *run;
    let offset = facts.grid.offset;
    let side = gathered.cube.side;
    let lattice = Lattice { scale: facts.grid.scale, offset };
    let stats = &gathered.stats;
    let stored = |q: [i64; 3]| std::array::from_fn(|a| q[a] - gathered.cube.min[a]);
    let mut position = AttributeStats {
        attribute: Attribute::new("position", AttributeType::Int32, 3),
        min: lattice.world(stored(stats.bounds.min)).to_vec(),
        max: lattice.world(stored(stats.bounds.max)).to_vec(),
        histogram: None,
    };
    position.attribute.description = String::new();
    let mut attributes = vec![position];
    attributes.extend(choice.kept.iter().map(|&i| {
        let attribute = job.schema.attributes[i].clone();
        let range = &facts.ranges[i];
        // A range must be there and finite; a column of NaN has none.
        let finite = |v: &[f64]| v.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect::<Vec<_>>();
        let histogram = (attribute.name == "classification" && attribute.ty == AttributeType::UInt8).then(|| {
            let mut left = stats.classes.clone();
            left.iter_mut().zip(&accounts.classes_dropped).for_each(|(all, dropped)| *all -= dropped);
            left
        });
        AttributeStats { attribute, min: finite(&range.min), max: finite(&range.max), histogram }
    }));
    let mut own = facts.own_key(plan, job, &choice.dropped);
    own.insert("sampling".into(), sampling_name(plan.sampling).into());
    own.insert("leafCapacity".into(), plan.leaf_capacity.into());
    Metadata {
        name: name_of(plan),
        description: String::new(),
        points: stats.points - accounts.duplicates_dropped,
        projection: facts.crs.projection.clone(),
        first_chunk_size: hierarchy.first_chunk_size,
        step_size: HIERARCHY_STEP,
        depth: hierarchy.depth,
        lattice,
        spacing: side / f64::from(1 << SPACING_BITS),
        cube: Aabb { min: offset, max: offset.map(|v| v + side) },
        encoding: match plan.encoding {
            Encoding::Default => StoredEncoding::Default,
            Encoding::Brotli { .. } => StoredEncoding::Brotli,
        },
        attributes,
        extra: Map::from_iter([("pointmill".to_owned(), own.into())]),
    }
}

pub(super) fn tree_report(nodes: &[NodeEntry], accounts: &Accounts) -> TreeReport {
    let depth = nodes.iter().map(|n| usize::from(n.key.level)).max().unwrap_or(0);
    let mut report = TreeReport {
        nodes: nodes.len() as u64,
        depth: depth as u32,
        points_per_level: vec![0; depth + 1],
        nodes_per_level: vec![0; depth + 1],
        overfull_leaves: accounts.overfull_leaves,
        largest_leaf: 0,
    };
    let parents: std::collections::HashSet<_> = nodes.iter().filter_map(|n| n.key.parent()).collect();
    for n in nodes {
        report.points_per_level[usize::from(n.key.level)] += u64::from(n.points);
        report.nodes_per_level[usize::from(n.key.level)] += 1;
        if !parents.contains(&n.key) {
            report.largest_leaf = report.largest_leaf.max(u64::from(n.points));
        }
    }
    report
}
