//! Checks that a dataset conforms to its format, and that it holds every point of its sources exactly once.
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
//! The crate shares the readers of `pointmill-format` and computes every expected value itself, from
//! the page of the format in `docs/formats`: boxes, spacing, order, checksums. That repetition is deliberate. It never
//! sees the converter.

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]
#![forbid(unsafe_code)]

mod accuracy;
mod against;
mod batches;
mod bintree;
mod check;
mod copc;
mod finding;
mod memory;
mod octree;
mod options;
mod outcome;
mod place;
mod potree1;
mod potree2;
mod report;
mod surfels;

use std::path::Path;

use pointmill_format::ReadError;

pub use accuracy::{Accuracy, Integers, Merged, PositionErrors};
pub use check::Check;
pub use finding::{CheckResult, Finding, Severity};
pub use options::{Options, Progress, ProgressFn};
pub use outcome::{AgainstSummary, FirstView, LeafQuality, LevelQuality, Outcome, SurfelSummary};
pub use place::{BinaryNode, Place};
pub use pointmill_format::{DatasetKind, Located, locate};
pub use report::{Several, several};

/// Checks the dataset at `dataset`, whose format [`locate`] finds. What does not conform is a finding, not an error.
///
/// `progress` is called from worker threads, often.
///
/// # Errors
/// There is no dataset, the operating system cannot read it, or a source to compare with cannot be opened or decoded
/// to its end.
pub fn validate(dataset: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let Located { kind, path, .. } = locate(dataset)?;
    memory::pool(options.threads, dataset)?.install(|| match kind {
        DatasetKind::Potree2 => potree2::run(&path, options, progress),
        DatasetKind::Potree1 => potree1::run(&path, options, progress),
        DatasetKind::Bintree => bintree::run(&path, options, progress),
        DatasetKind::Batches => batches::run(&path, options, progress),
        DatasetKind::Copc => copc::run(&path, options, progress),
        other => Err(ReadError::unsupported(&path, format!("datasets of kind {other} cannot be validated"))),
    })
}
