//! Points to the bytes of a leaf.

use crate::{Aabb, Deviations};

use super::{CORE_BYTES, RecordLayout};

/// The center of a leaf whose points span `min` to `max`, world coordinates of its least and greatest lattice integers:
/// (min + max) / 2 per axis, in double.
#[must_use]
pub fn leaf_center(min: [f64; 3], max: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|a| (min[a] + max[a]) / 2.0)
}

/// A class as it is stored: rounded to a whole number; 0 ("never classified") if it is not finite, or beyond ±2^24,
/// where single precision loses whole numbers.
#[must_use]
pub fn class_value(class: f64) -> f32 {
    let rounded = class.round();
    // + 0.0 turns -0 into 0
    if rounded.abs() <= f64::from(1u32 << 24) { (rounded + 0.0) as f32 } else { 0.0 }
}

/// Encodes the points of one leaf, one by one, and finds their tight box.
///
/// Points have to come in the order of section 6.5 of the format's page.
///
/// ```
/// use pointmill_format::bintree::{LeafEncoder, RecordLayout, leaf_center};
///
/// let points = [[1000.0, 2000.0, -5.0], [1000.5, 2000.0, -4.5]];
/// let mut bytes = Vec::new();
/// let mut leaf = LeafEncoder::new(&RecordLayout::core(), leaf_center(points[0], points[1]), &mut bytes);
/// for p in points {
///     leaf.push(p, 2.0);
/// }
/// let bounds = leaf.finish();
/// assert_eq!((bounds.min, bounds.max, bytes.len()), (points[0], points[1], 32));
/// ```
#[derive(Debug)]
#[must_use = "the bounds of `finish` belong into the index"]
pub struct LeafEncoder<'a> {
    stride: usize,
    center: [f64; 3],
    bounds: Aabb,
    deviations: Deviations,
    out: &'a mut Vec<u8>,
}

impl<'a> LeafEncoder<'a> {
    /// Starts a leaf at the end of `out`. `center`: world coordinates, finite.
    pub fn new(layout: &RecordLayout, center: [f64; 3], out: &'a mut Vec<u8>) -> Self {
        let (bounds, deviations) = (Aabb::EMPTY, Deviations::default());
        Self { stride: layout.stride(), center, bounds, deviations, out }
    }

    /// Appends a point: `world` in world coordinates, `class` raw ([`class_value`] is applied).
    ///
    /// Returns the bytes of the record behind the core, zero, for the other columns: a column at byte `offset` of the
    /// record is at `offset - CORE_BYTES` here.
    pub fn push(&mut self, world: [f64; 3], class: f64) -> &mut [u8] {
        let at = self.out.len();
        self.out.resize(at + self.stride, 0);
        let (core, rest) = self.out[at..].split_at_mut(CORE_BYTES);
        let offset: [f32; 3] = std::array::from_fn(|a| (world[a] - self.center[a]) as f32);
        let values = [offset[0], offset[1], offset[2], class_value(class)];
        for (bytes, value) in core.as_chunks_mut::<4>().0.iter_mut().zip(values) {
            *bytes = value.to_le_bytes();
        }
        let decoded = decode(self.center, offset);
        self.bounds.grow(decoded);
        self.deviations.add(std::array::from_fn(|a| decoded[a] - world[a]));
        rest
    }

    /// How far the decoded points are from those that were pushed, so far.
    #[must_use]
    pub fn deviations(&self) -> &Deviations {
        &self.deviations
    }

    /// The tight box of the decoded points, as the index wants it.
    #[must_use]
    pub fn finish(self) -> Aabb {
        self.bounds
    }
}

/// The position that a reader sees: the sum is in double.
pub(super) fn decode(center: [f64; 3], offset: [f32; 3]) -> [f64; 3] {
    std::array::from_fn(|a| center[a] + f64::from(offset[a]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Lattice;

    #[test]
    fn classes_are_whole_finite_numbers() {
        let cases = [(2.0, 2.0), (2.5, 3.0), (-0.2, 0.0), (255.0, 255.0), (16_777_216.0, 16_777_216.0), (1e9, 0.0)];
        for (class, stored) in cases {
            assert_eq!(class_value(class).to_bits(), f32::to_bits(stored), "{class}");
        }
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(class_value(bad).to_bits(), 0);
        }
    }

    /// Greatest error of a leaf that spans `2 · half` steps of `step` around `at`, over many points in it.
    fn greatest_error(step: f64, half: i64, at: f64) -> f64 {
        let lattice = Lattice { scale: [step; 3], offset: [at; 3] };
        let (min, max) = (lattice.world([-half; 3]), lattice.world([half; 3]));
        let (mut bytes, mut worst) = (Vec::new(), 0.0_f64);
        let center = leaf_center(min, max);
        let mut leaf = LeafEncoder::new(&RecordLayout::core(), center, &mut bytes);
        // A stride that is coprime to powers of two meets all patterns of low bits.
        let xs: Vec<i64> = (-half..=half).step_by((half / 50_000) as usize * 2 + 1).chain([half]).collect();
        for &x in &xs {
            leaf.push(lattice.world([x; 3]), 0.0);
        }
        let deviations = *leaf.deviations();
        let bounds = leaf.finish();
        for (record, &x) in bytes.as_chunks::<16>().0.iter().zip(&xs) {
            let dx = f32::from_le_bytes([record[0], record[1], record[2], record[3]]);
            let decoded = decode(center, [dx; 3]);
            assert!(bounds.contains(decoded));
            worst = worst.max((decoded[0] - lattice.world([x; 3])[0]).abs());
            if 2f64.powi((half as f64 * step).log2().floor() as i32 - 24) < 0.499 * step {
                assert_eq!(lattice.quantize(0, decoded[0]), x, "{step} {half}");
            }
        }
        assert_eq!((deviations.points, deviations.max), (xs.len() as u64, [worst; 3]));
        worst
    }

    #[test]
    fn the_error_of_single_precision_is_within_its_bound_and_comes_near_it() {
        // Half extents of the table in section 5, and leaves 10 km and 16 km long.
        for metres in [3, 50, 1000, 5000, 8000, 10_000, 16_000] {
            for at in [0.0, 4_500_000.0] {
                let bound = 2f64.powi((metres as f64).log2().floor() as i32 - 24);
                // The lattice of 0.01 mm shows the error; that of 1 mm shows that integers come back.
                let worst = greatest_error(1e-5, metres * 100_000, at);
                assert!(worst <= bound + 2e-9, "{metres} m: {worst}");
                assert!(worst > 0.9 * bound, "{metres} m: {worst} is far from {bound}");
                assert!(greatest_error(1e-3, metres * 1000, at) <= bound + 2e-9);
            }
        }
    }

    #[test]
    fn centers_and_differences_are_doubles() {
        let (min, max) = ([5_400_000.0625, -1.0, 0.0], [5_400_001.0625, 2.0, 0.0]);
        let center = leaf_center(min, max);
        assert_eq!(center, [5_400_000.5625, 0.5, 0.0]);
        let mut bytes = Vec::new();
        let mut leaf = LeafEncoder::new(&RecordLayout::core(), center, &mut bytes);
        leaf.push([5_400_000.0625, 2.0, 0.0], 0.0);
        assert_eq!(leaf.finish().min, [5_400_000.0625, 2.0, 0.0]);
        assert_eq!(bytes[..8], [(-0.5f32).to_le_bytes(), 1.5f32.to_le_bytes()].concat());
    }
}
