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
    assert!(!is_for_programmers(&error.what()), "an error in words of a program: {line:?}");
}

/// True for what a derived `Debug` prints of types, and what serde calls them.
fn is_for_programmers(text: &str) -> bool {
    let has_fields = |(at, _): (usize, &str)| {
        let word = text[..at].rsplit(|c: char| !c.is_ascii_alphanumeric()).next().unwrap_or_default();
        word.starts_with(|c: char| c.is_ascii_uppercase())
    };
    text.match_indices(" { ").any(has_fields) || ["expected struct ", "Some(", "Err("].iter().any(|w| text.contains(w))
}

/// [`check_error`], and that the error of a broken scan names what to do and the byte; a folder has none, nor has a file that is
/// missing.
///
/// # Panics
/// If it does not.
pub fn check_scan_error(error: &ReadError) {
    check_error(error);
    if matches!(error.kind(), ErrorKind::Broken) {
        assert!(error.offset().is_some() || !error.path().is_file(), "an error without its byte: {error}");
        assert!(error.advice().is_some(), "an error without advice: {error}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_programs_are_known() {
        for text in ["the chunk Chunk { bytes: 5 } is odd", "expected struct Sidecar", "it is Some(5)"] {
            assert!(is_for_programmers(text), "{text}");
        }
        for text in ["an array [1.0, 2.0]", "the text \"a { b\" is odd", "fx is \"1\", not a number"] {
            assert!(!is_for_programmers(text), "{text}");
        }
    }
}
