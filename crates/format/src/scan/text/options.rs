//! Options of the reader.

/// What the file does not say of itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TextOptions {
    /// Names of all columns in file order: `x`, `y`, `z`, `r`, `g`, `b`, `i` (intensity), `c` (classification), `nx`,
    /// `ny`, `nz`; `-` is left out; any other becomes an attribute of that name. A type may follow a colon
    /// (`quality:uint8`). `None`: found by the rules above. Ignored in PTX and OFF files.
    pub columns: Option<Vec<String>>,
    /// Between two fields; `None`: found. A blank means any blanks.
    pub separator: Option<char>,
}
