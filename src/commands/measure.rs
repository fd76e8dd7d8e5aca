//! `pointmill measure`: from the options to a `Measurement`, its files and a summary.

use std::fs;
use std::path::{Path, PathBuf};

use pointmill_converter::{WorkFolder, resolve_path};
use pointmill_measure::{MeasureError, Measured, Measurement, Shown, Watch, report};

use crate::args::{BUDGET, InputArgs, MeasureArgs, SAMPLE};
use crate::exit::{Failure, emit, print_line, to_json};
use crate::fitting::{fitted, running};
use crate::human::measurement;
use crate::human::progress::{MEASURE, Progress};
use crate::interrupt::{keeps, no_more_checks, stop_flag, works_in};

pub(crate) fn run(args: &MeasureArgs) -> Result<(), Failure> {
    let typed = InputArgs { inputs: args.inputs.clone(), files_from: args.files_from.clone(), ..InputArgs::default() };
    let inputs = typed.expand(&args.output)?;
    if let Some(failure) = inputs.unread_failure("") {
        return Err(failure);
    }
    if !args.talk.quiet {
        inputs.notes.iter().for_each(|note| print_line(note));
    }
    let made = prepare(args, &inputs.files)?;
    let folder = made.path.clone();
    let temporary = temporary(args.temp_dir.as_deref().unwrap_or(&folder))?;
    let progress = Progress::new(&args.talk, Some(stop_flag()));
    works_in(temporary.path());
    let measurement = Measurement {
        program: program()?,
        inputs: inputs.files,
        axes: args.axes.clone().unwrap_or_default(),
        sample: args.sample.unwrap_or(SAMPLE),
        threads: args.threads.map_or_else(all_cores, |threads| usize::from(threads.get())),
        budget: args.budget.unwrap_or(BUDGET),
        size: args.size,
        temporary: temporary.files(),
        memory: args.memory,
    };
    let watcher = Watcher { folder: &folder, progress: &progress, failed: std::sync::Mutex::new(None) };
    let measured = measurement.run(&watcher);
    no_more_checks();
    let for_people = progress.end();
    drop(temporary);
    if let Some(error) = watcher.failed.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
        return Err(error.into());
    }
    let (result, _) = measured?;
    if !result.is_complete {
        return Err(Failure::Interrupted(kept_line(&folder, &result)));
    }
    if let Some(failure) = all_failed(&result) {
        return Err(failure);
    }
    if args.json {
        emit(&to_json(&result)?)?;
    }
    if for_people {
        measurement::summary(&result, &folder).iter().for_each(|line| print_line(line));
    }
    Ok(())
}

/// The first failure, if no setting has figures.
fn all_failed(result: &Measured) -> Option<Failure> {
    let reasons = result.rows.iter().map(|row| row.failed.as_deref());
    let reasons: Vec<&str> = reasons.collect::<Option<_>>()?;
    let first = reasons.first()?;
    let code = first.strip_prefix("exit code ").and_then(|rest| rest.split(':').next());
    let line = format!("no setting could be measured; the first: {first}");
    // a conversion that was measured gives advice for `convert`
    let line = fitted(running(), &line).unwrap_or(line);
    Some(match code {
        Some("2") => Failure::Usage(line),
        Some("3") => Failure::Input(line),
        Some("4") => Failure::Unsupported(line),
        Some("5") => Failure::Io(line),
        Some("6") => Failure::Memory(line),
        _ => Failure::Internal(line),
    })
}

/// This program: what is measured is what runs.
fn program() -> Result<PathBuf, Failure> {
    std::env::current_exe().map_err(|error| Failure::Internal(format!("this program's file is not known: {error}")))
}

fn all_cores() -> usize {
    std::thread::available_parallelism().map_or(1, Into::into)
}

/// The folder of the results. What was made of it and above it goes again if nothing is put into it.
struct ResultFolder {
    path: PathBuf,
    /// The lowest first.
    made: Vec<PathBuf>,
}

impl Drop for ResultFolder {
    fn drop(&mut self) {
        for folder in &self.made {
            let _ = fs::remove_dir(folder); // with something in it, it stays
        }
    }
}

