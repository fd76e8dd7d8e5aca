//! The octree, whatever format it is written in.
//!
//! 1. [`divide`] cuts the cloud into subtrees, and these into chunks, small enough to be built in memory.
//! 2. [`units`] puts subtrees and the nodes above them into the order in which they are made, [`unit`] makes one.
//! 3. [`chunk`] puts the points of a chunk in Morton order ([`crate::cloud::order`]), divides them into nodes and moves points up the
//!    tree by the rule of [`raise`]; inner nodes take a [`sample`] of their children, and keep the distance to what
//!    neighbours have taken over their [`borders`]. Nodes above a chunk do the same with [`lists`] of records, in memory or
//!    on the disk.
//! 4. [`commit`] puts the finished nodes of the units behind one another.
//! 5. With a job, what a unit comes to is kept ([`keep`]), so that another run, or another process, need not build it; units that
//!    several processes [`share`] are built one by one.
//! 6. Where points are added to a tree, units that they do not touch are taken from the [`earlier`] one.
//!
//! Finished nodes go to a [`sink`], behind which a format stands, or to several ([`sinks`]), each with its own bytes. The order of nodes depends on the tree alone: within a
//! unit, a node's children are written, in order, once the node can no longer be asked for a point; the root comes last.

mod borders;
mod chunk;
mod commit;
mod divide;
mod earlier;
mod finished;
mod keep;
mod list;
mod lists;
mod make;
mod place;
mod raise;
mod sample;
mod share;
mod sink;
mod sinks;
mod unit;
mod units;

pub(crate) use commit::Octree;
#[cfg(feature = "bench")]
pub(crate) use sample::Sampler;
pub use sample::Sampling;
pub(crate) use sample::Spacing;
pub(crate) use sink::{EarlierTree, FinishedNode, NodeEncoder, NodeSink};
pub(crate) use sinks::AnySink;
use sinks::{Several, Sinks};

use crate::error::ConvertError;
use crate::job::Build;
use borders::Borders;
use chunk::ChunkPlan;
use commit::Committer;
use earlier::Earlier;
use list::Lists;
use make::Making;
use unit::Shared;

/// How a tree is built.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OctreeSettings {
    pub(crate) sampling: Sampling,
    pub(crate) spacing: Spacing,
    /// A node with more points is divided, unless all of them share one place.
    pub(crate) leaf_capacity: u32,
    /// An inner node keeps no more points than this; the others go to its children.
    pub(crate) most_points: u32,
    /// A subtree of so many points is built by one thread: part of the result.
    pub(crate) unit_points: u64,
}

/// Builds the tree of a cloud and hands its nodes to `sink`.
pub(crate) fn build(build: Build<'_>, settings: OctreeSettings, sink: &impl NodeSink) -> Result<Octree, ConvertError> {
    let tree = build_for(build, settings, sink)?.pop();
    tree.ok_or_else(|| ConvertError::Internal("a tree for no format".into()))
}

/// Builds the tree of a cloud once and hands its nodes to each of `sinks`; returns the tree as each of them has it.
pub(crate) fn build_all(
    build: Build<'_>,
    settings: OctreeSettings,
    sinks: &[&dyn AnySink],
) -> Result<Vec<Octree>, ConvertError> {
    build_for(build, settings, &Several::new(sinks, build.cloud.frame.stride))
}

fn build_for<S: Sinks>(build: Build<'_>, settings: OctreeSettings, sinks: &S) -> Result<Vec<Octree>, ConvertError> {
    let Build { cloud, rt, units: kept } = build;
    let OctreeSettings { sampling, spacing, leaf_capacity, most_points, unit_points } = settings;
    let (chunk_points, window) = rt.budget.units(unit_points.min(cloud.points()), cloud.frame.stride);
    let mut division = divide::divide(build, unit_points, chunk_points)?;
    let chunk_points = division.chunk_points;
    let units = units::in_order(std::mem::take(&mut division.subtrees));
    let all: Vec<_> = units.iter().map(|unit| (unit.key, unit.points())).collect();
    let kept = kept.map(|kept| kept.divided(cloud, &all)).transpose()?;
    let usual_points = chunk_points.min(cloud.points());
    let shared = Shared {
        plan: ChunkPlan {
            cloud,
            leaf_capacity,
            most_points,
            unit_points: unit_points.min(cloud.points()),
            usual_points,
            is_of_others: kept.is_some_and(|of| of.is_of_others()),
        },
        rt,
        lists: Lists::new(cloud.frame.stride, &rt.memory, &rt.temp),
        borders: Borders::new(spacing, &rt.memory, &rt.temp),
        chunk_points,
        chunk_bytes: rt.budget.chunk_bytes(),
    };
    if let Some((of, job)) = kept.and_then(|of| Some((of, of.in_parts()?))) {
        share::share(&units, of, job, &shared, sinks, sampling)?;
    }
    let earlier = sinks.earlier().map(|tree| Earlier::of(tree, unit_points, &units, &shared)).transpose()?;
    let built_anew = earlier.as_ref().and_then(|earlier| earlier.as_ref().err()).copied();
    let earlier = earlier.as_ref().and_then(|earlier| earlier.as_ref().ok());
    let committer = Committer::new(units.len(), window, sinks, &shared.lists, rt);
    let in_place: Option<Vec<_>> = (0..sinks.count()).map(|stream| sinks.kept(stream)).collect();
    let in_place = in_place.as_deref();
    Making { units: &units, kept, in_place, earlier, shared: &shared, committer: &committer, sinks, sampling }.all()?;
    let mut trees = committer.finish(unit_points)?;
    trees.iter_mut().for_each(|tree| tree.taken_over.why_not = built_anew);
    trees.iter().try_for_each(|tree| tree.ledger.check(&cloud.stats.checksum))?;
    Ok(trees)
}
