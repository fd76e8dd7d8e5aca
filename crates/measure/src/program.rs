//! Runs the program as its users do, and measures what a run costs.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::MeasureError;

/// How long a run may go on unnoticed after the request to stop, and after its end.
const POLL: Duration = Duration::from_millis(3);

/// The program that is measured, as an executable.
#[derive(Clone)]
pub(crate) struct Program<'a> {
    pub(crate) path: &'a Path,
    pub(crate) should_stop: &'a (dyn Fn() -> bool + Sync),
}

/// A run that came to its end.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    /// From start to end, seconds.
    pub(crate) wall_seconds: f64,
    /// Processor time of the program and the kernel, seconds; not known on systems that are no Unix.
    pub(crate) cpu_seconds: Option<f64>,
    /// What it printed on standard output, which is JSON; null if it is none.
    pub(crate) json: Value,
    /// The exit code; −1 if a signal ended it.
    pub(crate) code: i32,
    /// What it printed on standard error.
    pub(crate) complaint: String,
}

impl Program<'_> {
    /// Runs a command that prints JSON.
    ///
    /// # Errors
    /// A program that cannot be started, or the request to stop.
    pub(crate) fn run<S: AsRef<std::ffi::OsStr>>(
        &self,
        arguments: impl IntoIterator<Item = S>,
    ) -> Result<Run, MeasureError> {
        let failed = |error: io::Error| MeasureError::Program { path: self.path.to_owned(), error };
        let cpu = children_cpu_seconds();
        let start = Instant::now();
        let mut command = Command::new(self.path);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(failed)?;
        let readers = [drain(child.stdout.take()), drain(child.stderr.take())];
        let status = loop {
            if let Some(status) = child.try_wait().map_err(failed)? {
                break status;
            }
            if (self.should_stop)() {
                // it may have ended by itself
                let _ = child.kill();
                child.wait().map_err(failed)?;
                return Err(MeasureError::Interrupted);
            }
            std::thread::sleep(POLL);
        };
        let wall_seconds = start.elapsed().as_secs_f64();
        let cpu_seconds = cpu.zip(children_cpu_seconds()).map(|(before, after)| after - before);
        let [out, complaint] = readers.map(|reader| reader.join().unwrap_or_default());
        if (self.should_stop)() {
            return Err(MeasureError::Interrupted);
        }
        let json = serde_json::from_slice(&out).unwrap_or(Value::Null);
        let complaint = String::from_utf8_lossy(&complaint).trim().to_owned();
        Ok(Run { wall_seconds, cpu_seconds, json, code: status.code().unwrap_or(-1), complaint })
    }
}

/// Reads to the end on another thread: a full pipe would stop the program.
fn drain(pipe: Option<impl io::Read + Send + 'static>) -> std::thread::JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        // what cannot be read is not there; the exit code tells the rest
        if let Some(mut pipe) = pipe {
            let _ = pipe.read_to_end(&mut bytes);
        }
        bytes
    })
}

/// Processor time of all children that were waited for.
#[cfg(unix)]
fn children_cpu_seconds() -> Option<f64> {
    use nix::sys::resource::{UsageWho, getrusage};
    use nix::sys::time::TimeValLike as _;
    let usage = getrusage(UsageWho::RUSAGE_CHILDREN).ok()?;
    Some((usage.user_time().num_microseconds() + usage.system_time().num_microseconds()) as f64 * 1e-6)
}

#[cfg(not(unix))]
fn children_cpu_seconds() -> Option<f64> {
    None
}

/// Bytes of all files below `path`, or of the file.
pub(crate) fn bytes_of(path: &Path) -> io::Result<u64> {
    let mut open: Vec<PathBuf> = vec![path.to_owned()];
    let mut bytes = 0;
    while let Some(path) = open.pop() {
        let metadata = path.symlink_metadata()?;
        if metadata.is_dir() {
            for entry in path.read_dir()? {
                open.push(entry?.path());
            }
        } else {
            bytes += metadata.len();
        }
    }
    Ok(bytes)
}
