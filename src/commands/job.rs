//! `pointmill job`: a conversion that several processes do together. The folder of the job has the command line that it was
//! planned with; every process reads it again, so that all have the same plan.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use pointmill_converter::{
    ConvertError, JobFault, JobUnits, Plan, Report, Target, UnitName, finish_job, job_units, plan_job, run_units,
};
use pointmill_format::{json_fault, system_reason};
use serde::{Deserialize, Serialize};

use super::convert::{after_all, protect_inputs, tell};
use super::report_file::ReportFile;
use super::verify::verify;
use crate::args::{
    CheckpointArg, Command, ConvertArgs, JobArgs, JobCommand, JobFinishArgs, JobPlanArgs, JobResources, JobRunArgs,
    JobUnitsArgs, Share,
};
use crate::exit::{Failure, emit, print_line, to_json};
use crate::fitting::NOT_IN_JOBS;
use crate::human::conversion;
use crate::human::progress::Progress;
use crate::interrupt::{no_more_checks, stop_flag};
use crate::profiles::command_line;

/// The command line of a job, in its folder.
const PLAN: &str = "plan.json";

/// Between two looks whether other processes have done their units.
const PAUSE: Duration = Duration::from_millis(500);

pub(crate) fn run(args: &JobArgs) -> Result<(), Failure> {
    match &args.command {
        JobCommand::Plan(args) => plan(args),
        JobCommand::Units(args) => units(args),
        JobCommand::Run(args) => run_some(args),
        JobCommand::Finish(args) => finish(args),
        JobCommand::Status(args) => status(args),
    }
}

/// What a job was planned with.
#[derive(Debug, Serialize, Deserialize)]
struct Planned {
    version: String,
    /// Where relative paths begin.
    folder: PathBuf,
    /// Of `pointmill convert`.
    arguments: Vec<String>,
}

/// A job that was planned.
struct Job {
    folder: PathBuf,
    convert: ConvertArgs,
    plan: Plan,
    targets: Vec<Target>,
}

fn plan(args: &JobPlanArgs) -> Result<(), Failure> {
    let folder = std::env::current_dir().map_err(|e| Failure::io(Path::new("."), "looking where this is", &e))?;
    let planned = Planned { version: env!("CARGO_PKG_VERSION").to_owned(), folder, arguments: typed_for_convert()? };
    let job = job_of(&planned, args.job.clone())?;
    protect_inputs(&job.plan, false)?;
    if job.folder.starts_with(&job.plan.output) {
        let (folder, output) = (job.folder.display(), job.plan.output.display());
        return Err(Failure::Usage(format!(
            "{folder}: the job would be inside of the output {output}; choose another folder"
        )));
    }
    let report = job.convert.report.as_ref().map(|file| std::path::absolute(file).unwrap_or_else(|_| file.clone()));
    if report.is_some_and(|report| report.starts_with(&job.folder)) {
        return Err(Failure::Usage("--report: the folder of the job goes once it is finished; choose another".into()));
    }
    let progress = Progress::new(&job.convert.talk, Some(stop_flag()));
    let units = plan_job(&job.plan, &job.targets, &job.folder, &progress);
    no_more_checks();
    progress.end();
    let units = units?;
    let path = job.folder.join(PLAN);
    let new = job.folder.join(format!("{PLAN}.new"));
    let written = fs::write(&new, to_json(&planned)?).and_then(|()| fs::rename(&new, &path));
    written.map_err(|e| Failure::io(&path, "writing the plan", &e))?;
    if !job.convert.talk.quiet {
        print_line(&format!("{}: {}", job.folder.display(), describe(&units)));
    }
    Ok(())
}

/// What was typed behind `job plan`, without the folder of the job.
fn typed_for_convert() -> Result<Vec<String>, Failure> {
    let mut words = std::env::args_os().skip_while(|word| word != "plan").skip(1);
    let mut arguments = Vec::new();
    while let Some(word) = words.next() {
        let text = word
            .into_string()
            .map_err(|word| Failure::Usage(format!("{}: a job needs names in UTF-8", word.to_string_lossy())))?;
        match text.as_str() {
            "--job" => drop(words.next()),
            with_value if with_value.starts_with("--job=") => {}
            _ => arguments.push(text),
        }
    }
    Ok(arguments)
}

