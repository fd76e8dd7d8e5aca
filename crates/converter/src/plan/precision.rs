//! How exact positions must be, as it is requested.

use std::fmt;

/// The largest error that a coordinate of a written point may have against its scan, on each axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionPrecision {
    /// How many of the unit, > 0.
    pub length: f64,
    /// Its unit.
    pub unit: LengthUnit,
}

/// A unit in which a precision is requested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LengthUnit {
    /// That of the coordinates, whatever it is, on each axis.
    Coordinates,
    /// 10⁻⁶ m.
    Micrometre,
    /// 0.001 m.
    Millimetre,
    /// 0.01 m.
    Centimetre,
    /// 1 m.
    Metre,
    /// 1000 m.
    Kilometre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The foot of surveys in the United States, 1200/3937 m.
    UsSurveyFoot,
}

impl LengthUnit {
    /// All that have a name.
    pub const NAMED: [Self; 7] = [
        Self::Micrometre,
        Self::Millimetre,
        Self::Centimetre,
        Self::Metre,
        Self::Kilometre,
        Self::Foot,
        Self::UsSurveyFoot,
    ];

    /// Its length; `None` for that of the coordinates.
    pub const fn metres(self) -> Option<f64> {
        match self {
            Self::Coordinates => None,
            Self::Micrometre => Some(1e-6),
            Self::Millimetre => Some(0.001),
            Self::Centimetre => Some(0.01),
            Self::Metre => Some(1.0),
            Self::Kilometre => Some(1000.0),
            Self::Foot => Some(0.3048),
            Self::UsSurveyFoot => Some(1200.0 / 3937.0),
        }
    }

    /// The usual abbreviation; nothing for that of the coordinates.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Coordinates => "",
            Self::Micrometre => "um",
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Metre => "m",
            Self::Kilometre => "km",
            Self::Foot => "ft",
            Self::UsSurveyFoot => "us-ft",
        }
    }
}

impl fmt::Display for PositionPrecision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.length, self.unit.name())
    }
}
