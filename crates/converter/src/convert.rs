//! A run, all passes in order.

use std::path::Path;
use std::time::Instant;

use pointmill_format::{Aabb, ReadError};

use crate::budget::Budget;
use crate::checksum::Checksum;
use crate::describe::{Description, resolve_crs};
use crate::error::ConvertError;
use crate::events::{Events, Phase};
use crate::gather::{Gathered, Outcome, Stats, gather, outliers};
use crate::grid::{Cube, LatticeBounds};
use crate::job::{Job, far_out, too_far};
use crate::plan::{Plan, Target};
use crate::report::{PhaseReport, Report};
use crate::write::dataset::StagedFolder;
use crate::{batches, bintree, octree};

/// Headers may mislead once about the bounds, and the bounds may then ask for a coarser lattice.
const MAX_PASSES: usize = 4;

/// What every output is made from.
#[derive(Clone, Copy)]
pub(crate) struct Run<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) job: &'a Job,
    pub(crate) gathered: &'a Gathered,
    pub(crate) facts: &'a Description,
    pub(crate) budget: &'a Budget,
    pub(crate) pool: &'a rayon::ThreadPool,
    pub(crate) events: &'a dyn Events,
    /// Where temporary files go.
    pub(crate) temp_dir: &'a Path,
}

impl Run<'_> {
    /// Every point that was decoded must have been written, with the bytes that it had.
    pub(crate) fn account(&self, written: Checksum) -> Result<(), ConvertError> {
        let read = self.gathered.stats.checksum;
        if read == written {
            return Ok(());
        }
        Err(ConvertError::Internal(format!("points were lost on the way: read {read:?}, written {written:?}")))
    }

    /// "position" and the names of attributes of the schema.
    pub(crate) fn names(&self, attributes: impl Iterator<Item = usize>) -> Vec<String> {
        let names = attributes.map(|i| self.job.schema.attributes[i].name.clone());
        std::iter::once("position".to_owned()).chain(names).collect()
    }
}

/// Converts the inputs of `plan` to one dataset of each target.
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
    resolve_crs(plan, &job, &mut Vec::new())?; // a name that makes no sense shall fail now, not after the read
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(plan.threads.max(1))
        .thread_name(|i| format!("pointmill-{i}"))
        .build()
        .map_err(|e| ConvertError::Internal(format!("starting threads: {e}")))?;
    let temp_dir = plan.temp_dir.clone().unwrap_or_else(|| staged.parent());

    let gathered = read(plan, &mut job, &budget, &temp_dir, &pool, events, &mut clock)?;

    if let Some(outliers) = outliers::find(&gathered, &job) {
        let line = outliers.line(job.is_held_back());
        events.warning(&line);
        job.warnings.push(line);
    }
    let facts = Description::new(plan, &job, &gathered.stats, &gathered.cube)?;
    let points = gathered.stats.points;
    let run = Run {
        plan,
        job: &job,
        gathered: &gathered,
        facts: &facts,
        budget: &budget,
        pool: &pool,
        events,
        temp_dir: &temp_dir,
    };
    let mut outputs = Vec::new();
    for target in &plan.targets {
        clock.phase(Phase::Build, points);
        let start = Instant::now();
        let dataset = staged.dataset(if plan.targets.len() > 1 { target.name() } else { "" })?;
        let mut output = match target {
            Target::Potree2 => octree::write(&run, &dataset)?,
            Target::Bintree(settings) => bintree::write(&run, settings, &dataset)?,
            Target::Batches(settings) => batches::write(&run, settings, &dataset)?,
        };
        dataset.sync()?;
        output.format = target.name().into();
        output.folder = dataset.name().into();
        output.seconds = start.elapsed().as_secs_f64();
        outputs.push(output);
    }

    clock.phase(Phase::Finish, 0);
    let mut report = facts.report(plan, &job, &gathered, outputs);
    report.phases = clock.finish(points);
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
    if plan.targets.is_empty() {
        return bad("--to: name at least one format");
    }
    let repeated = |(i, t): (usize, &Target)| plan.targets[..i].iter().any(|other| other.name() == t.name());
    if plan.targets.iter().enumerate().any(repeated) {
        return bad("--to: a format is named twice");
    }
    if plan.duplicates == crate::Duplicates::Drop && plan.targets.iter().any(|t| *t != Target::Potree2) {
        return Err(ConvertError::Unsupported(
            "--duplicates drop is there for potree2 alone; leave it out, or convert to potree2".into(),
        ));
    }
    for target in &plan.targets {
        match target {
            Target::Bintree(s) if s.capacity == 0 => return bad("--capacity: must be at least 1"),
            Target::Batches(s) if s.lod_cell.is_some_and(|c| !(c.is_finite() && c > 0.0)) => {
                return bad("--lod-cell: must be a number above 0, or auto");
            }
            Target::Batches(s) if s.planes.is_some_and(|p| !(1..=3).contains(&p)) => {
                return bad("--planes: must be 10, 20, 30 or auto");
            }
            _ => {}
        }
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
            Outcome::Complete(gathered) => {
                let before = job.lattice.scale[0];
                let bounds = &gathered.stats.bounds;
                let (min, max) = (job.lattice.world(bounds.min), job.lattice.world(bounds.max));
                if far_out(&Aabb { min, max }) {
                    return Err(too_far(min, max));
                }
                if !job.refine(plan, &gathered.stats) {
                    return Ok(gathered);
                }
                let line = format!(
                    "the bounds that the headers declare made the coordinate step {} times too coarse; reading again",
                    (before / job.lattice.scale[0]).round()
                );
                events.warning(&line);
                job.warnings.push(line);
                let quantize = |world: [f64; 3]| [0, 1, 2].map(|a| job.lattice.quantize(a, world[a]));
                let measured = gathered.stats.sources.iter().fold(Aabb::EMPTY, |all, s| all.union(&s.bounds));
                hint = Some(LatticeBounds { min: quantize(measured.min), max: quantize(measured.max) });
            }
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
