//! What can be asked of an export.

use std::fmt;
use std::path::Path;

/// A format of files of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExportFormat {
    /// LAS 1.2 or 1.4.
    Las,
    /// The same, compressed.
    Laz,
    /// PLY, binary, little-endian.
    Ply,
    /// Text, one line a point.
    Csv,
}

impl ExportFormat {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Las, Self::Laz, Self::Ply, Self::Csv];

    /// The ending of the names of its files, without the dot.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Las => "las",
            Self::Laz => "laz",
            Self::Ply => "ply",
            Self::Csv => "csv",
        }
    }

    /// The format that the ending of a name asks for.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?;
        Self::ALL.into_iter().find(|format| ending.eq_ignore_ascii_case(format.extension()))
    }

    /// True for integers on a lattice, false for world coordinates.
    pub(crate) const fn has_lattice(self) -> bool {
        matches!(self, Self::Las | Self::Laz)
    }
}

impl fmt::Display for ExportFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Las => "LAS",
            Self::Laz => "LAZ",
            Self::Ply => "PLY",
            Self::Csv => "CSV",
        })
    }
}
