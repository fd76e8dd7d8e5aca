//! Converts generated scans with pointmill and, when they are on `PATH`, with PotreeConverter and copc_converter, in
//! turn, and writes what each run cost as Markdown, with the ratios that count.
//!
//! What the numbers do not show: disks (inputs come from the page cache), other scans than the generated ones, and
//! the quality of what was written (`pointmill validate` reports that).

mod args;
mod cases;
mod outcome;
mod table;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::{fs, io};

use clap::Parser as _;
use pointmill_bench::process;
use pointmill_bench::{las_file, scene::Scene};

use args::{Args, Format};
use cases::Program;
use outcome::Outcome;

fn main() -> ExitCode {
    match measure(&Args::parse()) {
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
    let pointmill = match &args.pointmill {
        Some(path) => path.clone(),
        None => built_pointmill()?,
    };
    let mut outcomes: Vec<Outcome> = cases::list(args)
        .into_iter()
        .filter_map(|case| {
            let found = case.program == Program::Pointmill || on_path(case.program.name());
            found.then_some(Outcome { case, costs: Vec::new(), output_bytes: 0, fault: None })
        })
        .collect();
    let extension = if matches!(args.format, Format::Las) { "las" } else { "laz" };
    for outcome in &mut outcomes {
        let (name, points) = (args.scene().name(), outcome.case.points);
        outcome.case.input = scene_file(&dir.join(format!("{name}-{points}.{extension}")), args.scene(), points)?;
    }
    // In turn, so that a machine that slows down slows all of them.
    for run in 1..=args.runs {
        for outcome in outcomes.iter_mut().filter(|o| o.fault.is_none()) {
            eprintln!("run {run} of {}: {}", args.runs, outcome.case.label);
            run_once(outcome, &pointmill, &dir)?;
        }
    }
    let text = table::section(args, &outcomes, &pointmill);
    match &args.out {
        Some(path) => table::replace_section(path, &table::title(args), &text)?,
        None => print!("{text}"),
    }
    Ok(outcomes.iter().all(|o| o.fault.is_none()))
}

fn run_once(outcome: &mut Outcome, pointmill: &Path, dir: &Path) -> io::Result<()> {
    let output = dir.join(if outcome.case.program == Program::CopcConverter { "out.copc.laz" } else { "out" });
    remove(&output)?;
    let program =
        if outcome.case.program == Program::Pointmill { pointmill } else { Path::new(outcome.case.program.name()) };
    let said = dir.join("stderr.txt");
    let mut command = Command::new(program);
    command.args(outcome.case.arguments(&outcome.case.input, &output));
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(fs::File::create(&said)?);
    let cost = process::run(&mut command)?;
    outcome.output_bytes = size_of(&output).unwrap_or(0);
    // PotreeConverter ends with 0 whatever happened; a dataset smaller than a byte a point is none.
    if cost.exit_code != 0 || outcome.output_bytes < outcome.case.points {
        let text = String::from_utf8_lossy(&fs::read(&said)?).into_owned();
        let last = text.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or("no word").to_owned();
        outcome.fault = Some(format!("exit code {}, {} bytes: {last}", cost.exit_code, outcome.output_bytes));
    } else {
        outcome.costs.push(cost);
    }
    fs::remove_file(&said)?;
    remove(&output)
}

/// The scene at `path`, generated unless it is there already, and read once so that no run pays the disk for it.
fn scene_file(path: &Path, scene: Scene, points: u64) -> io::Result<PathBuf> {
    if !path.exists() {
        eprintln!("generating {}", path.display());
        let part = path.with_extension(format!("part.{}", path.extension().unwrap_or_default().display()));
        las_file::write(scene, points, 7, &part)?;
        fs::rename(part, path)?;
    }
    io::copy(&mut fs::File::open(path)?, &mut io::sink())?;
    Ok(path.to_path_buf())
}

/// The release binary beside this program, brought up to date first when cargo runs us.
fn built_pointmill() -> io::Result<PathBuf> {
    if let Some(cargo) = std::env::var_os("CARGO") {
        let status = Command::new(cargo).args(["build", "--release", "-p", "pointmill"]).status()?;
        if !status.success() {
            return Err(io::Error::other("pointmill does not build"));
        }
    }
    let path = std::env::current_exe()?.with_file_name(format!("pointmill{}", std::env::consts::EXE_SUFFIX));
    if path.exists() {
        return Ok(path);
    }
    let advice = "build it with cargo build --release, or pass --pointmill FILE";
    Err(io::Error::other(format!("{} is not there; {advice}", path.display())))
}

fn on_path(program: &str) -> bool {
    let found = std::env::var_os("PATH")
        .is_some_and(|path| std::env::split_paths(&path).any(|dir| dir.join(program).is_file()));
    if !found {
        eprintln!("{program} is not on PATH and is omitted");
    }
    found
}

fn size_of(path: &Path) -> io::Result<u64> {
    let meta = fs::symlink_metadata(path)?;
    if !meta.is_dir() {
        return Ok(meta.len());
    }
    fs::read_dir(path)?.map(|entry| size_of(&entry?.path())).sum()
}

fn remove(path: &Path) -> io::Result<()> {
    let result = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    result.or_else(|e| if e.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(e) })
}
