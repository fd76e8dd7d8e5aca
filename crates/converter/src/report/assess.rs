//! The accuracy of a dataset from what lattice and format did.

use pointmill_format::Deviations;

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

/// Metres in a degree of a great circle of WGS 84.
const DEGREE: f64 = 111_319.49;

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
        merged: Merged { lattice: lattice.is_rounding().then_some(0), format: format.merged },
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

/// Metres in a unit of each axis, at most, if coordinates are degrees.
fn metres_per_unit(cloud: &Cloud<'_>) -> Option<[f64; 3]> {
    let bounds = &cloud.stats.bounds;
    if !is_in_degrees(&cloud.facts.crs.projection) || bounds.is_empty() {
        return None;
    }
    let lattice = &cloud.lattice.lattice;
    let [south, north] = [bounds.min[1], bounds.max[1]].map(|q| q as f64 * lattice.scale[1] + lattice.offset[1]);
    Some([DEGREE * widest_parallel(south, north), DEGREE, 1.0])
}

/// The cosine of the latitude nearest to the equator.
fn widest_parallel(south: f64, north: f64) -> f64 {
    let nearest = if south <= 0.0 && north >= 0.0 { 0.0 } else { south.abs().min(north.abs()) };
    above(nearest.to_radians().cos().max(0.0))
}

/// True for longitudes and latitudes in degrees.
fn is_in_degrees(projection: &str) -> bool {
    let has = |words: &[&str]| projection.split_whitespace().any(|w| words.contains(&w));
    projection == "EPSG:4326" || has(&["+proj=longlat", "+proj=latlong", "+proj=lonlat", "+proj=latlon"])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_degree_of_longitude_counts_as_at_the_latitude_nearest_to_the_equator() {
        assert!((widest_parallel(-60.0, -70.0) - 0.5).abs() < 1e-12 && widest_parallel(-1.0, 60.0) >= 1.0);
        assert!((widest_parallel(47.0, 48.0) - 47f64.to_radians().cos()).abs() < 1e-12);
        assert!(is_in_degrees("+proj=longlat +datum=WGS84 +no_defs") && !is_in_degrees("+proj=utm +zone=33"));
    }
}
