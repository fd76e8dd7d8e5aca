//! The command line of pointmill: from options to a `Plan`, a run, and an exit code.
//!
//! Results go to standard output, everything else to standard error; a failure is one line there. `README.md` has the
//! table of exit codes, `exit.rs` is where they come from.

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]

mod allocator;
mod args;
mod commands;
mod crs_choice;
mod datasets;
mod depth_choice;
mod exit;
mod fitting;
mod flags;
mod human;
mod inputs;
mod interrupt;
mod printable;
mod profiles;
mod scan_choice;
mod text_choice;

use std::process::ExitCode;

use args::{Args, Command};
use clap::CommandFactory as _;
use commands::{convert, export, extract, info, job, manual, measure, preview, validate, view};
use exit::Failure;

fn main() -> ExitCode {
    allocator::set_up(std::env::args_os().nth(1).is_some_and(|command| command == "job"));
    exit::remember_panics();
    interrupt::watch();
    let result = std::panic::catch_unwind(|| run(&profiles::command_line(&std::env::args_os().collect::<Vec<_>>())?))
        .unwrap_or_else(|_| Err(exit::last_panic()));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            match &failure {
                Failure::Interrupted(line) => interrupt::say(line),
                other => other.print(),
            }
            ExitCode::from(failure.code())
        }
    }
}

fn run(args: &Args) -> Result<(), Failure> {
    fitting::begins(args.command.name(), Args::command());
    match &args.command {
        Command::Convert(convert) => convert::run(convert),
        Command::Job(job) => job::run(job),
        Command::Export(export) => export::run(export),
        Command::Measure(measure) => measure::run(measure),
        Command::Validate(validate) => validate::run(validate),
        Command::Extract(extract) => extract::run(extract),
        Command::Info(info) => info::run(info),
        Command::Preview(preview) => preview::run(preview),
        Command::View(view) => view::run(view),
        Command::Completions(completions) => manual::completions(completions),
        Command::Man(man) => manual::man(man),
    }
}
