//! Why a dataset cannot be written as requested.

use std::io;

/// A request that the format cannot fulfil, or a disk that did not.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the values are
pub enum WriteError {
    #[error("{0} points are more than one file holds (4294967295); divide the cloud")]
    TooManyPoints(u64),
    #[error("the cell of level 0 is {0}; it has to be a finite number greater than 0")]
    Cell(f64),
    #[error(
        "a cell of {cell} is too small: the points reach {extent} beyond the whole unit below them, and the order 2^30 cells; take one of {least} or more"
    )]
    CellTooSmall { cell: f64, extent: f64, least: f64 },
    #[error("the points span {0:?} to {1:?}, which float32 boxes cannot hold; leave out the points that are far away")]
    Extent([f64; 3], [f64; 3]),
    #[error("{0}")]
    Input(String),
    #[error("compressing: {0}")]
    Compress(String),
    #[error("stopped by request")]
    Stopped,
    #[error("writing: {0}")]
    Io(#[from] io::Error),
}

impl From<WriteError> for io::Error {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Io(error) => error,
            other => Self::new(io::ErrorKind::InvalidInput, other),
        }
    }
}

impl WriteError {
    pub(crate) fn input(what: impl Into<String>) -> Self {
        Self::Input(what.into())
    }
}
