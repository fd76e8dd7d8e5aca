//! What the user can do about an error, as data.

use std::fmt;

/// What the user can do. A program that has options matches on it and names them; others print it.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Advice {
    /// The file ends early: a copy or an export did not finish.
    CutShort,
    /// The bytes are not what was written.
    Damaged,
    /// The program that wrote the file did not do it right.
    ExportAgain,
    /// The file lacks coordinates.
    ExportPositions,
    /// The file is none of the kind that it was opened as.
    WrongFile,
    /// A number does not fit its column.
    CheckColumns,
    /// A value is beyond what the sampled rows of a column showed: its type can be named with the columns.
    WidenColumn,
    /// Rows of two numbers: cut short, or x and y alone, which [`crate::OpenOptions::columns`] can say.
    NameColumns,
    /// A separator that no row has: it can be detected, or another one named.
    DetectSeparator,
    /// An archive: the scans are in it.
    Unpack,
    /// A comma that may be a decimal mark or a separator, which [`crate::OpenOptions::decimal`] can say.
    DecimalMark,
    /// The kinds of scans that this build reads ([`crate::supported_scans`]).
    Supported(String),
    /// Cut short or damaged, or of another kind than those that this build reads.
    CopyOrSupported(String),
    /// It takes more memory than there is or than it may take ([`crate::OpenOptions::description_bytes`],
    /// [`crate::potree2::Dataset::set_max_node_bytes`]).
    MoreMemory,
    /// The camera of a depth map can be named ([`crate::OpenOptions::depth`]), in place of what its files say.
    NameCamera,
    /// The coordinate reference system of the scan can be named, in place of what the file declares.
    NameCrs,
    /// Choose another coordinate reference system to reproject to, on the same datum, or reproject with other means.
    OtherCrs,
    /// A conversion can skip what cannot be read and go on with the rest.
    SkipUnreadable,
    /// Anything else, as text.
    Other(String),
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CutShort => f.write_str("it was cut short; copy or export it again"),
            Self::Damaged => f.write_str("it is damaged; copy or export it again"),
            Self::ExportAgain => f.write_str("export it again from its source"),
            Self::WrongFile => f.write_str("see which file was meant"),
            Self::ExportPositions => f.write_str("export it with x, y and z"),
            Self::CheckColumns => f.write_str(
                "the file is damaged, or its columns are not what they are called; correct it or export it again",
            ),
            Self::WidenColumn => f.write_str(
                "the rows that were sampled hold none like it; name the columns, this one with a wider type",
            ),
            Self::NameColumns => {
                f.write_str("if it was cut short, copy it again; if its columns are x,y alone, name them")
            }
            Self::DetectSeparator => f.write_str("name the one that the rows have, or none to have it detected"),
            Self::Unpack => f.write_str("unpack it and name the scans in it"),
            Self::DecimalMark => f.write_str("say whether commas are decimal marks"),
            Self::Supported(kinds) if kinds.is_empty() => f.write_str("this build reads no scans; enable a feature"),
            Self::Supported(kinds) => write!(f, "supported are {kinds}"),
            Self::CopyOrSupported(kinds) => {
                write!(f, "if it was cut short or damaged, copy it again; supported are {kinds}")
            }
            Self::MoreMemory => f.write_str("let it take more memory"),
            Self::NameCamera => f.write_str(
                "describe the camera in a JSON file beside it, or name its intrinsics and the units of depth in a metre",
            ),
            Self::NameCrs => f.write_str("name its coordinate reference system"),
            Self::OtherCrs => f.write_str(
                "reproject to a system on the same datum and with the same heights, or reproject it elsewhere",
            ),
            Self::SkipUnreadable => f.write_str("copy the file again, or skip what cannot be read"),
            Self::Other(text) => f.write_str(text),
        }
    }
}

impl From<String> for Advice {
    fn from(text: String) -> Self {
        Self::Other(text)
    }
}

impl From<&str> for Advice {
    fn from(text: &str) -> Self {
        Self::Other(text.to_owned())
    }
}
