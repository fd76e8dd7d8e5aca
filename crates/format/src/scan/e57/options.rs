//! Options of the reader.

/// The XML section may take so many bytes if nobody says otherwise: 1 GiB, some 200,000 scans.
const MAX_XML: u64 = 1 << 30;

/// What to make of an E57 file.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct E57Options {
    /// Keep `rowIndex` and `columnIndex`, the place of a point in the scanner's grid, as columns.
    pub keep_row_column: bool,
    /// Read these scans alone, by name or number ([`crate::scans_named`]); `None`: all.
    pub scans: Option<Vec<String>>,
    /// Bytes of the XML section that are read at most: they are held in memory while the file is opened.
    pub max_xml: u64,
}

impl Default for E57Options {
    fn default() -> Self {
        Self { keep_row_column: false, scans: None, max_xml: MAX_XML }
    }
}

impl E57Options {
    /// Sets [`Self::keep_row_column`].
    #[must_use]
    pub fn keep_row_column(self, keep_row_column: bool) -> Self {
        Self { keep_row_column, ..self }
    }

    /// Sets [`Self::scans`].
    #[must_use]
    pub fn scans(self, scans: Option<Vec<String>>) -> Self {
        Self { scans, ..self }
    }

    /// Sets [`Self::max_xml`].
    #[must_use]
    pub fn max_xml(self, bytes: u64) -> Self {
        Self { max_xml: bytes, ..self }
    }
}
