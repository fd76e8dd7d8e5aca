//! What viewers of octrees make of a dataset, or what was done so that they show it (docs/formats/potree2.md, "What
//! clients stumble over").

use std::fmt;

use serde::Serialize;

use super::numbers::grouped;
use crate::advice::Advice;

/// What viewers of octrees make of a dataset, or what was done so that they show it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum ViewerNote {
    /// An attribute has another name than in the inputs.
    Renamed(RenamedAttribute),
    /// Potree draws no point whose return number or number of returns is above 7, unless it is told to.
    ManyReturns {
        /// Such points.
        points: u64,
        /// Points of the dataset.
        of: u64,
    },
    /// Viewers take channels of 1 to 255 for 8 bits, although those of the dataset have 16.
    DarkColours {
        /// Points with such a channel.
        points: u64,
        /// Points of the dataset.
        of: u64,
    },
    /// Some viewers do not read the encoding.
    Brotli,
    /// Some viewers do not read attributes that are objects.
    Objects,
    /// Nodes have more points than a mesh of an engine, or than was allowed where not all of them share a place.
    CrowdedNodes {
        /// Such nodes.
        nodes: u64,
        /// Points of the fullest.
        points: u32,
        /// Points that there should be at most.
        most: u32,
    },
    /// A viewer does not know how long these attributes are.
    BehindColour {
        /// Their words.
        words: Vec<String>,
    },
    /// The format has WKT alone, which is not known of the coordinate reference system.
    NoWkt {
        /// The system, for people.
        system: String,
    },
    /// Coordinates are geocentric: z is the axis of the Earth.
    Geocentric {
        /// The system, for people.
        system: String,
    },
    /// x and y are degrees.
    Degrees {
        /// The system, for people.
        system: String,
    },
}

/// An attribute that has another name in a dataset than in the inputs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct RenamedAttribute {
    /// Its name in the inputs.
    pub name: String,
    /// Its name in the dataset.
    pub stored_as: String,
    /// Why.
    pub why: NameFault,
}

impl RenamedAttribute {
    pub(crate) const fn new(name: String, stored_as: String, why: NameFault) -> Self {
        Self { name, stored_as, why }
    }
}

/// Why an attribute cannot have its name. Serialises to a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NameFault {
    /// Every object of JavaScript has a property of that name.
    JavaScript,
    /// Viewers keep data of their own under it, or read other types from it.
    Viewers,
    /// Potree has a colouring of that name, and shows it instead.
    Colouring,
    /// It is empty, or a list in a page does not show it as it is.
    Text,
    /// Extra bytes of LAS have names of 32 bytes, each once, and three elements.
    ExtraBytes,
}

impl ViewerNote {
    /// A short name for programs.
    pub(super) const fn kind(&self) -> &'static str {
        match self {
            Self::Renamed(_) => "attribute_renamed",
            Self::ManyReturns { .. } => "many_returns",
            Self::DarkColours { .. } => "dark_colours",
            Self::Brotli => "brotli_readers",
            Self::Objects => "object_readers",
            Self::BehindColour { .. } => "behind_colour",
            Self::CrowdedNodes { .. } => "crowded_nodes",
            Self::NoWkt { .. } => "no_wkt",
            Self::Geocentric { .. } => "geocentric",
            Self::Degrees { .. } => "degrees",
        }
    }

    pub(super) const fn advice(&self) -> Option<Advice> {
        match self {
            Self::DarkColours { .. } => Some(Advice::RoundDarkColours),
            Self::CrowdedNodes { .. } => Some(Advice::LimitNodes),
            Self::NoWkt { .. } => Some(Advice::GiveWkt),
            Self::Geocentric { .. } | Self::Degrees { .. } => Some(Advice::Project),
            _ => None,
        }
    }
}

impl fmt::Display for ViewerNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Renamed(RenamedAttribute { name, stored_as, why }) => {
                write!(f, "the attribute {name:?} is called {stored_as:?}: {why}")
            }
            Self::ManyReturns { points, of } => write!(
                f,
                "{} of {} points have a return number or number of returns above 7: Potree does not draw them before \
                 viewer.setFilterReturnNumberRange(0, 255) and viewer.setFilterNumberOfReturnsRange(0, 255)",
                grouped(*points),
                grouped(*of)
            ),
            Self::DarkColours { points, of } => write!(
                f,
                "{} of {} points ({}) have 16-bit colour channels of 1 to 255: viewers take these for 8 bits and show \
                 them too bright",
                grouped(*points),
                grouped(*of),
                percent(*points, *of)
            ),
            Self::Brotli => f.write_str("three-loader, BA_PointCloud and compute_rasterizer do not read BROTLI"),
            Self::Objects => {
                f.write_str("three-loader, potree-core, loaders.gl, iTowns and Giro3D do not read version 1.8")
            }
            Self::CrowdedNodes { nodes, points, most } => write!(
                f,
                "{} of the nodes have more than {} points, the fullest {}: meshes of engines do not hold them",
                grouped(*nodes),
                grouped(u64::from(*most)),
                grouped(u64::from(*points))
            ),
            Self::BehindColour { words } => write!(
                f,
                "BA_PointCloud does not know the number of bytes of {}, and would show nonsense",
                words.join(", ")
            ),
            Self::NoWkt { system } => write!(
                f,
                "the coordinate reference system ({system}) is not written: it is not known as WKT, and the format has \
                 nothing else"
            ),
            Self::Geocentric { system } => write!(
                f,
                "coordinates are geocentric ({system}): viewers take z, the axis of the Earth, for up, and show the \
                 scene tilted"
            ),
            Self::Degrees { system } => write!(
                f,
                "x and y are degrees ({system}): viewers draw a degree as long as a unit of height, and show the scene \
                 stretched upwards"
            ),
        }
    }
}

impl fmt::Display for NameFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::JavaScript => {
                "every object of JavaScript has a property of that name, and viewers would load nothing"
            }
            Self::Viewers => "viewers keep data of their own under that name",
            Self::Colouring => "Potree has a colouring of that name, and would show that instead",
            Self::Text => "pages of viewers would not show that name as it is",
            Self::ExtraBytes => "extra bytes have names of 32 bytes and up to three elements",
        })
    }
}

/// A share with two significant digits.
fn percent(part: u64, of: u64) -> String {
    let percent = 100.0 * part as f64 / of.max(1) as f64;
    match percent {
        p if p >= 10.0 => format!("{p:.0} %"),
        p if p >= 1.0 => format!("{p:.1} %"),
        p if p >= 0.1 => format!("{p:.2} %"),
        p => format!("{p:.3} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_two_digits() {
        let shares = [(1, 1), (123, 1000), (12_345, 1_000_000), (456, 100_000), (15, 100_000)];
        assert_eq!(shares.map(|(a, b)| percent(a, b)), ["100 %", "12 %", "1.2 %", "0.46 %", "0.015 %"]);
    }
}
