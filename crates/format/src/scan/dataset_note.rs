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
    /// Positions are stored more coarsely than the lattice of the points: off by at most so much on each axis, world units.
    Inexact { most: [f64; 3] },
    /// Colours of points of coarse levels are means, and what they were is not in the file.
    ColoursAveraged,
    /// Colours have a fourth byte of different values, which is not read.
    AlphaIgnored,
}

impl fmt::Display for DatasetNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inexact { most: [x, y, z] } => write!(
                f,
                "its positions are up to {x:e}, {y:e}, {z:e} off in x, y, z: more than half a step of the points' own lattice"
            ),
            Self::ColoursAveraged => f.write_str(
                "the colours of points of its coarse levels are means of their cells; the file does not have their own colours",
            ),
            Self::AlphaIgnored => {
                f.write_str("its colours have a fourth byte that is not 255 everywhere; it is not read")
            }
            Self::PointsDiffer { declared, found } => {
                write!(f, "its description declares {declared} points; the {found} of its nodes are read")
            }
            Self::ProjectionUnknown { start } => {
                write!(f, "its projection is no proj4 definition, no code and no WKT, and is not used: {start:?}")
            }
        }
    }
}
