//! A run, all passes in order.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use crate::cloud::Intake;
use crate::derive::derive_attributes;
use crate::error::{ConvertError, JobFault};
use crate::gather::{Demand, gather, is_coarse};
use crate::job::{Build, GroupUnits, Identity, Job, Keeper, SharedJob};
use crate::memory::peak_resident_bytes;
use crate::outputs::{self, StagedDataset, StagedFolder, Target};
use crate::plan::Plan;
use crate::reason::BuiltAnew;
use crate::report::{self, Account, OtherFilesReport, OutputReport, Report, TakenOver};
use crate::runtime::{Budget, Clock, Disk, Events, Least, Phase, Runtime, SystemDisk, TempFiles};
use crate::sources::{Sources, resolve_crs_of_all};
use crate::warning::Warning;

/// Converts the inputs of `plan` to one dataset for each target. One goes into the output folder itself, several into
/// folders of their names below it.
///
/// # Errors
/// See [`ConvertError`]; the output folder is then as it was before.
pub fn convert(plan: &Plan, targets: &[Target], events: &dyn Events) -> Result<Report, ConvertError> {
    run(&system_disk(), plan, targets, events, &|_| Ok(()))
}

/// Looks at the folder that is about to become the output, complete but for its name, and refuses it with an error.
pub type Verify<'a> = dyn Fn(&Path) -> Result<(), ConvertError> + 'a;

/// [`convert`], but the output appears only if `verify` accepts it.
///
/// # Errors
/// As [`convert`], and that of `verify`; the output folder is then as it was before.
pub fn convert_verified(
    plan: &Plan,
    targets: &[Target],
    events: &dyn Events,
    verify: &Verify<'_>,
) -> Result<Report, ConvertError> {
    run(&system_disk(), plan, targets, events, verify)
}

/// [`convert`] on another disk, such as one that fails.
///
/// # Errors
/// As [`convert`].
#[expect(clippy::needless_pass_by_value, reason = "callers make one for the run")]
pub fn convert_on(
    disk: Arc<dyn Disk>,
    plan: &Plan,
    targets: &[Target],
    events: &dyn Events,
) -> Result<Report, ConvertError> {
    run(&disk, plan, targets, events, &|_| Ok(()))
}

fn system_disk() -> Arc<dyn Disk> {
    Arc::new(SystemDisk)
}

fn run(
    disk: &Arc<dyn Disk>,
    plan: &Plan,
    targets: &[Target],
    events: &dyn Events,
    verify: &Verify<'_>,
) -> Result<Report, ConvertError> {
    let mut job = JobOf::Own(None);
    let made = make(disk, plan, targets, events, verify, &mut job);
    let JobOf::Own(job) = job else { return made };
    match made {
        Ok(mut report) => {
            if let Some(left) = job.and_then(Job::end) {
                events.warning(&left);
                report.warnings.push(left);
            }
            Ok(report)
        }
        Err(error) => {
            let error = match (error, &job) {
                (ConvertError::Internal(what), Some(job)) if !job.is_new() => {
                    JobFault::Unfit { folder: job.folder().to_path_buf(), what }.into()
                }
                (error, _) => error,
            };
            match job {
                // what another run would do the same with is not offered
                Some(_) if matches!(error, ConvertError::Job(_) | ConvertError::Refused { .. }) => {}
                Some(job) if !error.comes_again() && job.has_units() => events.checkpoint(Some(job.folder())),
                Some(job) => {
                    events.checkpoint(None);
                    job.end().iter().for_each(|left| events.warning(left));
                }
                None => {}
            }
            Err(error)
        }
    }
}

/// The job that a run works for.
pub(crate) enum JobOf<'a> {
    /// Of its own, if the plan wants one.
    Own(Option<Job>),
    /// One that several processes share.
    Shared(&'a SharedJob),
}

impl JobOf<'_> {
    fn keeper(&self) -> Option<Keeper<'_>> {
        match self {
            Self::Own(job) => job.as_ref().map(Keeper::Own),
            Self::Shared(job) => Some(Keeper::Shared(job)),
        }
    }

    /// Begins, goes on, or checks that it is the job of this run. Returns what there is to say.
    fn join(
        &mut self,
        plan: &Plan,
        is_large: bool,
        sources: &Sources,
        settings: serde_json::Map<String, serde_json::Value>,
        output: &Path,
        disk: &Arc<dyn Disk>,
    ) -> Result<Vec<Warning>, ConvertError> {
        match self {
            Self::Own(job) => {
                let (begun, warnings) = Job::of(plan, is_large, sources, settings, output, disk)?;
                *job = begun;
                Ok(warnings)
            }
            Self::Shared(job) => {
                job.identify(&Identity::of(plan, sources, settings, !job.is_in_parts())?)?;
                Ok(Vec::new())
            }
        }
    }

    /// Points that did not have to be read again, and units that did not have to be built again.
    fn recalled(&self) -> (u64, u64) {
        match self {
            Self::Own(job) => job.as_ref().map_or((0, 0), |job| (job.recalled(), job.recalled_units())),
            Self::Shared(_) => (0, 0),
        }
    }
}

