//! What is wrong, in which file, at which byte, and what to do about it.

mod advice;
mod fault;

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

pub use advice::Advice;
pub use fault::Fault;

/// Whose fault it is: there are these three, and no others will come.
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
/// Prints as one line: `path: what (byte N); advice`. Programs match on [`Self::kind`], [`Self::fault`] and
/// [`Self::advice`]:
///
/// ```
/// use pointmill_format::{Fault, OpenOptions, open_scan};
///
/// let file = std::env::temp_dir().join(format!("pointmill-empty-{}.laz", std::process::id()));
/// std::fs::write(&file, b"")?;
/// let error = open_scan(&file, &OpenOptions::default()).err().ok_or("an empty file is no scan")?;
/// assert_eq!(error.fault(), &Fault::Empty);
/// assert_eq!((error.path(), error.offset()), (file.as_path(), Some(0)));
/// # std::fs::remove_file(file)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ReadError(Box<Inner>);

#[derive(Debug)]
struct Inner {
    kind: ErrorKind,
    path: PathBuf,
    offset: Option<u64>,
    fault: Fault,
    advice: Option<Advice>,
}

impl ReadError {
    /// The file breaks a promise of its format.
    pub fn broken(path: impl AsRef<Path>, offset: impl Into<Option<u64>>, fault: impl Into<Fault>) -> Self {
        Self::new(ErrorKind::Broken, path, offset.into(), fault)
    }

    /// The file uses something that this version does not read.
    pub fn unsupported(path: impl AsRef<Path>, fault: impl Into<Fault>) -> Self {
        Self::new(ErrorKind::Unsupported, path, None, fault)
    }

    /// The operating system refused; `doing` names the attempt ("reading the header").
    pub fn io(path: impl AsRef<Path>, doing: &str, error: io::Error) -> Self {
        Self::new(ErrorKind::Io(error), path, None, Fault::System { doing: doing.to_owned() })
    }

    /// Adds what the user can do, in place of what was there.
    #[must_use]
    pub fn advise(mut self, advice: impl Into<Advice>) -> Self {
        self.0.advice = Some(advice.into());
        self
    }

    /// What would take more memory than there is, or than is allowed.
    pub(crate) fn memory(path: impl AsRef<Path>, what: impl Into<Fault>) -> Self {
        Self::unsupported(path, what).advise(Advice::MoreMemory)
    }

    /// Adds the place in the file, in bytes from its start.
    #[must_use]
    pub fn at(mut self, offset: u64) -> Self {
        self.0.offset = Some(offset);
        self
    }

    fn new(kind: ErrorKind, path: impl AsRef<Path>, offset: Option<u64>, fault: impl Into<Fault>) -> Self {
        let path = path.as_ref().to_path_buf();
        Self(Box::new(Inner { kind, path, offset, fault: fault.into(), advice: None }))
    }

    /// Whose fault it is.
    pub fn kind(&self) -> &ErrorKind {
        &self.0.kind
    }

    /// [`Self::kind`], by value: the error of the operating system can be taken out.
    #[must_use]
    pub fn into_kind(self) -> ErrorKind {
        self.0.kind
    }

    /// True if the operating system could not read the file.
    pub fn is_io(&self) -> bool {
        matches!(self.0.kind, ErrorKind::Io(_))
    }

    /// The file (or URL) that was read.
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// Where in the file, in bytes from its start, if one place is to blame.
    pub fn offset(&self) -> Option<u64> {
        self.0.offset
    }

    /// What is wrong.
    pub fn fault(&self) -> &Fault {
        &self.0.fault
    }

    /// What the user can do.
    pub fn advice(&self) -> Option<&Advice> {
        self.0.advice.as_ref()
    }

    /// What is wrong, on one line: without path, byte and advice.
    pub fn what(&self) -> String {
        one_line(match &self.0.kind {
            ErrorKind::Io(error) => format!("{}: {}", self.0.fault, system_reason(error)),
            _ => self.0.fault.to_string(),
        })
    }

    /// The line without the advice: `path: what (byte N)`.
    pub fn what_and_where(&self) -> String {
        let place = self.0.offset.map_or_else(String::new, |at| format!(" (byte {at})"));
        format!("{}: {}{place}", self.0.path.display(), self.what())
    }
}

/// What the operating system says, for people: without its number, which is for programmers.
///
/// ```
/// let error = std::io::Error::from_raw_os_error(2);
/// assert!(!pointmill_format::system_reason(&error).contains("os error"));
/// ```
#[must_use]
pub fn system_reason(error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::UnexpectedEof && error.raw_os_error().is_none() {
        return "the file ends before".to_owned();
    }
    let text = error.to_string();
    match text.rsplit_once(" (os error ") {
        Some((reason, number)) if number.ends_with(')') => reason.to_owned(),
        _ => text,
    }
}

