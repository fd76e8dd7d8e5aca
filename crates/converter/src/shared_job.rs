//! Conversions that several processes do together, on one machine or on many that see the same folders.
//!
//! A job is planned once; its units are done by whoever likes, in any order that their needs allow; then it is finished. All
//! processes are given the same plan. The output has the same bytes as that of one run.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::convert::{JobOf, Verify, make};
use crate::error::{ConvertError, JobFault};
use crate::job::{SharedJob, Task};
use crate::outputs::{self, StagedFolder, Target};
use crate::plan::{Plan, PlanError, PlanFault, Setting};
use crate::report::Report;
use crate::runtime::{Disk, Events, Phase, SystemDisk};
use crate::unit_name::{JobUnits, Stage, UnitName};

/// Plans a job in `folder`, which is not there, or empty. Reads headers alone. [`Plan::checkpoint_points`] is the size of a unit
/// of reading.
///
/// # Errors
/// Inputs or settings that cannot be converted, an output that must not be replaced, a folder in use.
pub fn plan_job(plan: &Plan, targets: &[Target], folder: &Path, events: &dyn Events) -> Result<JobUnits, ConvertError> {
    let disk = disk();
    // what is in the way of the output is better known now than when all is done
    outputs::check(plan, targets)?;
    if !plan.derive.is_nothing() {
        return Err(PlanError::new(Setting::Derive, PlanFault::NotInJobs).into());
    }
    drop(StagedFolder::new(&plan.output, plan.overwrite, Arc::clone(&disk), events)?);
    let job = SharedJob::begin(folder, &disk)?;
    in_parts(&job, plan, targets, events, &disk).inspect_err(|_| {
        let _ = job.end(); // what is left is named by the error of the next plan
    })
}

/// The units of a job that are known.
///
/// # Errors
/// No job in the folder, or one of another plan.
pub fn job_units(
    plan: &Plan,
    targets: &[Target],
    folder: &Path,
    events: &dyn Events,
) -> Result<JobUnits, ConvertError> {
    let disk = disk();
    in_parts(&SharedJob::open(folder, Task::Look, &disk)?, plan, targets, &Unwarned(events), &disk)
}

/// Does some units of a job; those that are done already are not done again. `waits`: for units that others do and these need,
/// so long without news of any.
/// Returns the units that are known afterwards.
///
/// # Errors
/// A unit that is not there or needs another one that is not done, and whatever a conversion meets.
pub fn run_units(
    plan: &Plan,
    targets: &[Target],
    folder: &Path,
    units: &[UnitName],
    waits: Option<Duration>,
    events: &dyn Events,
) -> Result<JobUnits, ConvertError> {
    let disk = disk();
    let task = Task::Run { units: units.iter().copied().collect(), waits };
    let job = SharedJob::open(folder, task, &disk)?;
    let known = in_parts(&job, plan, targets, &Unwarned(events), &disk)?;
    match units.iter().find(|unit| !job.is_done(**unit)) {
        Some(unit) => Err(JobFault::NoUnit { unit: unit.to_string() }.into()),
        None => Ok(known),
    }
}

/// Puts the results of all units together; the output then has its name, and the job is gone. `verify`: as in
/// [`crate::convert_verified`].
///
/// # Errors
/// Units that are not done, and whatever a conversion meets.
pub fn finish_job(
    plan: &Plan,
    targets: &[Target],
    folder: &Path,
    events: &dyn Events,
    verify: &Verify<'_>,
) -> Result<Report, ConvertError> {
    let disk = disk();
    let job = SharedJob::open(folder, Task::Finish, &disk)?;
    let made = make(&disk, plan, targets, events, verify, &mut JobOf::Shared(&job));
    let report = made.map_err(|error| mixed(error, folder))?;
    job.end()?;
    Ok(report)
}

/// The sums of all points, or something before them, tell that records are not those that were read.
fn mixed(error: ConvertError, folder: &Path) -> ConvertError {
    match error {
        ConvertError::Internal(what) => JobFault::Mixed { folder: folder.to_path_buf(), what }.into(),
        ConvertError::Job(damaged @ JobFault::Damaged { .. }) => {
            JobFault::Mixed { folder: folder.to_path_buf(), what: damaged.to_string() }.into()
        }
        other => other,
    }
}

/// Does what the job is opened for; the output is not begun.
fn in_parts(
    job: &SharedJob,
    plan: &Plan,
    targets: &[Target],
    events: &dyn Events,
    disk: &Arc<dyn Disk>,
) -> Result<JobUnits, ConvertError> {
    let work = job.work()?;
    let plan = Plan { output: work.path().join("out"), overwrite: false, ..plan.clone() };
    match make(disk, &plan, targets, events, &|_| Ok(()), &mut JobOf::Shared(job)) {
        Err(ConvertError::Job(JobFault::Unfinished { units })) => {
            let is_last = |stage| matches!(stage, Stage::Build { .. });
            let complete = units.iter().all(|unit| unit.done && is_last(unit.name.stage));
            Ok(JobUnits { units, complete })
        }
        Err(other) => Err(mixed(other, job.folder())),
        Ok(_) => Err(ConvertError::Internal("a part of a job made its output".into())),
    }
}

/// Says what others say but for warnings, which the process that plans has told.
struct Unwarned<'a>(&'a dyn Events);

impl Events for Unwarned<'_> {
    fn phase(&self, phase: Phase, total: u64) {
        self.0.phase(phase, total);
    }

    fn advance(&self, steps: u64) {
        self.0.advance(steps);
    }

    fn works_in(&self, folder: &Path) {
        self.0.works_in(folder);
    }

    fn settling(&self) {
        self.0.settling();
    }

    fn stop_requested(&self) -> bool {
        self.0.stop_requested()
    }
}

fn disk() -> Arc<dyn Disk> {
    Arc::new(SystemDisk)
}
