//! Quantised batches: the cloud is cut into runs of the batches' Morton order, which threads sort and encode one by
//! one. Batches and cells that two runs share are put together by whoever comes last, and at the end.

mod buckets;
mod compress;
mod content;
mod figures;
mod finish;
mod frame;
mod lod;
mod order;
mod output;
mod task;
#[cfg(test)]
mod tests;
mod work;

use pointmill_format::batches::{Layout, Precision, f32_above, f32_below};

use crate::convert::Run;
use crate::error::ConvertError;
use crate::gather::Store;
use crate::plan::BatchesSettings;
use crate::report::OutputReport;
use crate::write::dataset::StagedDataset;
use buckets::Task;
use content::Content;
use finish::{Finished, finish};
use frame::{Frame, refused};
use output::{ORIGINAL_BYTES, Output};
use task::{Outcome, Worker, Workshop, bytes_per_point};

/// The file of the dataset.
const FILE: &str = "points.qbatch";

/// Tasks a thread, so that threads end together; their sizes. Small ones share too much with each other, large ones leave
/// the caches.
const TASKS_PER_THREAD: u64 = 6;
const MOST_TASK_POINTS: u64 = 800_000;
const LEAST_TASK_POINTS: u64 = 50_000;

/// Builds and writes the dataset.
pub(crate) fn write(
    run: &Run<'_>,
    settings: &BatchesSettings,
    staged: &StagedDataset,
) -> Result<OutputReport, ConvertError> {
    let points = run.gathered.stats.points;
    let most = run.budget.task_points(bytes_per_point(run.job.schema.stride), MOST_TASK_POINTS);
    let share = points / (run.plan.threads.max(1) as u64 * TASKS_PER_THREAD);
    let task_points = share.max(LEAST_TASK_POINTS).min(most);
    let content = Content::choose(run);
    let frame = Frame::new(run, settings.lod_cell)?;
    let attributes: Vec<_> = content.extras.iter().map(|e| e.attribute.clone()).collect();
    let layout = Layout::new(points, &attributes, planes_at_most(&frame, settings.planes)).map_err(refused)?;
    let tasks = buckets::tasks(run, &frame, task_points)?;
    for task in &tasks {
        run.budget.check_task(task.points, task_points, bytes_per_point(run.job.schema.stride))?;
    }
    let (file, path) = staged.create(FILE)?;
    // what is compressed is written raw first, elsewhere
    let raw = match settings.zstd_level {
        None => None,
        Some(_) => Some(tempfile::tempfile_in(run.temp_dir).map_err(|e| temp_file(run, e))?),
    };
    let originals = Store::new(run.temp_dir, ORIGINAL_BYTES, 1, run.gathered.store.unused_bytes());
    let output = match &raw {
        None => Output::new(&file, &path, &layout, originals),
        Some(raw) => Output::new(raw, run.temp_dir, &layout, originals),
    };
    let outcome = encode(run, &frame, &content, &output, settings.originals, &tasks, task_points)?;
    run.account(outcome.written)?;
    let mut finished = finish(run, settings, &frame, &content, &output, &outcome)?;
    if let (Some(raw), Some(level)) = (&raw, settings.zstd_level) {
        compress::compress(run, (raw, run.temp_dir), (&file, &path), level, &mut finished)?;
    }
    file.sync_all().map_err(|e| ConvertError::io(&path, "syncing the batches", e))?;
    Ok(report(run, settings, &frame, content, &finished, &outcome))
}

fn temp_file(run: &Run<'_>, error: std::io::Error) -> ConvertError {
    ConvertError::io(run.temp_dir, "making a temporary file", error)
}

fn report(
    run: &Run<'_>,
    settings: &BatchesSettings,
    frame: &Frame,
    content: Content,
    finished: &Finished,
    outcome: &Outcome,
) -> OutputReport {
    OutputReport {
        points: run.gathered.stats.points,
        attributes: run.names(content.kept.iter().copied()),
        attributes_dropped: content.dropped,
        bytes: finished.bytes,
        checksum: outcome.written.to_string(),
        details: figures::details(frame, finished, settings),
        warnings: content.warnings,
        ..OutputReport::default()
    }
}

/// The planes that are written at first; more are never needed.
fn planes_at_most(frame: &Frame, planes: Option<u8>) -> Precision {
    if let Some(planes) = planes {
        return Precision::from_bits(10 * u32::from(planes)).unwrap_or(Precision::Thirty);
    }
    // no batch is larger than the cloud
    let far = frame.grid.relative(frame.tight.max);
    let near = frame.grid.relative(frame.tight.min);
    let cloud = pointmill_format::batches::BatchRecord {
        min: near.map(f32_below),
        first_point: 0,
        max: far.map(f32_above),
        points: 1,
    };
    Precision::for_steps([&cloud], frame.lattice.scale)
}

/// Encodes all tasks; edges come back in the order of the tasks.
fn encode(
    run: &Run<'_>,
    frame: &Frame,
    content: &Content,
    output: &Output<'_>,
    keeps_originals: bool,
    tasks: &[Task],
    task_points: u64,
) -> Result<Outcome, ConvertError> {
    let shop = Workshop {
        frame,
        content,
        store: &run.gathered.store,
        stride: run.job.schema.stride,
        output,
        keeps_originals,
        usual_points: task_points.min(run.gathered.stats.points),
    };
    let outcomes = work::in_parallel(
        run,
        tasks.len(),
        || Worker::new(&shop),
        |worker, index| {
            worker.run(index, &tasks[index])?;
            run.events.advance(tasks[index].points);
            Ok(())
        },
        Worker::finish,
    )?;
    let mut all = Outcome::default();
    for mut outcome in outcomes {
        all.written.merge(&outcome.written);
        all.lod_points.iter_mut().zip(outcome.lod_points).for_each(|(a, b)| *a += b);
        all.edges.append(&mut outcome.edges);
    }
    all.edges.sort_unstable_by_key(|(index, _)| *index);
    Ok(all)
}
