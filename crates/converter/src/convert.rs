//! A run, all passes in order.

use std::panic::AssertUnwindSafe;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use pointmill_format::ReadError;
use pointmill_format::potree2::encode_hierarchy;

use crate::budget::Budget;
use crate::build::chunk::{BuiltChunk, ChunkBuilder, ChunkPlan};
use crate::build::commit::{Built, Committer};
use crate::chunks::{self, Chunk};
use crate::describe::{Description, HIERARCHY_STEP, choose_attributes, resolve_crs};
use crate::error::ConvertError;
use crate::events::{Events, Phase};
use crate::gather::{Gathered, Outcome, Stats, gather, outliers};
use crate::grid::{Cube, LatticeBounds};
use crate::job::Job;
use crate::plan::Plan;
use crate::records::{OutputLayout, RecordFrame};
use crate::report::{PhaseReport, Report};
use crate::sample::Sampler;
use crate::write::dataset::StagedFolder;
use crate::write::payload::PayloadWriter;

/// Headers may mislead once about the bounds, and the bounds may then ask for a coarser lattice.
const MAX_PASSES: usize = 3;

/// Converts the inputs of `plan` to one dataset.
///
/// # Errors
/// See [`ConvertError`]; the output folder is then as it was before.
pub fn convert(plan: &Plan, events: &dyn Events) -> Result<Report, ConvertError> {
    let mut clock = Clock::start(events);
    clock.phase(Phase::Probe, 0);
    check(plan)?;
    let staged = StagedFolder::new(&plan.output, plan.overwrite)?;
    let mut job = Job::open(plan, events)?;
    let budget = Budget::new(plan, job.schema.stride)?;
    check_names(plan, &job)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(plan.threads.max(1))
        .thread_name(|i| format!("pointmill-{i}"))
        .build()
        .map_err(|e| ConvertError::Internal(format!("starting threads: {e}")))?;
    let temp_dir = plan.temp_dir.clone().unwrap_or_else(|| staged.parent());

    let mut gathered = read(plan, &mut job, &budget, &temp_dir, &pool, events, &mut clock)?;

    if let Some(outliers) = outliers::find(&gathered, &job) {
        let line = outliers.line(job.is_held_back());
        events.warning(&line);
        job.warnings.push(line);
    }
    clock.phase(Phase::Build, gathered.stats.points);
    let description = Description::new(plan, &job, &gathered.stats, &gathered.cube)?;
    let frame = RecordFrame { stride: job.schema.stride, cube: gathered.cube, base: gathered.base };
    let layout = OutputLayout::new(&job.schema, &description.kept, &frame);
    let chunks = chunks::plan(&mut gathered, &frame, budget.chunk_points)?;
    for chunk in &chunks {
        budget.check_chunk(chunk.points)?;
    }
    let built = build(plan, &gathered, &frame, &layout, &description, &chunks, &budget, &staged, &pool, events)?;
    account(&gathered.stats, &built)?;

    clock.phase(Phase::Finish, 0);
    let mut nodes = built.nodes;
    let hierarchy = encode_hierarchy(&mut nodes, HIERARCHY_STEP);
    let metadata = description.metadata(plan, &gathered, &built.accounts, &hierarchy, &job);
    staged.write("hierarchy.bin", &hierarchy.bytes)?;
    let json = metadata.to_json();
    staged.write("metadata.json", json.as_bytes())?;
    let mut report = description.report(plan, &job, &gathered, &built.accounts, &nodes);
    report.output_bytes = built.bytes + (hierarchy.bytes.len() + json.len()) as u64;
    report.phases = clock.finish(gathered.stats.points);
    report.seconds = clock.seconds();
    report.peak_memory_bytes = crate::memory::peak_resident_bytes();
    let text = serde_json::to_string_pretty(&report).map_err(|e| ConvertError::Internal(format!("report: {e}")))?;
    staged.write("report.json", text.as_bytes())?;
    if events.stop_requested() {
        return Err(ConvertError::Interrupted);
    }
    staged.finish()?;
    Ok(report)
}

fn check(plan: &Plan) -> Result<(), ConvertError> {
    let bad = |text: &str| Err(ConvertError::Usage(text.into()));
    if plan.leaf_capacity == 0 {
        return bad("--leaf-capacity: must be at least 1");
    }
    match plan.scale {
        crate::ScaleChoice::Fixed(s) if !(s.is_finite() && s > 0.0) => return bad("--scale: must be a number above 0"),
        _ => {}
    }
    match plan.encoding {
        crate::Encoding::Brotli { quality } if quality > 11 => return bad("--brotli-quality: must be 0 to 11"),
        _ => {}
    }
    if plan.filter.bounds.is_some_and(|b| b.is_empty()) {
        return bad("--bounds: the minimum lies above the maximum");
    }
    if let Some(dir) = &plan.temp_dir
        && !dir.is_dir()
    {
        return bad(&format!("--temp-dir: {} is not a folder", dir.display()));
    }
    Ok(())
}

/// What names attributes or a reference system wrongly shall fail now, not after the points were read.
fn check_names(plan: &Plan, job: &Job) -> Result<(), ConvertError> {
    if let crate::AttributeChoice::List(_) = plan.attributes {
        choose_attributes(&plan.attributes, job, &[])?;
    }
    resolve_crs(plan, job, &mut Vec::new()).map(drop)
}

