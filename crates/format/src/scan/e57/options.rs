//! Options of the reader.

/// What to make of an E57 file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct E57Options {
    /// Keep `rowIndex` and `columnIndex`, the place of a point in the scanner's grid, as columns.
    pub keep_row_column: bool,
}

impl E57Options {
    /// Sets [`Self::keep_row_column`].
    #[must_use]
    pub fn keep_row_column(self, keep_row_column: bool) -> Self {
        Self { keep_row_column }
    }
}
