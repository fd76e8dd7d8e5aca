//! What is wrong, in which file, at which byte, and what to do about it.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Whose fault it is. The command line derives its exit code from this.
#[derive(Debug)]
pub enum ErrorKind {
    /// The bytes break the promises of their format: cut short, corrupt or hostile.
    Broken,
    /// The bytes may be fine but this version does not read them.
    Unsupported,
    /// The operating system could not read the file.
    Io(io::Error),
}

/// An input or dataset that could not be read.
///
/// Prints as one line: `path: what (byte N); advice`.
#[derive(Debug)]
pub struct ReadError {
    /// Whose fault it is.
    pub kind: ErrorKind,
    /// The file (or URL) that was read.
    pub path: PathBuf,
    /// Where in the file, in bytes from its start, if one place is to blame.
    pub offset: Option<u64>,
    /// What is wrong, with the values found and expected.
    pub what: String,
    /// What the user can do, or empty.
    pub advice: String,
}

impl ReadError {
    /// The file breaks a promise of its format.
    pub fn broken(path: impl AsRef<Path>, offset: impl Into<Option<u64>>, what: impl Into<String>) -> Self {
        Self::new(ErrorKind::Broken, path, offset.into(), what)
    }

    /// The file uses something that this version does not read.
    pub fn unsupported(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Self::new(ErrorKind::Unsupported, path, None, what)
    }

    /// The operating system refused; `doing` names the attempt ("reading the header").
    pub fn io(path: impl AsRef<Path>, doing: &str, error: io::Error) -> Self {
        let what = format!("{doing}: {error}");
        Self::new(ErrorKind::Io(error), path, None, what)
    }

    /// Adds what the user can do.
    #[must_use]
    pub fn advise(mut self, advice: impl Into<String>) -> Self {
        self.advice = advice.into();
        self
    }

    fn new(kind: ErrorKind, path: impl AsRef<Path>, offset: Option<u64>, what: impl Into<String>) -> Self {
        let what = one_line(what.into());
        Self { kind, path: path.as_ref().to_path_buf(), offset, what, advice: String::new() }
    }
}

/// Text for people that may quote a file: control characters become blanks, so that it stays one line and no terminal
/// obeys it.
fn one_line(text: String) -> String {
    if text.contains(char::is_control) { text.replace(char::is_control, " ") } else { text }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.what)?;
        if let Some(offset) = self.offset {
            write!(f, " (byte {offset})")?;
        }
        if !self.advice.is_empty() {
            write!(f, "; {}", self.advice)?;
        }
        Ok(())
    }
}

impl std::error::Error for ReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &self.kind {
            ErrorKind::Io(error) => Some(error),
            _ => None,
        }
    }
}

/// [`one_line`] for each warning of a scan.
#[cfg(any(feature = "e57", feature = "las", feature = "pcd", feature = "ply", feature = "text"))]
pub(crate) fn as_lines(warnings: Vec<String>) -> Vec<String> {
    warnings.into_iter().map(one_line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prints_what_where_and_what_to_do_on_one_line() {
        let e = ReadError::broken("a.las", 227, "3 of 10 records are there").advise("copy the file again");
        assert_eq!(e.to_string(), "a.las: 3 of 10 records are there (byte 227); copy the file again");
    }

    #[test]
    fn what_a_file_smuggles_in_stays_one_line() {
        let e = ReadError::broken("a.las", None, "the name \"a\r\nb\u{1b}[31m\" is odd");
        assert_eq!(e.to_string(), "a.las: the name \"a  b [31m\" is odd");
    }
}