/// Makes the output of a plan.
pub(crate) fn make(
    disk: &Arc<dyn Disk>,
    plan: &Plan,
    targets: &[Target],
    events: &dyn Events,
    verify: &Verify<'_>,
    job: &mut JobOf<'_>,
) -> Result<Report, ConvertError> {
    let mut clock = Clock::start(events);
    clock.begin(Phase::Probe, plan.inputs.len() as u64);
    outputs::check(plan, targets)?;
    let staged = StagedFolder::new(&plan.output, plan.overwrite, Arc::clone(disk), events)?;
    staged.warnings.iter().for_each(|w| events.warning(w));
    events.works_in(staged.path());
    let written = write(plan, targets, events, &staged, disk, job, &mut clock);
    let written = written.and_then(|report| verify(&staged.path_of_new()).map(|()| report));
    let written = written.and_then(|report| job.keeper().map_or(Ok(()), Keeper::part_with_output).map(|()| report));
    events.settling();
    match written {
        Ok(mut report) => {
            if let Some(left) = staged.finish(events)? {
                events.warning(&left);
                report.warnings.push(left);
            }
            Ok(report)
        }
        Err(error) => {
            if !matches!(error, ConvertError::Job(JobFault::Unfinished { .. })) {
                events.phase(Phase::CleanUp, 0); // removing many files takes its time
            }
            drop(staged);
            Err(error)
        }
    }
}

/// All passes, up to an output that is complete but for its name.
fn write(
    plan: &Plan,
    targets: &[Target],
    events: &dyn Events,
    staged: &StagedFolder,
    disk: &Arc<dyn Disk>,
    job: &mut JobOf<'_>,
    clock: &mut Clock<'_>,
) -> Result<Report, ConvertError> {
    let peak_before = peak_resident_bytes();
    let mut sources = Sources::open(plan, events)?.within_precision(plan, outputs::keep_lattice(targets))?;
    let mut warnings = std::mem::take(&mut sources.warnings);
    warnings.extend(staged.warnings.iter().cloned());
    let wants = outputs::wants(plan, targets, &sources.attributes)?;
    let intake = Intake::new(plan, &sources, &wants.attributes, is_coarse(plan, &sources)?);
    let least = least(targets, &sources, &intake)?;
    let budget = Budget::new(plan, intake.schema.stride, least)?;
    resolve_crs_of_all(plan, &sources.all, &mut Vec::new())?; // a name that makes no sense must fail now, not after the read
    let temp_dir = plan.temp_dir.clone().unwrap_or_else(|| staged.parent());
    let rt = Runtime::start(plan, budget, TempFiles::new(temp_dir, Arc::clone(disk)), events)?;
    let expected_bytes = sources.points_declared.saturating_mul(intake.schema.stride as u64);
    let is_large = expected_bytes > rt.budget.record_bytes(sources.points_declared);
    let of_job = job.join(plan, is_large, &sources, settings(plan, targets), staged.output(), disk)?;
    of_job.iter().for_each(|warning| events.warning(warning));
    warnings.extend(of_job);
    let keeper = job.keeper();

    let groups = outputs::groups(targets);
    let demand = Demand { moments: wants.moments, uses: groups.len() as u32 };
    let reading = rt.budget.reading(&rt.memory)?;
    let mut cloud = gather(plan, &sources, &intake, demand, warnings, keeper, &rt, clock)?;
    drop(reading);
    report::check_lattice(&cloud)?;
    derive_attributes(&mut cloud, &rt, clock)?;
    let cloud = cloud;

    let (mut outputs, mut open) = (Vec::new(), Vec::new());
    for (number, group) in groups.into_iter().enumerate() {
        clock.begin(Phase::Build, cloud.points());
        let together: Vec<&Target> = group.iter().map(|i| &targets[*i]).collect();
        let units = keeper.map(|keeper| GroupUnits::new(keeper, number as u32));
        match build(&together, Build { cloud: &cloud, rt: &rt, units }, staged, targets.len() == 1) {
            Ok(built) => outputs.extend(group.into_iter().zip(built)),
            // those of the other groups are to be known, too
            Err(ConvertError::Job(JobFault::Unfinished { units })) => open.extend(units),
            Err(other) => return Err(other),
        }
    }
    if let Some(job) = keeper.and_then(Keeper::shared) {
        job.end_settling()?;
    }
    if !open.is_empty() {
        return Err(JobFault::Unfinished { units: open }.into());
    }
    outputs.sort_by_key(|(target, _)| *target);
    let outputs = outputs.into_iter().map(|(_, output)| output).collect();

    clock.begin(Phase::Finish, 0);
    rt.check_stop()?;
    let account = Account {
        settings: settings(plan, targets),
        other_files: OtherFilesReport::new(&plan.other_files),
        outputs,
        temp_bytes: rt.temp.written_bytes(),
        recalled_points: job.recalled().0,
        recalled_units: job.recalled().1,
        phases: clock.finish(),
        seconds: clock.seconds(),
    };
    let mut report = report::report(cloud, account)?;
    if let Some(warning) = above_ceiling(plan, peak_before) {
        events.warning(&warning);
        report.warnings.push(warning);
    }
    staged.write_report(&report)?;
    rt.check_stop()?;
    Ok(report)
}

