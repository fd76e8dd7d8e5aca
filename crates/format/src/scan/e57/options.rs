//! Options of the reader.

/// What to make of an E57 file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct E57Options {
    /// Keep `rowIndex` and `columnIndex`, the place of a point in the scanner's grid, as columns.
    pub keep_row_column: bool,
}