/// Reads every point once; again only if the headers were wrong about the bounds.
fn read(
    plan: &Plan,
    job: &mut Job,
    budget: &Budget,
    temp_dir: &Path,
    pool: &rayon::ThreadPool,
    events: &dyn Events,
    clock: &mut Clock<'_>,
) -> Result<Box<Gathered>, ConvertError> {
    let mut hint = job.bounds_hint.map(|b| LatticeBounds {
        min: std::array::from_fn(|a| job.lattice.quantize(a, b.min[a])),
        max: std::array::from_fn(|a| job.lattice.quantize(a, b.max[a])),
    });
    for _ in 0..MAX_PASSES {
        clock.phase(Phase::Read, job.points_declared);
        match gather(plan, job, hint, temp_dir, budget.store_bytes, pool, events)? {
            Outcome::Complete(gathered) => return Ok(gathered),
            Outcome::Empty(stats) => return Err(nothing_to_convert(job, &stats)),
            Outcome::Retry(bounds) => {
                let line = "the points lie elsewhere than the headers made expect, or further apart than the coordinate \
                            step allows; reading them again with the bounds that were found";
                job.warnings.push(line.into());
                events.warning(line);
                hint = Some(bounds);
                if let Err(too_fine) = Cube::around(&bounds, &job.lattice) {
                    let fine = job.lattice;
                    job.coarsen(too_fine.coarser_by);
                    let line = format!("coordinate step {:?}: {}", job.lattice.scale, job.lattice_reason);
                    events.warning(&line);
                    job.warnings.push(line);
                    let [min, max] = [bounds.min, bounds.max].map(|q| {
                        let world = fine.world(q);
                        [0, 1, 2].map(|a| job.lattice.quantize(a, world[a]))
                    });
                    hint = Some(LatticeBounds { min: min.map(|v| v - 1), max: max.map(|v| v + 1) });
                }
            }
        }
    }
    Err(ConvertError::Unsupported(
        "the inputs lie too far apart for one lattice of 31 bits; leave out the one whose offset or scale is wrong, or \
         convert them apart"
            .into(),
    ))
}

fn nothing_to_convert(job: &Job, stats: &Stats) -> ConvertError {
    let read: u64 = stats.sources.iter().map(|s| s.read).sum();
    if read > 0 {
        return ConvertError::Input(format!(
            "no point is left: of {read} points {} lie outside --bounds, {} have other classes, {} are thinned out, {} have \
             no valid position",
            stats.outside_bounds, stats.other_class, stats.thinned, stats.invalid
        ));
    }
    match job.sources.as_slice() {
        [] => ConvertError::Input("there is nothing to convert".into()),
        [first, rest @ ..] => {
            let info = first.scan.info();
            let others = if rest.is_empty() { String::new() } else { format!(", nor do {} more inputs", rest.len()) };
            let what = format!("holds no points up to its end{others}");
            ReadError::broken(&info.path, info.file_bytes, what).advise("there is nothing to convert").into()
        }
    }
}

#[allow(clippy::too_many_arguments)] // the parts of one pass, each used once
fn build(
    plan: &Plan,
    gathered: &Gathered,
    frame: &RecordFrame,
    layout: &OutputLayout,
    description: &Description,
    chunks: &[Chunk],
    budget: &Budget,
    staged: &StagedFolder,
    pool: &rayon::ThreadPool,
    events: &dyn Events,
) -> Result<Built, ConvertError> {
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
        widen_rgb: &description.widen_rgb,
        class: description.class,
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

/// Every point that was decoded must have been written, with the bytes that it had.
fn account(stats: &Stats, built: &Built) -> Result<(), ConvertError> {
    let written = built.accounts.unaltered();
    if stats.checksum == written {
        return Ok(());
    }
    Err(ConvertError::Internal(format!("points were lost on the way: read {:?}, written {written:?}", stats.checksum)))
}

/// Wall time by phase.
struct Clock<'a> {
    events: &'a dyn Events,
    start: Instant,
    phase_start: Instant,
    phase: Option<Phase>,
    done: Vec<(Phase, f64)>,
}

impl<'a> Clock<'a> {
    fn start(events: &'a dyn Events) -> Self {
        let now = Instant::now();
        Self { events, start: now, phase_start: now, phase: None, done: Vec::new() }
    }

    fn phase(&mut self, phase: Phase, total: u64) {
        self.close();
        self.phase = Some(phase);
        self.events.phase(phase, total);
    }

    fn close(&mut self) {
        if let Some(phase) = self.phase.take() {
            self.done.push((phase, self.phase_start.elapsed().as_secs_f64()));
        }
        self.phase_start = Instant::now();
    }

    fn finish(&mut self, points: u64) -> Vec<PhaseReport> {
        self.close();
        let report = |(phase, seconds): &(Phase, f64)| {
            let points = if matches!(phase, Phase::Read | Phase::Build) { points } else { 0 };
            let points_per_second = if *seconds > 0.0 { points as f64 / seconds } else { 0.0 };
            PhaseReport { name: phase.name().into(), seconds: *seconds, points, points_per_second }
        };
        self.done.iter().map(report).collect()
    }

    fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}