/// Why a text is not the JSON that it should be, for people: without the place, which is said as a byte, and without the
/// types of a program.
pub(crate) fn json_reason(error: &serde_json::Error) -> String {
    /// What the parser expects, by the types of a program.
    const TYPES: [(&str, &str); 6] = [
        ("f", "a number"),
        ("u", "a whole number, at least 0"),
        ("i", "a whole number"),
        ("struct ", "an object"),
        ("a map", "an object"),
        ("a sequence", "an array"),
    ];
    const WORDS: [(&str, &str); 9] = [
        ("EOF while parsing", "it ends within"),
        ("expected value", "a value is expected"),
        ("expected ident", "a word that is none of true, false and null"),
        ("trailing characters", "something follows its end"),
        ("trailing comma", "a comma that nothing follows"),
        ("recursion limit exceeded", "it is nested too deeply"),
        ("invalid type: map,", "an object,"),
        ("invalid type: sequence,", "an array,"),
        ("invalid type: ", ""),
    ];
    let text = error.to_string();
    let reason = text.rsplit_once(" at line ").map_or(text.as_str(), |(reason, _)| reason);
    let reason = WORDS.iter().fold(reason.to_owned(), |reason, (theirs, plain)| reason.replace(theirs, plain));
    let reason = match reason.rsplit_once(", expected ") {
        None => reason,
        Some((found, expected)) => {
            let is_number = |word: &str| matches!(word.get(1..), Some("8" | "16" | "32" | "64" | "size"));
            let is_of = |start: &str| match start.len() {
                1 => expected.starts_with(start) && is_number(expected),
                _ => expected.starts_with(start),
            };
            let plain = TYPES.iter().find(|(start, _)| is_of(start)).map_or(expected, |(_, plain)| plain);
            format!("{found}, expected {plain}")
        }
    };
    reason.replace('`', "\"")
}

/// Why a text is not the JSON that it should be, in words for people, and where.
///
/// ```
/// let error = pointmill_format::serde_json::from_str::<Vec<f64>>("[1, {}]").unwrap_err();
/// assert_eq!(pointmill_format::json_fault(&error), "an object, expected a number (line 1, column 4)");
/// ```
#[must_use]
pub fn json_fault(error: &serde_json::Error) -> String {
    format!("{} (line {}, column {})", json_reason(error), error.line(), error.column())
}

/// Text for people that may quote a file: control characters become blanks, so that it stays one line and no terminal
/// obeys it.
pub(crate) fn one_line(text: String) -> String {
    if text.contains(char::is_control) { text.replace(char::is_control, " ") } else { text }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what_and_where())?;
        match self.advice() {
            Some(advice) => write!(f, "; {advice}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for ReadError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &self.0.kind {
            ErrorKind::Io(error) => Some(error),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prints_what_where_and_what_to_do_on_one_line() {
        let e = ReadError::broken("a.las", 227, "3 of 10 records are there").advise("copy the file again");
        assert_eq!(e.to_string(), "a.las: 3 of 10 records are there (byte 227); copy the file again");
        assert_eq!(e.what_and_where(), "a.las: 3 of 10 records are there (byte 227)");
        let e = ReadError::io("a.las", "opening", io::Error::other("no")).advise(Advice::CutShort);
        assert_eq!(e.to_string(), "a.las: opening: no; it was cut short; copy or export it again");
    }

    #[cfg(unix)]
    #[test]
    fn numbers_of_the_system_are_not_printed() {
        let e = ReadError::io("a.las", "opening", io::Error::from_raw_os_error(2));
        assert_eq!(e.to_string(), "a.las: opening: No such file or directory");
        assert_eq!(system_reason(&io::ErrorKind::UnexpectedEof.into()), "the file ends before");
    }

    #[test]
    fn json_is_explained_in_plain_words() {
        let of = |text: &str| json_reason(&serde_json::from_str::<Vec<f64>>(text).unwrap_err());
        assert_eq!(of("[1, \"x\"]"), "string \"x\", expected a number");
        assert_eq!(of("[1,"), "it ends within a value");
        assert_eq!(of("{}"), "an object, expected an array");
        assert_eq!(of("[1, [2]]"), "an array, expected a number");
        assert_eq!(of("[1, x]"), "a value is expected");
        assert_eq!(of("[1] 2"), "something follows its end");
        #[derive(Debug, serde::Deserialize)]
        struct Inner {
            _whole: u16,
            _object: Option<Box<Self>>,
        }
        let of = |text: &str| json_reason(&serde_json::from_str::<Inner>(text).unwrap_err());
        assert_eq!(of("[]"), "invalid length 0, expected an object");
        assert_eq!(of("7"), "integer \"7\", expected an object");
        assert_eq!(of("{\"_whole\": -1}"), "invalid value: integer \"-1\", expected a whole number, at least 0");
        assert_eq!(of("{}"), "missing field \"_whole\"");
    }

    #[test]
    fn what_a_file_smuggles_in_stays_one_line() {
        let e = ReadError::broken("a.las", None, "the name \"a\r\nb\u{1b}[31m\" is odd");
        assert_eq!(e.to_string(), "a.las: the name \"a  b [31m\" is odd");
    }
}