/// Makes the folder; what stands in it is left alone, but for the files of an earlier measurement if these may be replaced.
fn prepare(args: &MeasureArgs, inputs: &[PathBuf]) -> Result<ResultFolder, Failure> {
    let shown = args.output.display();
    let folder = resolve_path(&args.output).map_err(|error| Failure::Usage(format!("{shown}: {error}")))?;
    let is_in = |input: &&PathBuf| input.canonicalize().is_ok_and(|input| folder.starts_with(input));
    if let Some(input) = inputs.iter().find(is_in) {
        let input = input.display();
        return Err(Failure::Usage(format!(
            "{shown}: the output would be inside of the input {input}; choose another folder"
        )));
    }
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::Usage(format!("{shown}: this is a file; name a folder")));
    }
    if let Some(file) = report::FILES.iter().find(|file| folder.join(file).symlink_metadata().is_ok()) {
        if !args.overwrite {
            return Err(Failure::Usage(format!("{shown}: {file} is there already; pass --overwrite to replace it")));
        }
        if !is_measurement(&folder) {
            return Err(Failure::Usage(format!("{shown}: {file} is of no measurement; choose another folder")));
        }
    }
    let missing = folder.ancestors().take_while(|path| !path.exists()).map(Path::to_path_buf).collect();
    let folder = ResultFolder { path: folder, made: missing };
    fs::create_dir_all(&folder.path).map_err(|error| Failure::io(&args.output, "making the folder", &error))?;
    Ok(folder)
}

/// True if the files that would be replaced are those of a measurement, known by its content.
fn is_measurement(folder: &Path) -> bool {
    let is_file = |file: &&str| folder.join(file).symlink_metadata().map_or(true, |meta| meta.is_file());
    let text = fs::read(folder.join(report::FILES[0])).ok();
    let result: Option<serde_json::Value> = text.and_then(|text| serde_json::from_slice(&text).ok());
    report::FILES.iter().all(is_file)
        && result.is_some_and(|result| result.get("rows").is_some() && result.get("profiles").is_some())
}

fn temporary(parent: &Path) -> Result<WorkFolder, Failure> {
    WorkFolder::make(parent, ".measure-")
        .map_err(|error| Failure::io(parent, "making a folder for temporary files", &error))
}

fn kept_line(folder: &Path, result: &Measured) -> String {
    let folder = folder.display();
    format!("interrupted; {folder} has the figures of the {} settings that were measured until then", result.rows.len())
}

/// Tells of progress, and writes what was measured after every setting.
struct Watcher<'a> {
    folder: &'a Path,
    progress: &'a Progress,
    /// The results could not be written: that ends the measurement.
    failed: std::sync::Mutex<Option<MeasureError>>,
}

impl Watch for Watcher<'_> {
    fn should_stop(&self) -> bool {
        self.progress.stopped() || self.failed.lock().is_ok_and(|failed| failed.is_some())
    }

    fn begins(&self, what: &str, done: usize, of: usize) {
        self.progress.at(MEASURE, done as u64, of as u64);
        self.progress.detail(what);
    }

    fn measured(&self, so_far: &Measured, pictures: &[Shown]) {
        if let Err(error) = report::write_all(self.folder, so_far, pictures)
            && let Ok(mut failed) = self.failed.lock()
        {
            *failed = Some(error);
        }
        keeps(kept_line(self.folder, so_far));
    }
}

impl From<MeasureError> for Failure {
    fn from(error: MeasureError) -> Self {
        match error {
            MeasureError::Interrupted => Self::Interrupted("interrupted; nothing was measured yet".to_owned()),
            MeasureError::Read(error) => error.into(),
            MeasureError::Empty(_) => Self::Input(error.to_string()),
            MeasureError::TooMany { .. } => Self::Memory(format!("{error}; pass a smaller --sample")),
            MeasureError::Write { .. } => Self::Io(error.to_string()),
            MeasureError::Render(_) => Self::Unsupported(error.to_string()),
            MeasureError::Sample(_) => Self::Input(error.to_string()),
            other => Self::Internal(other.to_string()),
        }
    }
}
