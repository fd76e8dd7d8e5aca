//! Figures of accuracy, as `validate --json` has them and as the report of a conversion should.

use serde::Serialize;

use super::deviation::Deviation;
use super::known::{Known, Side};

/// How far decoded positions are from those of the sources, world units. What could not be measured is absent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Accuracy {
    /// The points of the lattice against the positions of the sources.
    pub lattice: Option<PositionErrors>,
    /// What a reader of the format decodes against the points of the lattice.
    pub format: Option<PositionErrors>,
    /// Both together: sums, which no error exceeds.
    pub total: Option<PositionErrors>,
    /// Points whose integers come back.
    pub integers: Option<Integers>,
    /// Points that became one with points that were apart.
    pub merged: Merged,
}

/// Errors of positions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PositionErrors {
    /// Largest by axis.
    pub max: [f64; 3],
    /// Largest distance in space.
    pub max_3d: f64,
    /// Root of the mean square by axis.
    pub rms: [f64; 3],
    /// Root of the mean square of the distance in space.
    pub rms_3d: f64,
    /// Mean by axis, decoded less meant.
    pub mean: [f64; 3],
}

/// Points whose decoded positions are rounded to the integers of their scan.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Integers {
    /// Points of the dataset.
    pub points: u64,
    /// Those whose integers come back, at least.
    pub same: u64,
}

/// Points that fell together; absent where it was not counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Merged {
    /// By the lattice.
    pub lattice: Option<u64>,
    /// By the format.
    pub format: Option<u64>,
}

impl Accuracy {
    pub(super) fn of(known: &Known<'_>) -> Self {
        let errors = |side: &Option<Side>| side.as_ref().map(|side| PositionErrors::of(&side.deviation));
        let (lattice, format) = (errors(&known.lattice), errors(&known.format));
        let lost = known.lattice.zip(known.format).map(|(a, b)| a.lost + b.lost);
        let points = known.points;
        Self {
            lattice,
            format,
            total: lattice.zip(format).map(|(lattice, format)| lattice.plus(&format)),
            integers: lost.map(|lost| Integers { points, same: points.saturating_sub(lost) }),
            merged: Merged {
                lattice: known.lattice.and_then(|side| side.merged),
                format: known.format.and_then(|side| side.merged),
            },
        }
    }
}

impl PositionErrors {
    pub(super) fn of(d: &Deviation) -> Self {
        let points = d.points.max(1) as f64;
        Self {
            max: d.max,
            max_3d: d.farthest.sqrt(),
            rms: d.squares.map(|sum| (sum / points).sqrt()),
            rms_3d: (d.squares.iter().sum::<f64>() / points).sqrt(),
            mean: d.sum.map(|sum| sum / points),
        }
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let sum = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        Self {
            max: sum(self.max, other.max),
            max_3d: self.max_3d + other.max_3d,
            rms: sum(self.rms, other.rms),
            rms_3d: self.rms_3d + other.rms_3d,
            mean: sum(self.mean, other.mean),
        }
    }
}
