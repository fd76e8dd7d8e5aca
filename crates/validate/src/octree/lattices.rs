//! The lattice of the run and that of the dataset: the same points, whose coordinates differ by the rounding of doubles.

use pointmill_format::Lattice;
use serde_json::Value;

use crate::accuracy::Deviation;

/// Stored integers, and those of the run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lattices {
    stored: Lattice,
    run: Lattice,
    /// From stored integers to those of the run.
    shift: [i64; 3],
}

impl Lattices {
    /// `own`: pointmill's own key of the metadata; without it both are one.
    pub(crate) fn new(stored: Lattice, own: &Value) -> Self {
        let numbers = own["latticeOffset"].as_array().map(|v| v.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
        let offset = numbers.and_then(|v| v.try_into().ok()).unwrap_or(stored.offset);
        let shift = [0, 1, 2].map(|a| ((stored.offset[a] - offset[a]) / stored.scale[a]).round() as i64);
        Self { stored, run: Lattice { scale: stored.scale, offset }, shift }
    }

    /// What `stored · scale + offset` gives against the points of the run's lattice.
    pub(crate) fn deviation(&self, [x, y, z]: [&[i32]; 3]) -> Deviation {
        let mut deviation = Deviation::default();
        for ((x, y), z) in x.iter().zip(y).zip(z) {
            let stored = [x, y, z].map(|v| i64::from(*v));
            let decoded = self.stored.world(stored);
            let meant = self.run.world([0, 1, 2].map(|a| stored[a].saturating_add(self.shift[a])));
            // near 0 a coordinate is as exact as the offset that it is counted from
            let size = [0, 1, 2].map(|a| meant[a].abs().max(self.stored.offset[a].abs()).max(self.run.offset[a].abs()));
            deviation.add([0, 1, 2].map(|a| decoded[a] - meant[a]), size);
        }
        deviation
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn near_0_coordinates_are_as_exact_as_the_offset_that_they_are_counted_from() {
        let stored = Lattice { scale: [1e-7; 3], offset: [-107.3741824, -107.3741824, -3.3554432] };
        let lattices = Lattices::new(stored, &json!({ "latticeOffset": [0.0, 0.0, 0.0] }));
        let (x, z) = (1_073_741_824 + 5, 33_554_432 - 3);
        let deviation = lattices.deviation([&[x, x + 1], &[x, x], &[z, z + 7]]);
        assert!(deviation.max.iter().any(|d| *d > 0.0), "{deviation:?}");
        assert_eq!(deviation.size, [107.3741824, 107.3741824, 3.3554432]);
        let allowed = deviation.size.map(|size| 16.0 * f64::EPSILON * size);
        assert!((0..3).all(|a| deviation.max[a] <= allowed[a]), "{deviation:?}");
    }
}
