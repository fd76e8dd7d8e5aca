//! What every error of a reader promises.

use pointmill_format::{ErrorKind, ReadError};

/// Checks that an error is one line for people.
///
/// # Panics
/// If it is not.
pub fn check_error(error: &ReadError) {
    let line = error.to_string();
    assert!(!line.contains(['\n', '\r']), "an error is not one line: {line:?}");
    assert!(!error.what().is_empty(), "an error without a word: {line:?}");
}

/// [`check_error`], and that the error of a broken scan names what to do and the byte; a file that is missing (of a
/// dataset) has none.
///
/// # Panics
/// If it does not.
pub fn check_scan_error(error: &ReadError) {
    check_error(error);
    if matches!(error.kind(), ErrorKind::Broken) {
        assert!(error.offset().is_some() || !error.path().exists(), "an error without its byte: {error}");
        assert!(error.advice().is_some(), "an error without advice: {error}");
    }
}
