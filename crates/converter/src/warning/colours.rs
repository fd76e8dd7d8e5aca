//! What becomes of colours in formats that have 8 bits for them.

use std::fmt;

/// What becomes of colours in a format that has 8 bits for them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ColourNote {
    /// Colours of 16 bits are stored in 8.
    Narrowed,
    /// Some inputs have no colour and are black.
    Black {
        /// How many.
        without: usize,
        /// Of how many inputs.
        inputs: usize,
    },
    /// No input has colour; grey shows the intensity.
    Grey {
        /// The intensity shown as black.
        least: f64,
        /// The intensity shown as white.
        greatest: f64,
    },
    /// No input has colour or intensity.
    White,
}

impl ColourNote {
    /// A short name for programs.
    pub(super) const fn kind(&self) -> &'static str {
        match self {
            Self::Narrowed => "colours_narrowed",
            Self::Black { .. } => "inputs_without_colour",
            Self::Grey { .. } => "grey_intensity",
            Self::White => "no_colour",
        }
    }
}

impl fmt::Display for ColourNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Narrowed => f.write_str("colours of 16 bits are stored in 8"),
            Self::Black { without, inputs } => write!(f, "{without} of {inputs} inputs have no colour and are black"),
            Self::Grey { least, greatest } => {
                write!(f, "no input has colour; grey shows the intensity, {least} to {greatest}")
            }
            Self::White => f.write_str("no input has colour or intensity; all points are white"),
        }
    }
}
