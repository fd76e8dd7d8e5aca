//! Continuous levels of detail of batches: what of a batch a picture shows (`docs/formats/batches.md`, §9).

use pointmill_format::batches::{LOD_LEVELS, keeps, target_spacing, weight};

/// Batches: the weight of the point with storage index `index` (PmBatchRecord::first_point plus its number in the batch), in
/// [0, 1): spreads the transition between levels. The same number as shaders compute. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_clod_weight(index: u32) -> f32 {
    weight(index)
}

/// Batches: the spacing that the picture wants of points at `distance` from the eye, world units. `clod`: the factor of the method;
/// 1 is fine, more is fewer points. `ndc_radius`: distance from the middle of the picture in normalised device coordinates, ≥ 0.
/// (Schütz, Krösl, Wimmer 2019.) Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_clod_spacing(distance: f32, clod: f32, ndc_radius: f32) -> f32 {
    target_spacing(distance, clod, ndc_radius)
}

/// Batches: 1 if a point of level `level` (the top byte of its colour word) with that weight is drawn where the picture wants points
/// `spacing` apart, else 0. `cell`: PmInfo::grid_cell. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_clod_keeps(level: u32, weight: f32, cell: f32, spacing: f32) -> u32 {
    u32::from(u8::try_from(level).is_ok_and(|level| keeps(level, weight, cell, spacing)))
}

/// Batches: how many levels of a batch whose nearest point is `d_min` away (PmDraw::d_min) the picture can show, 0 to 4: points of
/// the others need not be loaded. `clod` and `cell` as above. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_clod_levels(d_min: f64, clod: f32, cell: f32) -> u32 {
    // nearest, in the middle of the picture, with the least weight: the point that is kept longest
    let spacing = target_spacing(d_min as f32, clod, 0.0);
    (0..=LOD_LEVELS as u8).filter(|level| keeps(*level, 0.0, cell, spacing)).count() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_those_of_which_a_point_may_be_kept() {
        for step in 0..2000u32 {
            let distance = f64::from(step * step) / 100.0;
            let levels = pm_clod_levels(distance, 1.5, 1.0);
            let spacing = pm_clod_spacing(distance as f32, 1.5, 0.0);
            assert_eq!((0..4).filter(|level| pm_clod_keeps(*level, 0.0, 1.0, spacing) == 1).count() as u32, levels);
            assert!((0..100).all(|i| pm_clod_keeps(levels, pm_clod_weight(i), 1.0, spacing) == 0 || levels == 4));
        }
        assert_eq!([0.0, 80.0, 500.0, 1e6].map(|d| pm_clod_levels(d, 1.5, 1.0)), [4, 4, 1, 0]);
        assert_eq!(pm_clod_levels(f64::NAN, 1.0, 1.0), 0);
    }
}
