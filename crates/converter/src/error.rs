//! Why a run could not finish. Each error is one line: what, where, what to do.

use std::io;
use std::path::{Path, PathBuf};

use pointmill_format::ReadError;

/// Why a run could not finish; the output is as it was before.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// An input is broken, not supported or not readable (see its kind).
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The request makes no sense as given.
    #[error("{0}")]
    Usage(String),
    /// The request is sensible, but this version cannot do it.
    #[error("{0}")]
    Unsupported(String),
    /// The inputs break a promise together, or hold nothing that can be converted.
    #[error("{0}")]
    Input(String),
    /// The output exists and may not be replaced.
    #[error("{}: the output exists already; choose another one or pass --overwrite", .0.display())]
    OutputExists(PathBuf),
    /// Disk full, no permission, …
    #[error("{}: {doing}: {error}{}", path.display(), disk_advice(error))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried ("writing the spill file").
        doing: &'static str,
        /// What the operating system said.
        error: io::Error,
    },
    /// The memory ceiling is too small for this job.
    #[error("the memory ceiling of {} MiB is too small: {why}; pass --memory {}MiB or more", ceiling >> 20, (needed >> 20) + 1)]
    Memory {
        /// Bytes allowed.
        ceiling: u64,
        /// Bytes that would do.
        needed: u64,
        /// What needs them.
        why: String,
    },
    /// The run was asked to stop.
    #[error("interrupted; nothing was written")]
    Interrupted,
    /// A promise of our own code did not hold.
    #[error("internal fault: {0}; please report it with the command line and the input")]
    Internal(String),
}

impl ConvertError {
    /// Wraps an operating-system error.
    pub fn io(path: impl AsRef<Path>, doing: &'static str, error: io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), doing, error }
    }
}

fn disk_advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; free some space, or put temporary files elsewhere with --temp-dir"
        }
        _ => "",
    }
}
