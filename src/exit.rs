//! From errors to exit codes, and the one line that reports them.

use std::io::{self, Write as _};
use std::panic::PanicHookInfo;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use pointmill_converter::ConvertError;
use pointmill_format::{Advice, ErrorKind, ReadError, system_reason};
use pointmill_render::RenderError;
use pointmill_view::ViewError;

use crate::flags;
use crate::printable::{json_escaped, printable, printable_lines};

/// Why the program ends without success.
#[derive(Debug)]
pub(crate) enum Failure {
    /// 1: an error in this program.
    Internal(String),
    /// 2: options or paths that cannot be used.
    Usage(String),
    /// 3: an input is broken, or none was found.
    Input(String),
    /// 4: an input or a request that this version does not support.
    Unsupported(String),
    /// 5: disk full, no permission, …
    Io(String),
    /// 6: the memory limit is too small.
    Memory(String),
    /// 7: validation found errors in a dataset; the findings are on standard output.
    Faults(String),
    /// 130: Ctrl-C or a request to terminate.
    Interrupted(String),
}

impl Failure {
    /// The exit code that scripts rely on.
    pub(crate) fn code(&self) -> u8 {
        match self {
            Self::Internal(_) => 1,
            Self::Usage(_) => 2,
            Self::Input(_) => 3,
            Self::Unsupported(_) => 4,
            Self::Io(_) => 5,
            Self::Memory(_) => 6,
            Self::Faults(_) => 7,
            Self::Interrupted(_) => 130,
        }
    }

    /// The line that reports it.
    pub(crate) fn line(&self) -> &str {
        let (Self::Internal(line)
        | Self::Usage(line)
        | Self::Input(line)
        | Self::Unsupported(line)
        | Self::Io(line)
        | Self::Memory(line)
        | Self::Faults(line)
        | Self::Interrupted(line)) = self;
        line
    }

    /// Prints the line on standard error.
    pub(crate) fn print(&self) {
        // to be stopped is no error
        let word = if matches!(self, Self::Interrupted(_)) { "pointmill" } else { "error" };
        write_line(word, self.line());
    }

    /// The operating system refused; `doing` names the attempt ("writing the report").
    pub(crate) fn io(path: &Path, doing: &str, error: &io::Error) -> Self {
        Self::Io(format!("{}: {doing}: {}", path.display(), system_reason(error)))
    }
}

/// Prints a note on standard error: one line, whatever names it holds.
pub(crate) fn print_line(line: &str) {
    write_line("pointmill", line);
}

fn write_line(word: &str, line: &str) {
    // Nothing can be reported when standard error is closed.
    let _ = writeln!(io::stderr().lock(), "{word}: {}", printable(line));
}

/// Writes a result to standard output, with nothing in it that a terminal obeys. A closed pipe (`| head`) is not an
/// error.
pub(crate) fn emit(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(printable_lines(text).as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        Err(e) => Err(Failure::Io(format!("writing to standard output: {}", system_reason(&e)))),
        Ok(()) => Ok(()),
    }
}

/// Pretty JSON and a line break.
pub(crate) fn to_json(value: &impl serde::Serialize) -> Result<String, Failure> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Failure::Internal(format!("internal error: {e}")))?;
    Ok(json_escaped(&text).into_owned() + "\n")
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        let line = flags::read_error_line(&error);
        match error.kind() {
            ErrorKind::Broken => Self::Input(line),
            ErrorKind::Unsupported if error.advice() == Some(&Advice::MoreMemory) => Self::Memory(line),
            ErrorKind::Unsupported => Self::Unsupported(line),
            ErrorKind::Io(_) => Self::Io(line),
        }
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Read(read) => read.into(),
            RenderError::Camera(camera) => Self::Usage(camera.to_string()),
            RenderError::NoAttribute { .. } => Self::Unsupported(error.to_string()),
            other => Self::Internal(other.to_string()),
        }
    }
}

impl From<ViewError> for Failure {
    fn from(error: ViewError) -> Self {
        match error {
            ViewError::Read(read) => read.into(),
            ViewError::Listen { .. } => Self::Io(format!("{error}; --port chooses another")),
            other => Self::Io(other.to_string()),
        }
    }
}

impl From<ConvertError> for Failure {
    fn from(error: ConvertError) -> Self {
        let line = flags::error_line(&error);
        match error {
            ConvertError::Read(read) => read.into(),
            ConvertError::Plan(_) | ConvertError::Output(_) => Self::Usage(line),
            ConvertError::Unsupported(_) => Self::Unsupported(line),
            ConvertError::Input(_) => Self::Input(line),
            ConvertError::Io { .. } => Self::Io(line),
            ConvertError::Memory { .. } => Self::Memory(line),
            ConvertError::Refused { .. } => Self::Faults(line),
            ConvertError::Interrupted => Self::Interrupted(line),
            _ => Self::Internal(line),
        }
    }
}

static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// Keeps panics silent and remembers the last one: a worker's panic ends the run, and `main` reports it once.
pub(crate) fn remember_panics() {
    let backtrace_wanted = std::env::var_os("RUST_BACKTRACE").is_some_and(|v| v != "0");
    let default_hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = describe(panic);
        if backtrace_wanted {
            default_hook(panic);
        }
    }));
}

fn describe(panic: &PanicHookInfo<'_>) -> String {
    let payload = panic.payload();
    let message = payload.downcast_ref::<&str>().copied();
    let message = message.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("panic");
    match panic.location() {
        Some(place) => format!("{message} ({}:{})", place.file(), place.line()),
        None => message.to_owned(),
    }
}

/// The panic that just ended a run.
pub(crate) fn last_panic() -> Failure {
    let what = LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone();
    Failure::Internal(format!("internal error: {what}; please report it with the command line and the input"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pointmill_converter::{MemoryNeed, OutputFault};

    #[test]
    fn the_kind_of_error_decides_the_code() {
        let io_error = || io::Error::from(io::ErrorKind::StorageFull);
        let exists = || ConvertError::Output(OutputFault::Exists("x".into()));
        let full = || ConvertError::Io { path: "a".into(), doing: "x", error: io_error(), is_temporary: false };
        let why = MemoryNeed::Part("nodes");
        let table: [(Failure, u8); 9] = [
            (ConvertError::Internal("x".into()).into(), 1),
            (exists().into(), 2),
            (ReadError::broken("a.las", None, "x").into(), 3),
            (ConvertError::Read(ReadError::broken("a.las", None, "x")).into(), 3),
            (ReadError::unsupported("a.las", "x").into(), 4),
            (ReadError::io("a.las", "x", io_error()).into(), 5),
            (full().into(), 5),
            (ConvertError::Memory { ceiling: 1, needed: 2, why }.into(), 6),
            (ConvertError::Interrupted.into(), 130),
        ];
        for (failure, code) in table {
            assert_eq!(failure.code(), code, "{failure:?}");
        }
    }

    #[test]
    fn a_panic_becomes_one_line_with_its_place() {
        remember_panics();
        let caught = std::panic::catch_unwind(|| panic!("seven"));
        drop(std::panic::take_hook()); // so that other tests print theirs
        assert!(caught.is_err());
        let Failure::Internal(line) = last_panic() else { unreachable!() };
        assert!(line.contains("seven") && line.contains("exit.rs:"), "{line}");
    }
}
