//! `pointmill export`: from the options to a `Plan`, a run and a summary.

use std::path::{Path, PathBuf};

use pointmill_converter::{AttributeChoice, ExportFormat, ExportReport, OnFault, Plan, ScaleChoice, resolve_path};

use super::report_file::ReportFile;
use crate::args::{Attributes, ExportArgs, FaultArg};
use crate::exit::{Failure, emit, print_line, to_json};
use crate::flags;
use crate::human::export;
use crate::human::progress::Progress;
use crate::inputs::Inputs;
use crate::interrupt::{no_more_checks, stop_flag};

pub(crate) fn run(args: &ExportArgs) -> Result<(), Failure> {
    let format = format(&args.output)?;
    let inputs = args.inputs.expand(&args.output)?;
    if args.unreadable == FaultArg::Fail
        && let Some(failure) = inputs.unread_failure(&flags::skip_unread())
    {
        return Err(failure);
    }
    if !args.talk.quiet {
        inputs.notes.iter().for_each(|note| print_line(note));
    }
    let plan = plan(args, inputs)?;
    protect_inputs(&plan, args)?;
    let report_file = args.report.as_ref().map(|file| {
        let sources = plan.inputs.iter().chain(&args.inputs.files_from);
        ReportFile::new(file, &plan.output, sources)
    });
    let report_file = report_file.transpose()?;
    let progress = Progress::new(&args.talk, Some(stop_flag()));
    let result = pointmill_converter::export(&plan, format, &progress);
    no_more_checks();
    let for_people = progress.end();
    let report = result?;
    tell(args, report_file.as_ref(), &report).map_err(|failure| after_all(failure, &plan.output))?;
    if for_people {
        export::report(&report).iter().for_each(|line| print_line(line));
    }
    Ok(())
}

/// The account where it was asked for.
fn tell(args: &ExportArgs, file: Option<&ReportFile>, report: &ExportReport) -> Result<(), Failure> {
    if file.is_none() && !args.json {
        return Ok(());
    }
    let text = to_json(report)?;
    file.map_or(Ok(()), |file| file.write(&text))?;
    if args.json { emit(&text) } else { Ok(()) }
}

/// What fails once the file is in place must not read as if there were none.
fn after_all(failure: Failure, output: &Path) -> Failure {
    match failure {
        Failure::Io(line) => Failure::Io(format!("{line}; the output {} is complete", output.display())),
        other => other,
    }
}

/// The format that the ending of the output asks for.
fn format(output: &Path) -> Result<ExportFormat, Failure> {
    if let Some(format) = ExportFormat::of(output) {
        return if is_named_copc(output) { Err(no_copc(output)) } else { Ok(format) };
    }
    let known = ExportFormat::ALL.map(|format| format!(".{}", format.extension())).join(", ");
    let shown = output.display();
    Err(match output.extension() {
        Some(ending) if ending.eq_ignore_ascii_case("e57") => {
            Failure::Unsupported(format!("{shown}: E57 is not written; choose {known}"))
        }
        Some(_) => Failure::Usage(format!("{shown}: files with this ending are not written; choose {known}")),
        None => Failure::Usage(format!("{shown}: the ending of the name says the format; choose {known}")),
    })
}

/// True of the double ending by which other programs know COPC.
fn is_named_copc(output: &Path) -> bool {
    let stem = output.file_stem().map(Path::new).and_then(Path::extension);
    stem.is_some_and(|ending| ending.eq_ignore_ascii_case("copc"))
}

fn no_copc(output: &Path) -> Failure {
    let shown = output.display();
    Failure::Usage(format!("{shown}: an export is no COPC; pass `convert --to copc`, or choose a name without .copc"))
}

fn plan(args: &ExportArgs, inputs: Inputs) -> Result<Plan, Failure> {
    let mut plan = Plan::new(inputs.files, args.output.clone());
    plan.other_files = inputs.other_files;
    plan.skipped_inputs = inputs.unread.into_iter().map(|unread| (unread.path, unread.why)).collect();
    plan.open = args.inputs.options()?;
    (plan.open.max_level, plan.open.min_spacing) = (args.level, args.spacing);
    plan.attributes = match &args.attributes {
        Attributes::All => AttributeChoice::All,
        Attributes::Scene => {
            return Err(Failure::Usage("--attributes scene is for datasets; name attributes, or pass all".to_owned()));
        }
        Attributes::List(names) => AttributeChoice::List(names.clone()),
    };
    plan.scale = args.scale.0.map_or(ScaleChoice::Auto, ScaleChoice::Fixed);
    plan.filter.bounds = args.bounds.iter().copied().reduce(|all, more| all.union(&more));
    if args.bounds.len() > 1 {
        plan.filter.regions.clone_from(&args.bounds);
    }
    (plan.filter.classes, plan.filter.every) = (args.class.clone(), args.every);
    plan.unreadable = match args.unreadable {
        FaultArg::Skip => OnFault::Skip,
        FaultArg::Fail => OnFault::Fail,
    };
    plan.crs.clone_from(&args.inputs.reading.placing.crs);
    plan.overwrite = args.overwrite;
    if let Some(bytes) = args.memory {
        plan.memory_bytes = bytes;
    }
    if let Some(threads) = args.threads {
        plan.threads = usize::from(threads.get());
    }
    Ok(plan)
}

/// What is being read is never replaced, nor is anything put into it.
fn protect_inputs(plan: &Plan, args: &ExportArgs) -> Result<(), Failure> {
    // an output that cannot be found is an error of the run
    let Ok(output) = resolve_path(&plan.output) else { return Ok(()) };
    let is_in = |input: &&PathBuf| input.canonicalize().is_ok_and(|input| output.starts_with(input));
    let matrix = args.inputs.reading.placing.transform.as_ref().map(PathBuf::from);
    let mut read = plan.inputs.iter().chain(&args.inputs.files_from).chain(&matrix);
    let Some(input) = read.find(is_in) else { return Ok(()) };
    let (shown, input) = (plan.output.display(), input.display());
    Err(Failure::Usage(format!("{shown}: the output would be in the place of the input {input}; choose another file")))
}
