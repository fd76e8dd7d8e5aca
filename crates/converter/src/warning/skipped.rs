//! Errors of what was skipped.

use std::path::PathBuf;

use pointmill_format::ReadError;
use serde::{Deserialize, Serialize};

use super::Warning;

/// The line of an error of something that was skipped: without the advice to skip it.
pub(crate) fn reason_of(error: &ReadError) -> String {
    match error.advice() {
        Some(pointmill_format::Advice::SkipUnreadable) | None => error.what_and_where(),
        Some(_) => error.to_string(),
    }
}

/// Points that cannot be decoded and were skipped.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct SkippedPoints {
    pub(crate) path: PathBuf,
    /// Why, with path and byte.
    pub(crate) error: String,
    /// How many, by the declared counts.
    pub(crate) points: u64,
}

impl From<SkippedPoints> for Warning {
    fn from(SkippedPoints { path, error, points }: SkippedPoints) -> Self {
        Self::PointsSkipped { points, path, error }
    }
}
