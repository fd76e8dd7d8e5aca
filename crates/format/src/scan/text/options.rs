//! Options of the reader.

use crate::Decimal;

/// What the file does not say of itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TextOptions {
    /// Names of all columns in file order: `x`, `y`, `z`, `r`, `g`, `b`, `i` (intensity), `c` (classification), `nx`,
    /// `ny`, `nz`; `-` is omitted; any other becomes an attribute of that name. A type may follow a colon
    /// (`quality:uint8`). `None`: found by the rules above. Ignored in PTX, OFF and OBJ files.
    pub columns: Option<Vec<String>>,
    /// Between two fields; `None`: found. A blank means any blanks.
    pub separator: Option<char>,
    /// Before the decimals of a number. Ignored in PTX, OFF and OBJ files, which have points.
    pub decimal: Decimal,
}

impl TextOptions {
    /// Sets [`Self::columns`].
    #[must_use]
    pub fn columns<N: Into<String>>(mut self, names: impl IntoIterator<Item = N>) -> Self {
        self.columns = Some(names.into_iter().map(Into::into).collect());
        self
    }

    /// Sets [`Self::separator`].
    #[must_use]
    pub fn separator(mut self, separator: char) -> Self {
        self.separator = Some(separator);
        self
    }

    /// Sets [`Self::decimal`].
    #[must_use]
    pub fn decimal(mut self, decimal: Decimal) -> Self {
        self.decimal = decimal;
        self
    }
}
