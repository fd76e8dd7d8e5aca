//! Converts generated scans with pointmill, with the floor (`floor`: read, sort, write) and, when they are on `PATH`, with
//! PotreeConverter and copc_converter, in turn, and writes what each run cost as Markdown, with the figures that count.
//!
//! What the numbers do not show: disks (inputs come from the page cache), other scans than the generated ones, and
//! the quality of what was written (`pointmill validate` reports that).

mod args;
mod ballast;
mod cases;
mod document;
mod figures;
mod job;
mod outcome;
mod programs;
mod run;
mod section;

use std::process::ExitCode;
use std::{fs, io};

use clap::Parser as _;

use args::Args;
use ballast::Ballast;
use job::Job;
use outcome::Outcome;
use programs::Programs;
use run::Runner;

fn main() -> ExitCode {
    let args = Args::parse();
    if args.ballast {
        ballast::hold();
        return ExitCode::SUCCESS;
    }
    match measure(&args) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE, // the table says what went wrong
        Err(error) => {
            eprintln!("side_by_side: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure(args: &Args) -> io::Result<bool> {
    let dir = args.dir.clone().unwrap_or_else(|| std::env::temp_dir().join("pointmill-bench"));
    fs::create_dir_all(&dir)?;
    let programs = Programs::new(args.pointmill.as_deref())?;
    let ballast = (args.lend != Some(0)).then(Ballast::start).transpose()?;
    let mut runner = Runner { programs: &programs, dir: &dir, ballast, lend: 0 };
    let mut all_ran = true;
    for job in &args.jobs {
        all_ran &= measure_job(args, *job, &mut runner)?;
    }
    Ok(all_ran)
}

/// False if a program failed.
fn measure_job(args: &Args, job: Job, runner: &mut Runner<'_>) -> io::Result<bool> {
    let points = args.points.unwrap_or(job.points());
    runner.lend = args.lend.unwrap_or(job.lend());
    let mut outcomes: Vec<Outcome> = cases::list(job, points, &args.options)
        .into_iter()
        .filter(|case| args.only.is_empty() || args.only.iter().any(|word| case.label.contains(word)))
        .filter(|case| {
            let is_there = !case.program.is_foreign() || programs::on_path(case.program).is_some();
            if !is_there {
                eprintln!("{} is not on PATH: {} is omitted", case.program.binary(), case.label);
            }
            is_there
        })
        .map(Outcome::new)
        .collect();
    outcomes.iter().try_for_each(|outcome| runner.make_scene(&outcome.case.scene))?;
    let runs = args.runs.unwrap_or(job.runs());
    // In turn, so that a machine that slows down slows all of them.
    for run in 1..=runs {
        for outcome in outcomes.iter_mut().filter(|o| o.fault.is_none()) {
            eprintln!("{}, run {run} of {runs}: {}", job.name(), outcome.case.label);
            runner.once(outcome)?;
        }
    }
    outcomes.iter().try_for_each(|outcome| runner.drop_scene(&outcome.case.scene))?;
    let section = section::section(args, job, points, &outcomes, runner.programs);
    match &args.out {
        Some(path) => {
            let figures = (points == job.points()).then_some((job, &outcomes[..]));
            document::update(path, &job.title(points), &section, figures)?;
        }
        None => println!("{section}\n{}", document::figures_of(job, &outcomes)),
    }
    Ok(outcomes.iter().all(|o| o.fault.is_none() && o.validation.is_none_or(|cost| cost.exit_code == 0)))
}
