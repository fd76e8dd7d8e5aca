//! Running cases: scenes before, outputs removed after.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{fs, io};

use pointmill_bench::{las_file, process};
use pointmill_format::serde_json;

use crate::ballast::Ballast;
use crate::cases::{Case, Program};
use crate::job::SceneFile;
use crate::outcome::Outcome;
use crate::programs::Programs;

/// A scene of so many bytes is not read beforehand: it would not stay in the page cache.
const HUGE: u64 = 6 << 30;

/// A scene of more bytes is made anew each time.
const KEPT: u64 = 2 << 30;

/// Where and with what cases are run.
pub(crate) struct Runner<'a> {
    pub(crate) programs: &'a Programs,
    pub(crate) dir: &'a Path,
    /// Holds memory that runs take.
    pub(crate) ballast: Option<Ballast>,
    /// Bytes that it holds before each run.
    pub(crate) lend: u64,
}

impl Runner<'_> {
    /// Runs a case once; what came of it goes to `outcome`.
    ///
    /// # Errors
    /// Of the operating system; that the program fails is none.
    pub(crate) fn once(&mut self, outcome: &mut Outcome) -> io::Result<()> {
        let output = self.dir.join(outcome.case.output());
        remove(&output)?;
        let input = self.scene_path(&outcome.case.scene);
        let mut command = Command::new(self.programs.path(outcome.case.program));
        command.args(outcome.case.arguments(&input, &output));
        let (cost, said) = self.cost(&mut command)?;
        outcome.output_bytes = size_of(&output).unwrap_or(0);
        // PotreeConverter ends with 0 whatever happened; a dataset smaller than a byte a point is none.
        let is_small = outcome.case.program.is_writer() && outcome.output_bytes < outcome.case.scene.points;
        if cost.exit_code != 0 || is_small {
            outcome.fault = Some(format!("exit code {}, {} bytes: {said}", cost.exit_code, outcome.output_bytes));
        } else {
            outcome.costs.push(cost);
            outcome.temp_bytes = temp_bytes(&output).unwrap_or(0);
            if outcome.case.is_validated {
                outcome.validation = Some(self.validate(&outcome.case, &output, &input)?);
            }
        }
        remove(&output)
    }

    fn validate(&mut self, case: &Case, output: &Path, input: &Path) -> io::Result<process::Cost> {
        eprintln!("validating: {}", case.label);
        let mut command = Command::new(self.programs.path(Program::Pointmill));
        let memory = case.options.iter().skip_while(|option| *option != "--memory").take(2);
        command.arg("validate").arg(output).arg("--against").arg(input).args(memory);
        let (cost, said) = self.cost(&mut command)?;
        if cost.exit_code != 0 {
            eprintln!("exit code {}: {said}", cost.exit_code);
        }
        Ok(cost)
    }

    /// Runs a command to its end; with the last line that it said on standard error.
    fn cost(&mut self, command: &mut Command) -> io::Result<(process::Cost, String)> {
        let said = self.dir.join("stderr.txt");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(fs::File::create(&said)?);
        process::settle();
        if let Some(ballast) = &mut self.ballast {
            ballast.fill(self.lend)?; // last: the host does not wait long
        }
        let cost = process::run(command)?;
        let text = String::from_utf8_lossy(&fs::read(&said)?).into_owned();
        fs::remove_file(&said)?;
        let last = text.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or("no word").to_owned();
        Ok((cost, last))
    }

    /// Makes a scene, unless it is there already, and reads it once so that no run pays the disk for it.
    ///
    /// # Errors
    /// Of the operating system.
    pub(crate) fn make_scene(&self, scene: &SceneFile) -> io::Result<()> {
        let path = self.scene_path(scene);
        if !path.exists() {
            eprintln!("generating {}", path.display());
            let part = path.with_extension(format!("part.{}", path.extension().unwrap_or_default().display()));
            las_file::write(scene.scene, scene.layout, scene.points, 7, &part)?;
            fs::rename(part, &path)?;
        }
        if size_of(&path)? < HUGE {
            io::copy(&mut fs::File::open(path)?, &mut io::sink())?;
        }
        Ok(())
    }

    /// Removes a scene if it is large.
    ///
    /// # Errors
    /// Of the operating system.
    pub(crate) fn drop_scene(&self, scene: &SceneFile) -> io::Result<()> {
        let path = self.scene_path(scene);
        if size_of(&path).is_ok_and(|bytes| bytes > KEPT) { remove(&path) } else { Ok(()) }
    }

    fn scene_path(&self, scene: &SceneFile) -> PathBuf {
        self.dir.join(scene.file_name())
    }
}

/// What the report beside a dataset says of temporary files.
fn temp_bytes(output: &Path) -> Option<u64> {
    let report = fs::read(output.join("report.json")).ok()?;
    serde_json::from_slice::<serde_json::Value>(&report).ok()?.get("temp_bytes")?.as_u64()
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