/// Builds the datasets of targets that are built together.
fn build(
    targets: &[&Target],
    build: Build<'_>,
    staged: &StagedFolder,
    is_only_one: bool,
) -> Result<Vec<OutputReport>, ConvertError> {
    let Build { cloud, rt, units } = build;
    let start = Instant::now();
    let is_in_place = targets.iter().all(|target| target.output().stays_in_place());
    let kept_in = units.and_then(|units| units.kept_in()).filter(|_| is_in_place);
    let datasets: Vec<_> =
        targets.iter().map(|target| staged.dataset(target.kind(), is_only_one, kept_in)).collect::<Result<_, _>>()?;
    let _building = rt.budget.building(&rt.memory, cloud.points())?;
    let mut reports = outputs::write(targets, &datasets, build)?;
    datasets.iter().try_for_each(StagedDataset::sync)?;
    for (i, (report, dataset)) in reports.iter_mut().zip(&datasets).enumerate() {
        report.warnings.iter().for_each(|w| rt.events().warning(w));
        report.format = targets[i].kind().name().into();
        report.folder = dataset.name().into();
        if cloud.plan.append {
            let taken = report.taken_over.get_or_insert_with(|| TakenOver::nothing(BuiltAnew::Format));
            taken.why_not = taken.why_not.or((taken.nodes == 0).then_some(BuiltAnew::AllTouched));
        }
        let others = targets.iter().filter(|target| target.kind() != targets[i].kind());
        report.built_with = others.map(|target| target.kind().name().to_owned()).collect();
        let (kind, saved) = (targets[i].kind(), report.saved.unwrap_or_else(|| targets[i].output().saved_bytes()));
        report.precision = report::precision(cloud, kind, &report.accuracy, saved)?;
        report.seconds = start.elapsed().as_secs_f64();
    }
    Ok(reports)
}

/// What the inputs and outputs need at least.
///
/// # Errors
/// A scan that had to be opened again cannot be.
pub(crate) fn least(targets: &[Target], sources: &Sources, intake: &Intake) -> Result<Least, ConvertError> {
    let groups = outputs::groups(targets);
    let decode_bytes = sources.decode_bytes(|source| &intake.of(source).wanted)?;
    let least = Least::of(targets.iter().map(|t| t.output().least_points()), decode_bytes, sources.bytes);
    let of_group = |group: &Vec<usize>| group.iter().map(|i| targets[*i].output().least_bytes()).sum();
    let streams = groups.iter().map(Vec::len).max().unwrap_or(1);
    Ok(least.with_units(groups.iter().map(of_group)).with_streams(streams as u64))
}

/// What there is to say if the process grew beyond the ceiling during this run.
fn above_ceiling(plan: &Plan, peak_before: Option<u64>) -> Option<Warning> {
    let (peak, ceiling) = (peak_resident_bytes()?, plan.memory_bytes);
    (peak > ceiling && peak_before.is_some_and(|before| before < ceiling))
        .then_some(Warning::AboveCeiling { peak, ceiling })
}

/// What the report of a run says of its settings, by name.
pub fn settings(plan: &Plan, targets: &[Target]) -> serde_json::Map<String, serde_json::Value> {
    let kinds: Vec<_> = targets.iter().map(Target::kind).collect();
    let mut settings = report::settings(plan, &kinds);
    targets.iter().for_each(|t| t.output().describe_settings(&mut settings));
    settings
}
