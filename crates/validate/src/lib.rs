//! Does a dataset keep the promises of its format, and does it hold every point of its sources?
//!
//! ```no_run
//! use pointmill_validate::{Options, validate};
//!
//! # fn main() -> Result<(), pointmill_format::ReadError> {
//! let options = Options { against: vec!["scan.laz".into()], ..Options::default() };
//! let outcome = validate("clouds/city".as_ref(), &options, &|_| {})?;
//! for problem in &outcome.problems {
//!     println!("{problem}"); // error boxes r042: position (3 points): expected …, found …
//! }
//! assert!(outcome.ok);
//! # Ok(())
//! # }
//! ```
//!
//! The crate believes nobody. It shares the readers of `pointmill-format` and works out every expectation itself, from
//! the page of the format in `docs/formats`: boxes, spacing, order, checksums. That repetition is deliberate. It never
//! sees the converter.
#![forbid(unsafe_code)]

mod against;
mod batches;
mod bintree;
mod check;
mod finding;
mod place;
mod potree2;

use std::path::{Path, PathBuf};

use pointmill_format::{OpenOptions, ReadError};
use serde::Serialize;

pub use against::AgainstSummary;
pub use bintree::LeafQuality;
pub use check::Check;
pub use finding::{CheckResult, Finding, Severity};
pub use place::{BinaryNode, Place};
pub use pointmill_format::{DatasetKind, Located, locate};
pub use potree2::LevelQuality;

/// What to check, and with what means.
#[derive(Debug, Clone)]
pub struct Options {
    /// The scans that the dataset was made from, files only; empty: no comparison.
    pub against: Vec<PathBuf>,
    /// What text and E57 files do not say of themselves; as they were opened for the conversion.
    pub open: OpenOptions,
    /// Worker threads; 0: one for each core.
    pub threads: usize,
    /// What caches and the search for differing records may use, bytes. A guide, not a ceiling for the process.
    pub memory_bytes: u64,
    /// Problems listed for each check; all are counted.
    pub max_problems: usize,
    /// Check spacing and coverage and measure quality: the dearest part of a validation.
    pub neighbourhoods: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            against: Vec::new(),
            open: OpenOptions::default(),
            threads: 0,
            memory_bytes: 512 << 20,
            max_problems: 20,
            neighbourhoods: true,
        }
    }
}

/// How far a validation is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// `points` (of the dataset), `sources` (decoding the scans), `differences` (looking for what differs).
    pub phase: &'static str,
    /// Points done in this phase. Calls from several threads may overtake each other.
    pub done: u64,
    /// Points of the phase, as far as is known.
    pub total: u64,
}

/// Receives progress, from worker threads.
pub type ProgressFn<'a> = dyn Fn(Progress) + Sync + 'a;

/// What a validation found. Serialises to the object of `validate --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// No check found an error.
    pub ok: bool,
    /// Which format was found.
    pub format: DatasetKind,
    /// Encoding of the payloads or layout of the files, if the metadata could be read.
    pub encoding: Option<&'static str>,
    /// Points by the metadata.
    pub points: u64,
    /// Nodes that were reached from the root; batches.
    pub nodes: u64,
    /// One entry for each of [`Check::of`], in that order.
    pub checks: Vec<CheckResult>,
    /// Findings, by check, at most [`Options::max_problems`] each; errors before warnings, coarse or early places
    /// before others.
    pub problems: Vec<Finding>,
    /// One entry a level of an octree; empty for other formats.
    pub quality: Vec<LevelQuality>,
    /// Of a binary tree whose index could be read.
    pub leaves: Option<LeafQuality>,
    /// The comparison with the sources, if there was one.
    pub against: Option<AgainstSummary>,
}

impl Outcome {
    /// The account of a check; `None` if the format does not have it.
    pub fn check(&self, check: Check) -> Option<&CheckResult> {
        self.checks.iter().find(|c| c.name == check)
    }
}

/// Checks the dataset at `dataset`, whose format [`locate`] finds. Broken promises are findings, not errors.
///
/// `progress` is called from worker threads, often.
///
/// # Errors
/// There is no dataset, the operating system cannot read it, or a source to compare with cannot be opened or decoded
/// to its end.
pub fn validate(dataset: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let Located { kind, path } = locate(dataset)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .thread_name(|i| format!("validate-{i}"))
        .build()
        .map_err(|e| ReadError::io(dataset, "starting threads", std::io::Error::other(e)))?;
    pool.install(|| match kind {
        DatasetKind::Potree2 => potree2::run(&path, options, progress),
        DatasetKind::Bintree => bintree::run(&path, options, progress),
        DatasetKind::Batches => batches::run(&path, options, progress),
        other => Err(ReadError::unsupported(&path, format!("datasets of kind {other} cannot be validated"))),
    })
}
