//! How long degrees are, on WGS 84.

/// The equator's radius, metres, and the square of the eccentricity.
const RADIUS: f64 = 6_378_137.0;
const ECCENTRICITY: f64 = 0.006_694_379_990_141_3;

/// Metres in a radian of longitude at the latitude nearest to the equator, and in one of latitude at the one farthest
/// from it, `[south, north]` in radians: no other latitude between the two has longer ones. A little too long, by more than
/// the rounding of doubles.
pub(crate) fn metres_per_radian([south, north]: [f64; 2]) -> [f64; 2] {
    let nearest = if south <= 0.0 && north >= 0.0 { 0.0 } else { south.abs().min(north.abs()) };
    let farthest = south.abs().max(north.abs());
    let flattened = |latitude: f64| 1.0 - ECCENTRICITY * latitude.sin().powi(2);
    let parallel = RADIUS * nearest.cos().max(0.0) / flattened(nearest).sqrt();
    let meridian = RADIUS * (1.0 - ECCENTRICITY) / flattened(farthest).powf(1.5);
    [parallel, meridian].map(|metres| metres * (1.0 + 4.0 * f64::EPSILON))
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
