//! Continuous levels of detail in the picture (`docs/formats/batches.md`, §9).

/// The weight of the point with that storage index, in [0, 1): spreads the transition between levels.
///
/// The same on every machine and for every precision; 24 bits, so that float32 holds it.
pub const fn weight(index: u32) -> f32 {
    (hash(index) >> 8) as f32 / 16_777_216.0
}

const fn hash(index: u32) -> u32 {
    let mut h = index;
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ h >> 16
}

/// T: the spacing that the picture wants of points at `distance` from the camera (world units).
///
/// `clod`: the factor of the method, 1 is fine, more is fewer points. `ndc_radius`: distance of the point from the
/// middle of the picture in normalised device coordinates.
///
/// Source: Schütz, Krösl, Wimmer, "Real-Time Continuous Level of Detail Rendering of Point Clouds", 2019.
pub fn target_spacing(distance: f32, clod: f32, ndc_radius: f32) -> f32 {
    distance * clod / (1000.0 * (1.0 - 0.7 * ndc_radius).max(0.3))
}

/// True if a point of level `lod` with that [`weight`] is drawn where the picture wants `target` ([`target_spacing`]).
///
/// `cell`: side of the cells of level 0.
pub fn keeps(lod: u8, weight: f32, cell: f32, target: f32) -> bool {
    cell / (f32::from(lod) + weight).exp2() >= target
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_those_of_the_format_page() {
        let hashes = [0, 1, 2, 10_240, 123_456_789, u32::MAX].map(hash);
        assert_eq!(hashes, [0, 0x6889_90c0, 0xd113_2181, 0x71e2_d028, 0xa8f1_db88, 0x6768_824a]);
        assert_eq!(f64::from(weight(1)), 0.408_349_037_170_410_16);
        assert_eq!(f64::from(weight(u32::MAX)), 0.403_938_412_666_320_8);
        let mean = (0..100_000).map(|i| f64::from(weight(i))).sum::<f64>() / 1e5;
        assert!((mean - 0.5).abs() < 0.005, "{mean}");
        assert!((0..100_000).all(|i| (0.0..1.0).contains(&weight(i))));
    }

    #[test]
    fn far_points_give_way_fine_levels_first() {
        assert!(keeps(1, weight(1), 1.0, target_spacing(100.0, 2.0, 0.0)));
        assert!(!keeps(1, weight(1), 1.0, target_spacing(200.0, 2.0, 0.0)));
        let kept = |lod| (0..1000).filter(|i| keeps(lod, weight(*i), 1.0, target_spacing(200.0, 2.0, 0.0))).count();
        assert_eq!(kept(0), 1000);
        assert!((1..1000).contains(&kept(1)), "the transition is spread over the points");
        assert_eq!([kept(2), kept(3)], [0, 0]);
    }

    #[test]
    fn the_middle_of_the_picture_shows_more() {
        assert!(target_spacing(10.0, 1.0, 0.0) < target_spacing(10.0, 1.0, 0.8));
        assert_eq!(target_spacing(10.0, 1.0, 1.0), target_spacing(10.0, 1.0, 5.0));
    }
}