fn open(folder: &Path) -> Result<Job, Failure> {
    let path = folder.join(PLAN);
    let text = match fs::read_to_string(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            let line = format!("{}: not the folder of a planned job; 'pointmill job plan' makes one", folder.display());
            return Err(Failure::Usage(line));
        }
        Err(e) => return Err(Failure::io(&path, "reading the plan", &e)),
    };
    let folder = folder.canonicalize().map_err(|e| Failure::io(folder, "opening the job", &e))?;
    let broken =
        |e| Failure::Input(format!("{}: not as it was written: {}; plan the job anew", path.display(), json_fault(&e)));
    let planned: Planned = serde_json::from_str(&text).map_err(broken)?;
    if planned.version != env!("CARGO_PKG_VERSION") {
        let (was, is) = (&planned.version, env!("CARGO_PKG_VERSION"));
        return Err(Failure::Usage(format!("{}: planned by version {was}, this is {is}", folder.display())));
    }
    job_of(&planned, folder)
}

fn job_of(planned: &Planned, folder: PathBuf) -> Result<Job, Failure> {
    let here =
        || Failure::Io(format!("{}: the folder that the job was planned in is not there", planned.folder.display()));
    let folder = if folder.is_absolute() { folder } else { planned.folder.join(folder) };
    std::env::set_current_dir(&planned.folder).map_err(|_| here())?;
    let words = ["pointmill", "convert"].into_iter().chain(planned.arguments.iter().map(String::as_str));
    let typed: Vec<OsString> = words.map(OsString::from).collect();
    let Command::Convert(convert) = command_line(&typed)?.command else {
        return Err(Failure::Internal("internal error: the command line of a job is none of convert".into()));
    };
    if convert.inputs.files_from.as_ref().is_some_and(|list| list.as_os_str() == "-") {
        return Err(Failure::Usage("--files-from - does not go with a job: every process reads the list".to_owned()));
    }
    let given = [convert.dry_run, convert.resume, convert.append, convert.page, convert.json];
    let mut useless = NOT_IN_JOBS.iter().zip(given).filter(|(_, given)| *given).map(|(option, _)| *option);
    let checkpoint = matches!(convert.checkpoint, Some(CheckpointArg::Auto)).then_some("--checkpoint auto");
    if let Some(option) = useless.next().or(checkpoint) {
        return Err(Failure::Usage(format!("{option} does not go with a job")));
    }
    let (mut plan, targets) = super::convert::planned(&convert)?;
    plan.output = std::path::absolute(&plan.output).unwrap_or(plan.output);
    Ok(Job { folder, convert: *convert, plan, targets })
}

impl Job {
    /// With what this process may use.
    fn open(folder: &Path, resources: &JobResources) -> Result<Self, Failure> {
        // before the folder that relative paths are of becomes that of the plan
        let temp_dir = resources.temp_dir.as_ref().map(|dir| match dir.is_dir() {
            true => std::path::absolute(dir).map_err(|e| Failure::io(dir, "looking for the folder", &e)),
            false => Err(Failure::Usage(format!("{}: --temp-dir is not a folder", dir.display()))),
        });
        let temp_dir = temp_dir.transpose()?;
        let mut job = open(folder)?;
        if let Some(bytes) = resources.memory {
            job.plan.memory_bytes = bytes;
        }
        if let Some(threads) = resources.threads {
            job.plan.threads = usize::from(threads.get());
        }
        job.plan.temp_dir = temp_dir.or(job.plan.temp_dir);
        Ok(job)
    }
}

fn units(args: &JobUnitsArgs) -> Result<(), Failure> {
    let units = known(args)?;
    if args.json {
        return emit(&to_json(&Listed::of(&units))?);
    }
    emit(&units.ready().map(|unit| format!("{}\n", unit.name)).collect::<String>())
}

fn status(args: &JobUnitsArgs) -> Result<(), Failure> {
    let units = known(args)?;
    if args.json {
        let mut status = serde_json::Map::new();
        status.insert("complete".into(), units.complete.into());
        for (kind, done, all) in counts(&units) {
            status.insert(kind.into(), serde_json::json!({ "done": done, "units": all }));
        }
        return emit(&to_json(&status)?);
    }
    emit(&format!("{}\n", describe(&units)))
}

fn known(args: &JobUnitsArgs) -> Result<JobUnits, Failure> {
    let job = open(&args.job)?;
    let progress = Progress::new(&args.talk, Some(stop_flag()));
    let units = job_units(&job.plan, &job.targets, &job.folder, &progress);
    no_more_checks();
    progress.end();
    Ok(units?)
}

/// Units as JSON has them.
#[derive(Serialize)]
struct Listed<'a> {
    complete: bool,
    /// Names of those that can be done now.
    ready: Vec<UnitName>,
    units: &'a [pointmill_converter::JobUnit],
}

impl<'a> Listed<'a> {
    fn of(units: &'a JobUnits) -> Self {
        Self { complete: units.complete, ready: units.ready().map(|unit| unit.name).collect(), units: &units.units }
    }
}

