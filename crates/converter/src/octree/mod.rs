//! The octree, whatever format it is written in: chunks built in parallel and put behind one another in Morton order.
//!
//! 1. [`divide`] cuts the cloud into chunks, nodes small enough to be built in memory alone.
//! 2. [`chunk`] puts the points of a chunk in Morton order ([`order`]), divides them into nodes and moves points up the
//!    tree by the rule of [`raise`]; inner nodes take a [`sample`] of their children.
//! 3. [`commit`] puts chunks behind one another and builds the few nodes above them ([`top`]) as their children become
//!    complete; what waits for that is in [`list`]s, in memory or on the disk.
//!
//! Finished nodes go to a [`sink`], behind which a format stands. The order of nodes depends on the tree alone: a node's
//! children are written, in order, once the node can no longer be asked for a point; the root comes last.

mod chunk;
mod commit;
mod divide;
mod list;
mod order;
mod place;
mod raise;
mod sample;
mod sink;
mod top;

pub(crate) use commit::Octree;
#[cfg(feature = "bench")]
pub(crate) use order::{OrderScratch, Point, order};
pub use sample::Sampling;
pub(crate) use sample::{SPACING_BITS, Sampler};
pub(crate) use sink::{FinishedNode, NodeEncoder, NodeSink};

use crate::cloud::Cloud;
use crate::error::ConvertError;
use crate::runtime::Runtime;
use chunk::{ChunkBuilder, ChunkPlan};
use commit::Committer;
use top::TopNodes;

/// How a tree is built.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OctreeSettings {
    pub(crate) sampling: Sampling,
    /// A node with more points is divided, unless all of them share one place.
    pub(crate) leaf_capacity: u32,
}

/// Builds the tree of a cloud and hands its nodes to `sink`.
pub(crate) fn build<S: NodeSink>(
    cloud: &Cloud<'_>,
    rt: &Runtime<'_>,
    settings: OctreeSettings,
    sink: &S,
) -> Result<Octree, ConvertError> {
    let (chunks, _room) = divide::divide(cloud, rt, rt.budget.chunk_points)?;
    let plan = ChunkPlan {
        cloud,
        leaf_capacity: settings.leaf_capacity,
        usual_points: rt.budget.chunk_points.min(cloud.points()),
    };
    let keys = chunks.iter().map(|c| c.key).collect();
    let top = TopNodes::new(cloud, rt, Sampler::new(settings.sampling), sink);
    let committer = Committer::new(keys, rt.budget.window, sink, top);
    rt.in_parallel_or(
        chunks.len(),
        || ChunkBuilder::new(&plan, Sampler::new(settings.sampling), sink.encoder()),
        |builder, index| {
            let Some(buffer) = committer.admit(index) else { return Ok(()) };
            rt.check_stop()?; // it may have waited long
            let chunk = &chunks[index];
            let built = if chunk.points > rt.budget.chunk_points {
                builder.release();
                place::build(&plan, chunk, rt, rt.budget.chunk_bytes())?
            } else {
                builder.build(chunk, buffer)?
            };
            committer.submit(index, built)?;
            rt.advance(chunks[index].points);
            Ok(())
        },
        |_| (),
        |index| committer.stop_above(index),
    )?;
    let tree = committer.finish()?;
    tree.ledger.check(&cloud.stats.checksum)?;
    Ok(tree)
}
