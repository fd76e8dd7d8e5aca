//! What a search for scans has found.

use std::path::PathBuf;

use crate::exit::Failure;
use crate::human::quantities::plural;

/// The scans to read, and notes about the search for them.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    /// Sorted by path, each file once.
    pub(crate) files: Vec<PathBuf>,
    /// Files that a folder or a glob brought along and that are no scans, in order of path.
    pub(crate) other_files: Vec<PathBuf>,
    /// Folders and links that could not be looked into, in order of path: scans may be there.
    pub(crate) unread: Vec<Unread>,
    /// One line each.
    pub(crate) notes: Vec<String>,
}

/// A place that could not be looked into.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Unread {
    pub(crate) path: PathBuf,
    /// What the operating system says.
    pub(crate) why: String,
}

impl Inputs {
    /// The notes, and a line for the other files: for commands that write no report.
    pub(crate) fn all_notes(&self) -> impl Iterator<Item = String> {
        let other = (!self.other_files.is_empty()).then(|| other_files(&self.other_files));
        self.notes.iter().cloned().chain(other)
    }

    /// A line for each place that could not be looked into: for commands that compare what is there.
    pub(crate) fn unread_notes(&self) -> impl Iterator<Item = String> {
        self.unread.iter().map(|Unread { path, why }| format!("{}: not searched for scans: {why}", path.display()))
    }

    /// A failure that names the first place that could not be looked into; `advice` says what helps.
    pub(crate) fn unread_failure(&self, advice: &str) -> Option<Failure> {
        let Unread { path, why } = self.unread.first()?;
        let more = match self.unread.len() - 1 {
            0 => String::new(),
            n => format!(" (and {} like it)", plural(n as u64, "place")),
        };
        Some(Failure::Io(format!("{}: searching for scans: {why}{more}{advice}", path.display())))
    }
}

/// Says which files were skipped.
pub(super) fn other_files(files: &[PathBuf]) -> String {
    pointmill_converter::Warning::OtherFiles { files: files.to_vec() }.to_string()
}
