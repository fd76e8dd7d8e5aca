//! Integer coordinates and the world.

/// A lattice of coordinates: `world = quantized · scale + offset`, per axis, evaluated in double precision.
///
/// ```
/// use pointmill_format::Lattice;
///
/// let lattice = Lattice { scale: [0.5; 3], offset: [100.0, 0.0, 0.0] };
/// assert_eq!(lattice.world([2, 3, -1]), [101.0, 1.5, -0.5]);
/// assert_eq!(lattice.quantize(0, 101.0), 2);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Lattice {
    /// Step of one unit, world units, > 0 and finite.
    pub scale: [f64; 3],
    /// World coordinate of the quantized 0.
    pub offset: [f64; 3],
}

impl Lattice {
    /// The world coordinates of a lattice point.
    #[must_use]
    pub fn world(&self, quantized: [i64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| quantized[a] as f64 * self.scale[a] + self.offset[a])
    }

    /// The nearest lattice coordinate on `axis`, ties to even; saturates at the ends of `i64`, NaN gives 0.
    #[must_use]
    pub fn quantize(&self, axis: usize, world: f64) -> i64 {
        ((world - self.offset[axis]) / self.scale[axis]).round_ties_even() as i64
    }

    /// The finest step that a scan or a request may have. A femtometre is the size of a proton: no instrument measures
    /// it, and 2³² steps of it span 4 µm. The square of a finer step soon is nothing in single precision, in which
    /// renderers (and the boxes of batches) compute.
    pub const FINEST_STEP: f64 = 1e-15;

    /// No renderer's single precision holds coordinates beyond this, and no scanner gives them.
    pub const FARTHEST: f64 = 1e30;

    /// The coarsest step that a scan or a request may have: 2³¹ of it reach [`Self::FARTHEST`].
    pub const COARSEST_STEP: f64 = Self::FARTHEST / (1u64 << 31) as f64;

    /// True for a step that coordinates can have.
    #[must_use]
    pub fn is_sound_step(step: f64) -> bool {
        (Self::FINEST_STEP..=Self::COARSEST_STEP).contains(&step)
    }

    /// True for a coordinate at which single precision does not end.
    #[must_use]
    pub fn is_sound_offset(offset: f64) -> bool {
        offset.abs() <= Self::FARTHEST
    }

    /// True if every scale is finite and > 0 and every offset finite.
    pub fn is_valid(&self) -> bool {
        self.scale.iter().all(|s| s.is_finite() && *s > 0.0) && self.offset.iter().all(|o| o.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_and_offsets_end_where_computing_with_them_does() {
        for step in [1e-15, 1e-12, 0.001, 1.0, 1e20] {
            assert!(Lattice::is_sound_step(step), "{step}");
        }
        for step in [0.0, -0.001, 5e-310, f64::MIN_POSITIVE, 9e-16, 1e21, 1e300, f64::INFINITY, f64::NAN] {
            assert!(!Lattice::is_sound_step(step), "{step}");
        }
        assert!([0.0, -5e6, 1e30].into_iter().all(Lattice::is_sound_offset));
        assert!(![2e30, -1e300, f64::NEG_INFINITY, f64::NAN].into_iter().any(Lattice::is_sound_offset));
    }

    #[test]
    fn quantize_undoes_world_far_from_the_origin() {
        let l = Lattice { scale: [0.001; 3], offset: [4_428_000.0, -1.0, 0.0] };
        for q in [0, 1, -7, 2_147_483_647, -2_147_483_648] {
            let w = l.world([q; 3]);
            assert_eq!([0, 1, 2].map(|a| l.quantize(a, w[a])), [q; 3]);
        }
    }

    #[test]
    fn every_axis_has_to_be_valid() {
        let valid = Lattice { scale: [0.001; 3], offset: [-1e9, 0.0, 1.0] };
        assert!(valid.is_valid());
        for axis in 0..3 {
            for scale in [0.0, -0.001, f64::INFINITY, f64::NAN] {
                let mut other = valid;
                other.scale[axis] = scale;
                assert!(!other.is_valid(), "{scale}");
            }
            for offset in [f64::INFINITY, f64::NAN] {
                let mut other = valid;
                other.offset[axis] = offset;
                assert!(!other.is_valid(), "{offset}");
            }
        }
    }
}