/// How many units of each kind are done, of how many.
fn counts(units: &JobUnits) -> Vec<(&'static str, usize, usize)> {
    let mut counts: Vec<(&'static str, usize, usize)> = Vec::new();
    for unit in &units.units {
        match counts.iter_mut().find(|(kind, ..)| *kind == unit.kind) {
            Some((_, done, all)) => (*done, *all) = (*done + usize::from(unit.done), *all + 1),
            None => counts.push((unit.kind, usize::from(unit.done), 1)),
        }
    }
    counts
}

fn describe(units: &JobUnits) -> String {
    if units.complete {
        return "all units are done; 'pointmill job finish' puts them together".to_owned();
    }
    let each = counts(units).into_iter().map(|(kind, done, all)| {
        format!(
            "{done} of {all} unit{} to {kind} {} done",
            if all == 1 { "" } else { "s" },
            if all == 1 { "is" } else { "are" }
        )
    });
    each.collect::<Vec<_>>().join(", ")
}

fn run_some(args: &JobRunArgs) -> Result<(), Failure> {
    let job = Job::open(&args.job, &args.resources)?;
    let progress = Progress::new(&args.talk, Some(stop_flag()));
    let done = match args.share {
        Some(share) => run_share(&job, share, Duration::from_secs(args.patience), &progress),
        None => run_units(&job.plan, &job.targets, &job.folder, &args.units, None, &progress).map_err(Into::into),
    };
    no_more_checks();
    if progress.end()
        && let Ok(units) = &done
    {
        print_line(&describe(units));
    }
    done.map(drop)
}

/// Does a share of all units, stage by stage; and what others should do, but do not.
fn run_share(job: &Job, share: Share, patience: Duration, progress: &Progress) -> Result<JobUnits, Failure> {
    let run = |units: &[UnitName], waits| run_units(&job.plan, &job.targets, &job.folder, units, waits, progress);
    let mut news = (Vec::new(), Instant::now());
    loop {
        let known = job_units(&job.plan, &job.targets, &job.folder, progress)?;
        if known.complete {
            return Ok(known);
        }
        let state: Vec<(UnitName, bool)> = known.units.iter().map(|unit| (unit.name, unit.done)).collect();
        if state != news.0 {
            news = (state, Instant::now());
        }
        let is_mine = |i: usize| i as u64 % share.of == share.index;
        let open = known.units.iter().enumerate().filter(|(i, unit)| !unit.done && is_mine(*i));
        let mine: Vec<UnitName> = open.map(|(_, unit)| unit.name).collect();
        let is_stuck = news.1.elapsed() >= patience;
        let ready = known.ready().map(|unit| unit.name).collect::<Vec<_>>();
        // shares that lose patience together begin with different units
        let of_others = ready.get((share.index as usize).checked_rem(ready.len()).unwrap_or(0)).filter(|_| is_stuck);
        let done = match (of_others, mine.is_empty()) {
            (Some(unit), _) => run(&[*unit], None),
            (None, false) => run(&mine, Some(patience)),
            (None, true) => {
                if stop_flag().load(std::sync::atomic::Ordering::Relaxed) {
                    return Err(Failure::Interrupted("interrupted".to_owned()));
                }
                std::thread::sleep(PAUSE);
                continue;
            }
        };
        match done {
            // it needs what others have not done
            Ok(_) | Err(ConvertError::Job(JobFault::NoUnit { .. })) => {}
            Err(other) => return Err(other.into()),
        }
    }
}

fn finish(args: &JobFinishArgs) -> Result<(), Failure> {
    let job = Job::open(&args.job, &args.resources)?;
    protect_inputs(&job.plan, false)?;
    let report_file = job.convert.report.as_ref().map(|file| {
        let sources = job.plan.inputs.iter().chain(&job.convert.inputs.files_from);
        ReportFile::new(file, &job.plan.output, sources)
    });
    let report_file = report_file.transpose()?;
    let progress = Progress::new(&args.talk, Some(stop_flag()));
    let result = finish_job(&job.plan, &job.targets, &job.folder, &progress, &|folder| {
        job.convert.verify.map_or(Ok(()), |how| verify(folder, how, &job.plan, &progress))
    });
    no_more_checks();
    let for_people = progress.end();
    let report: Report = result?;
    remove(&job.folder);
    tell(args.json, report_file.as_ref(), &report).map_err(|failure| after_all(failure, &job.plan.output))?;
    if for_people {
        conversion::report(&report, &job.plan, args.talk.verbose).iter().for_each(|line| print_line(line));
    }
    Ok(())
}

/// The command line goes, and the folder if nothing else is in it. The output is there: what stays is no failure.
fn remove(folder: &Path) {
    let removed = fs::remove_file(folder.join(PLAN)).and_then(|()| fs::remove_dir(folder));
    if let Err(e) = removed {
        print_line(&format!("{}: the folder of the job stays ({})", folder.display(), system_reason(&e)));
    }
}
