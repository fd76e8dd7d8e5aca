//! The accuracy of a dataset from what lattice and format did.

use pointmill_format::{Deviations, Unit};

use super::accuracy::{Accuracy, Integers, Merged, Metres, PositionErrors};
use crate::cloud::{Change, Cloud};
use crate::sources::metres_per_radian;

/// What a format did to the points of the lattice.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct FormatErrors {
    pub(crate) errors: PositionErrors,
    /// Points whose integers do not come back.
    pub(crate) lost: u64,
    /// Points that share their decoded position with another point of the lattice; `None`: not counted.
    pub(crate) merged: Option<u64>,
}

impl FormatErrors {
    /// Of points that were looked at.
    pub(crate) fn measured(deviations: &Deviations, lost: u64, merged: u64) -> Self {
        Self { errors: PositionErrors::measured(deviations), lost, merged: Some(merged) }
    }
}

/// The accuracy of a dataset of `points` points.
pub(crate) fn accuracy(cloud: &Cloud<'_>, points: u64, format: FormatErrors) -> Accuracy {
    let stats = &cloud.stats;
    let lattice = PositionErrors::measured(&deviations(&stats.change, stats.points));
    let lattice = if stats.moves { lattice } else { lattice.as_rounding() };
    let total = format.errors.after(&lattice);
    let lost = stats.integers_lost.saturating_add(format.lost);
    let metres = metres_per_unit(cloud).map(|factors| Metres {
        lattice: lattice.scaled(factors),
        format: format.errors.scaled(factors),
        total: total.scaled(factors),
    });
    Accuracy {
        lattice,
        format: format.errors,
        total,
        integers: Integers { points, same: points.saturating_sub(lost) },
        merged: Merged {
            lattice: if lattice.is_rounding() { Some(0) } else { stats.fallen_together },
            format: format.merged,
        },
        metres,
    }
}

/// The change of `points` points by moving to the lattice.
fn deviations(change: &Change, points: u64) -> Deviations {
    let mut d = Deviations::default();
    (d.points, d.max, d.sum, d.squares) = (points, change.max, change.sum, change.sum_of_squares);
    d.max_squared_3d = change.max_squared_3d;
    d
}

/// Metres in a unit of each axis, at most, if coordinates are angles.
fn metres_per_unit(cloud: &Cloud<'_>) -> Option<[f64; 3]> {
    let (bounds, crs) = (&cloud.stats.bounds, &cloud.facts.crs);
    let Some(Unit::Angle(radians)) = crs.unit.filter(|_| !bounds.is_empty()) else { return None };
    let lattice = &cloud.lattice.lattice;
    let latitudes = [bounds.min[1], bounds.max[1]].map(|q| q as f64 * lattice.scale[1] + lattice.offset[1]);
    let [east, north] = metres_per_radian(latitudes.map(|v| v * radians));
    Some([east * radians, north * radians, crs.vertical_unit.and_then(Unit::metres).unwrap_or(1.0)])
}
