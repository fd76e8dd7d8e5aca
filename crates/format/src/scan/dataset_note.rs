//! What a dataset, read as a scan, does not say or have.

use std::fmt;

/// What a dataset, read as a scan, does not say or have. Prints as one line.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs)] // the names and the lines say what the values are
pub enum DatasetNote {
    /// The description counts other points than the nodes have, which are all read.
    PointsDiffer { declared: u64, found: u64 },
    /// The projection is neither a proj4 definition nor a code nor WKT; its start.
    ProjectionUnknown { start: String },
}

impl fmt::Display for DatasetNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PointsDiffer { declared, found } => {
                write!(f, "its description declares {declared} points; the {found} of its nodes are read")
            }
            Self::ProjectionUnknown { start } => {
                write!(f, "its projection is no proj4 definition, no code and no WKT, and is not used: {start:?}")
            }
        }
    }
}
