//! What is wrong, as data.

use std::fmt;

/// What is wrong with an input, with the values found and expected. Prints as a part of the line of
/// [`crate::ReadError`].
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// The file has no bytes.
    Empty,
    /// The content is of no kind that this build reads.
    UnknownFormat {
        /// The extension of the file, if it is one that scans have: the file is damaged, or misnamed.
        extension: Option<String>,
    },
    /// An archive or a compressed file: a scan may be in it.
    Archive {
        /// "a gzip file", "a ZIP archive", ….
        what: &'static str,
    },
    /// The file is something else, not a scan: "an Arc/Info ASCII grid, a raster".
    OtherKind(String),
    /// The format is known, this version of it is not.
    UnknownVersion {
        /// "LAS", "E57", ….
        format: &'static str,
        /// Major and minor number in the file.
        found: (u32, u32),
        /// The versions that are read: "1.0 to 1.5 are".
        known: &'static str,
    },
    /// Bytes are expected that the file does not hold.
    CutShort {
        /// Bytes that are expected.
        needed: u64,
        /// Bytes that are there.
        available: u64,
    },
    /// A header points outside the file.
    OutsideFile {
        /// "the points", "the XML section", ….
        part: &'static str,
        /// First byte, as declared.
        offset: u64,
        /// Bytes, as declared, where that is known.
        bytes: Option<u64>,
        /// Bytes of the file.
        file_bytes: u64,
    },
    /// Fewer points than declared.
    PointsMissing {
        /// By the header.
        declared: u64,
        /// By the structures of the file.
        found: u64,
    },
    /// A header (or a description in XML) that makes no sense.
    Header(String),
    /// Nothing says where the points are: x or y is missing.
    NoPositions(String),
    /// A row of a text or of a table does not fit its columns.
    Row(String),
    /// A page does not match its checksum.
    Checksum {
        /// Number of the page in the file, from 0.
        page: u64,
    },
    /// A piece of compressed points does not decode to its end.
    Decode {
        /// Number of the piece, from 0.
        piece: usize,
        /// Pieces of the scan.
        pieces: usize,
        /// Bytes of the piece.
        bytes: u64,
        /// Points that were handed over before.
        decoded: u64,
        /// Points of the piece.
        points: u64,
        /// What the decoder says.
        why: String,
    },
    /// A request for a piece that the scan does not have.
    NoSuchPiece {
        /// The number requested, from 0.
        piece: usize,
        /// Pieces of the scan.
        pieces: usize,
    },
    /// The operating system refused; the cause is [`crate::ErrorKind::Io`].
    System {
        /// The attempt: "opening", "reading the header", ….
        doing: String,
    },
    /// Anything else, as text.
    Other(String),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("the file is empty"),
            Self::UnknownFormat { extension: None } => f.write_str("this is no scan that is known here"),
            Self::UnknownFormat { extension: Some(extension) } => {
                write!(f, "called .{extension}, but it is no scan that is known here")
            }
            Self::Archive { what } => write!(f, "this is {what}, not a scan"),
            Self::OtherKind(what) => write!(f, "this is {what}, not a scan"),
            Self::UnknownVersion { format, found: (major, minor), known } => {
                write!(f, "{format} version {major}.{minor} is not known ({known})")
            }
            Self::CutShort { needed, .. } => write!(f, "{needed} bytes expected, the file ends before"),
            Self::OutsideFile { part, offset, bytes: Some(bytes), file_bytes } => {
                write!(f, "{part} should be {bytes} bytes at byte {offset}; the file has {file_bytes}")
            }
            Self::OutsideFile { part, offset, bytes: None, file_bytes } => {
                write!(f, "{part} start at byte {offset} but the file has {file_bytes}")
            }
            Self::PointsMissing { declared, found } => {
                write!(f, "the header declares {declared} points, the file holds {found}")
            }
            Self::Checksum { page } => write!(f, "page {page} does not match its checksum"),
            Self::Decode { piece, pieces, bytes, decoded, points, why } => {
                let number = piece.saturating_add(1);
                write!(f, "chunk {number} of {pieces} ({bytes} bytes) gives {decoded} of its {points} points: {why}")
            }
            Self::NoSuchPiece { piece, pieces } => write!(f, "there is no piece {piece} (there are {pieces})"),
            Self::System { doing: text }
            | Self::Header(text)
            | Self::NoPositions(text)
            | Self::Row(text)
            | Self::Other(text) => f.write_str(text),
        }
    }
}

impl From<String> for Fault {
    fn from(text: String) -> Self {
        Self::Other(text)
    }
}

impl From<&str> for Fault {
    fn from(text: &str) -> Self {
        Self::Other(text.to_owned())
    }
}
