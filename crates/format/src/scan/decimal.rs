//! The decimal mark of text.

use std::fmt;
use std::str::FromStr;

use crate::UnknownName;

/// What stands before the decimals of a number.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Decimal {
    /// Found by a sample of the rows; an error where it cannot be told.
    #[default]
    Auto,
    /// A point: commas separate columns.
    Point,
    /// A comma.
    Comma,
}

impl Decimal {
    /// All of them.
    pub const ALL: &[Self] = &[Self::Auto, Self::Point, Self::Comma];

    /// "auto", "point", "comma".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Point => "point",
            Self::Comma => "comma",
        }
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Decimal {
    type Err = UnknownName;

    /// [`Self::name`], in upper or lower case.
    fn from_str(name: &str) -> Result<Self, UnknownName> {
        Self::ALL.iter().copied().find(|d| d.name().eq_ignore_ascii_case(name)).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(|d| d.name()).collect();
            UnknownName::new(name, "decimal mark", &known)
        })
    }
}
