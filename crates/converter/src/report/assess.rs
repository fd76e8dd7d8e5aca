//! The accuracy of a dataset from what lattice and format did.

use pointmill_format::{Deviations, Unit};

use super::accuracy::{Accuracy, Integers, Merged, Metres, PositionErrors, above};
use crate::cloud::{Change, Cloud};

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

/// WGS 84: the equator's radius, metres, and the square of the eccentricity.
const RADIUS: f64 = 6_378_137.0;
const ECCENTRICITY: f64 = 0.006_694_379_990_141_3;

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

/// Metres in a radian of longitude at the latitude nearest to the equator, and in one of latitude at the one farthest
/// from it: no other latitude between the two has longer ones.
fn metres_per_radian([south, north]: [f64; 2]) -> [f64; 2] {
    let nearest = if south <= 0.0 && north >= 0.0 { 0.0 } else { south.abs().min(north.abs()) };
    let farthest = south.abs().max(north.abs());
    let flattened = |latitude: f64| 1.0 - ECCENTRICITY * latitude.sin().powi(2);
    let parallel = RADIUS * nearest.cos().max(0.0) / flattened(nearest).sqrt();
    let meridian = RADIUS * (1.0 - ECCENTRICITY) / flattened(farthest).powf(1.5);
    [parallel, meridian].map(above)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_are_as_long_as_on_the_ellipsoid() {
        // lengths of a degree as tables have them
        let degrees = |south: f64, north: f64| {
            metres_per_radian([south, north].map(f64::to_radians)).map(|m| (m * 1f64.to_radians()).round())
        };
        assert_eq!(degrees(0.0, 0.0), [111_319.0, 110_574.0]);
        assert_eq!(degrees(-45.0, -45.0), [78_847.0, 111_132.0]);
        assert_eq!(degrees(60.0, 90.0), [55_800.0, 111_694.0]);
        assert_eq!(degrees(-10.0, 15.0)[0], 111_319.0);
    }
}
