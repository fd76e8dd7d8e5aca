//! What a run would choose, as far as headers and settings tell.

use std::fmt;

use serde::{Serialize, Serializer};

/// A setting of an output, what it would be, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PlannedChoice {
    /// The format; nothing for what all outputs share.
    pub output: String,
    /// The setting, in words.
    pub setting: String,
    /// Its value; nothing where only the points tell it.
    pub value: Option<String>,
    /// Why.
    pub why: ChoiceReason,
}

/// Why a setting has its value, or what it will be chosen by. Serialises to its text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ChoiceReason {
    /// The plan.
    Requested,
    /// The value that is taken unless another is requested.
    Default,
    /// The points that the root of an octree should have.
    RootPoints,
    /// The points that a cell of the coarsest level of detail should have.
    CellPoints,
    /// The step of the lattice: planes below it hold nothing.
    Step,
    /// The requested precision.
    Precision,
    /// The values that attributes turn out to have.
    Values,
}

impl PlannedChoice {
    /// As requested, else to be chosen by the points.
    pub(crate) fn or_chosen(setting: &str, requested: Option<impl fmt::Display>, by: ChoiceReason) -> Self {
        let value = requested.map(|value| value.to_string());
        let why = if value.is_some() { ChoiceReason::Requested } else { by };
        Self { output: String::new(), setting: setting.to_owned(), value, why }
    }

    /// A value that has a default.
    pub(crate) fn or_default<T: fmt::Display + PartialEq + Copy>(setting: &str, value: T, default: T) -> Self {
        let why = if value == default { ChoiceReason::Default } else { ChoiceReason::Requested };
        Self { output: String::new(), setting: setting.to_owned(), value: Some(value.to_string()), why }
    }
}

impl fmt::Display for ChoiceReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Requested => "as requested",
            Self::Default => "the default",
            Self::RootPoints => "so that the root has about 20,000 points",
            Self::CellPoints => "the power of two with about 64 points in each occupied cell",
            Self::Step => "as many as the step needs in the largest batch",
            Self::Precision => "the fewest that keep the requested precision in every batch",
            Self::Values => "those that are not constant and follow from no other",
        })
    }
}

impl Serialize for ChoiceReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
