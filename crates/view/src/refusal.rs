//! Why a request is not answered with what it asks for.

use pointmill_format::ReadError;

/// A status and one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// 400, 403, 404, 405 or 500.
    pub(crate) status: u16,
    pub(crate) line: String,
}

impl Refusal {
    /// The request makes no sense.
    pub(crate) fn bad(line: impl Into<String>) -> Self {
        Self { status: 400, line: line.into() }
    }

    /// What is requested is not there.
    pub(crate) fn absent(line: impl Into<String>) -> Self {
        Self { status: 404, line: line.into() }
    }

    /// Something is broken on this side.
    pub(crate) fn broken(line: impl Into<String>) -> Self {
        Self { status: 500, line: line.into() }
    }
}

impl From<ReadError> for Refusal {
    fn from(error: ReadError) -> Self {
        Self::broken(error.to_string())
    }
}
