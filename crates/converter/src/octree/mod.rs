//! The Potree 2.0 octree: chunks built in parallel, put behind one another in Morton order, and the files around them.

mod metadata;

use std::panic::AssertUnwindSafe;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use pointmill_format::potree2::encode_hierarchy;

use crate::build::chunk::{BuiltChunk, ChunkBuilder, ChunkPlan};
use crate::build::commit::{Built, Committer};
use crate::chunks::{self, Chunk};
use crate::convert::Run;
use crate::error::ConvertError;
use crate::records::{OutputLayout, RecordFrame};
use crate::report::OutputReport;
use crate::sample::Sampler;
use crate::write::dataset::StagedDataset;
use crate::write::payload::PayloadWriter;

pub(crate) use metadata::choose_attributes;

/// Elements of an attribute that readers of the format accept.
const MAX_ELEMENTS: usize = 16;

/// Levels a hierarchy chunk, as the reference converter has it.
const HIERARCHY_STEP: u32 = 4;

/// Builds and writes the dataset.
pub(crate) fn write(run: &Run<'_>, staged: &StagedDataset) -> Result<OutputReport, ConvertError> {
    let Run { plan, job, gathered, facts, budget, .. } = *run;
    let choice = choose_attributes(&plan.attributes, job, &facts.ranges);
    let frame = RecordFrame { stride: job.schema.stride, cube: gathered.cube, base: gathered.base };
    let wide = choice.kept.iter().map(|&i| &job.schema.attributes[i]).find(|a| a.elements > MAX_ELEMENTS);
    if let Some(attribute) = wide {
        return Err(ConvertError::Unsupported(format!(
            "potree2: \"{}\" has {} elements a point, viewers read up to {MAX_ELEMENTS}; name the attributes to keep with \
             --attributes",
            attribute.name, attribute.elements
        )));
    }
    let layout = OutputLayout::new(&job.schema, &choice.kept, &frame);
    let chunks = chunks::plan(gathered, &frame, budget.chunk_points)?;
    for chunk in &chunks {
        budget.check_chunk(chunk.points)?;
    }
    let built = build(run, &frame, &layout, &chunks, staged)?;
    run.account(built.accounts.unaltered())?;

    let mut nodes = built.nodes;
    let hierarchy = encode_hierarchy(&mut nodes, HIERARCHY_STEP);
    let metadata = metadata::metadata(run, &choice, &built.accounts, &hierarchy);
    staged.write("hierarchy.bin", &hierarchy.bytes)?;
    let json = metadata.to_json();
    staged.write("metadata.json", json.as_bytes())?;
    Ok(OutputReport {
        points: metadata.points,
        attributes: run.names(choice.kept.iter().copied()),
        attributes_dropped: choice.dropped,
        bytes: built.bytes + (hierarchy.bytes.len() + json.len()) as u64,
        checksum: built.accounts.unaltered().to_string(),
        tree: metadata::tree_report(&nodes, &built.accounts),
        ..OutputReport::default()
    })
}

fn build(
    run: &Run<'_>,
    frame: &RecordFrame,
    layout: &OutputLayout,
    chunks: &[Chunk],
    staged: &StagedDataset,
) -> Result<Built, ConvertError> {
    let Run { plan, gathered, facts, budget, pool, events, .. } = *run;
    let (file, path) = staged.create("octree.bin")?;
    let writer = || PayloadWriter::new(layout.clone(), plan.encoding);
    let keys = chunks.iter().map(|c| c.key).collect();
    let sampler = Sampler::new(plan.sampling);
    let committer = Committer::new(&file, &path, keys, budget.window, frame.stride, sampler, writer());
    let chunk_plan = ChunkPlan {
        frame,
        store: &gathered.store,
        leaf_capacity: plan.leaf_capacity,
        usual_points: budget.chunk_points.min(gathered.stats.points),
        duplicates: plan.duplicates,
        widen_rgb: &facts.widen_rgb,
        class: facts.class,
    };
    let next = AtomicUsize::new(0);
    let failed: Mutex<Option<(usize, ConvertError)>> = Mutex::new(None);
    pool.broadcast(|_| {
        let mut builder = ChunkBuilder::new(&chunk_plan, Sampler::new(plan.sampling), writer());
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(chunk) = chunks.get(index) else { break };
            let Some(buffer) = committer.admit(index) else { break };
            let result = if events.stop_requested() {
                Err(ConvertError::Interrupted)
            } else {
                // A panic must not leave the other threads waiting for this chunk.
                let build = AssertUnwindSafe(|| {
                    builder.build(chunk, buffer).and_then(|built: BuiltChunk| committer.submit(index, built))
                });
                std::panic::catch_unwind(build)
                    .unwrap_or_else(|_| Err(ConvertError::Internal(format!("building node {} failed", chunk.key))))
            };
            events.advance(chunk.points);
            if let Err(error) = result {
                committer.stop();
                if let Ok(mut failed) = failed.lock()
                    && failed.as_ref().is_none_or(|(i, _)| index < *i)
                {
                    *failed = Some((index, error));
                }
                break;
            }
        }
    });
    if let Ok(Some((_, error))) = failed.into_inner() {
        return Err(error);
    }
    let built = committer.finish()?;
    file.sync_all().map_err(|e| ConvertError::io(&path, "syncing the payloads", e))?;
    Ok(built)
}
