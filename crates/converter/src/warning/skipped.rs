//! Errors of what was skipped.

use pointmill_format::ReadError;

/// The line of an error of something that was skipped: without the advice to skip it.
pub(crate) fn reason_of(error: &ReadError) -> String {
    match error.advice() {
        Some(pointmill_format::Advice::SkipUnreadable) | None => error.what_and_where(),
        Some(_) => error.to_string(),
    }
}
