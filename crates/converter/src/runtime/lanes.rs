//! Comparing eight numbers, or one point with eight, at once.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

#[cfg(target_arch = "x86_64")]
use super::vectors::Detected;

/// Points that are compared at once.
pub(crate) const LANES: usize = 8;

/// A way to compare; all give the same bits.
pub(crate) trait Compare: Copy {
    /// Bit `i` is set if point `i` of eight is nearer to `point` than the square root of `below`.
    fn nearer(self, axes: [&[f32; LANES]; 3], point: [f32; 3], below: f32) -> u32;

    /// Bit `i` is set if number `i` of eight is at most `bound`.
    fn at_most(self, values: &[f32; LANES], bound: f32) -> u32;
}

/// For every processor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Portable;

impl Compare for Portable {
    #[inline(always)]
    fn nearer(self, [x, y, z]: [&[f32; LANES]; 3], point: [f32; 3], below: f32) -> u32 {
        let mut hits = [0; LANES];
        for (i, hit) in hits.iter_mut().enumerate() {
            let (dx, dy, dz) = (x[i] - point[0], y[i] - point[1], z[i] - point[2]);
            *hit = u32::from(dx * dx + dy * dy + dz * dz < below) << i;
        }
        hits.iter().fold(0, |any, hit| any | hit)
    }

    #[inline(always)]
    fn at_most(self, values: &[f32; LANES], bound: f32) -> u32 {
        values.iter().enumerate().fold(0, |any, (i, value)| any | u32::from(*value <= bound) << i)
    }
}

/// For code that runs on processors with AVX2 alone.
#[cfg(target_arch = "x86_64")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2(Detected);

#[cfg(target_arch = "x86_64")]
impl Avx2 {
    pub(crate) fn new(detected: Detected) -> Self {
        Self(detected)
    }
}

#[cfg(target_arch = "x86_64")]
impl Compare for Avx2 {
    #[inline(always)]
    fn nearer(self, axes: [&[f32; LANES]; 3], point: [f32; 3], below: f32) -> u32 {
        // SAFETY: the processor has AVX2, or there were no `Detected`; each load reads the 32 bytes of its array.
        unsafe {
            let square = |a: usize| {
                let difference = _mm256_sub_ps(_mm256_loadu_ps(axes[a].as_ptr()), _mm256_set1_ps(point[a]));
                _mm256_mul_ps(difference, difference)
            };
            // the same order as above, and no fused multiplication: the same bits
            let squared = _mm256_add_ps(_mm256_add_ps(square(0), square(1)), square(2));
            let hits = _mm256_cmp_ps::<_CMP_LT_OQ>(squared, _mm256_set1_ps(below));
            _mm256_movemask_ps(hits).cast_unsigned()
        }
    }

    #[inline(always)]
    fn at_most(self, values: &[f32; LANES], bound: f32) -> u32 {
        // SAFETY: the processor has AVX2, or there were no `Detected`; the load reads the 32 bytes of the array.
        unsafe {
            let values = _mm256_loadu_ps(values.as_ptr());
            let hits = _mm256_cmp_ps::<_CMP_LE_OQ>(values, _mm256_set1_ps(bound));
            _mm256_movemask_ps(hits).cast_unsigned()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::vectors::Vectors;
    use super::*;
    use pointmill_testkit::Random;

    #[test]
    fn numbers_that_are_equal_count_and_others_do_not() {
        let values = [1.0, 2.0, 3.0, f32::NAN, f32::NEG_INFINITY, 2.0f32.next_up(), 0.0, f32::INFINITY];
        for vectors in Vectors::all() {
            let found = |bound: f32| match vectors {
                Vectors::Portable => Portable.at_most(&values, bound),
                #[cfg(target_arch = "x86_64")]
                Vectors::Avx2(detected) => Avx2::new(detected).at_most(&values, bound),
            };
            assert_eq!((found(2.0), found(f32::INFINITY)), (0b0101_0011, 0b1111_0111), "{vectors:?}");
        }
    }

    #[test]
    fn each_way_gives_the_same_bits() {
        let mut random = Random::new(5);
        for vectors in Vectors::all() {
            for _ in 0..10_000 {
                let mut next = || random.below(1 << 20) as f32 / (1 << 18) as f32;
                let axes: [[f32; LANES]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| next()));
                let point = [next(), next(), next()];
                let [x, y, z] = &axes;
                let squared: [f32; LANES] = std::array::from_fn(|i| {
                    let d = [x[i] - point[0], y[i] - point[1], z[i] - point[2]];
                    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
                });
                // a bound that one of the eight has exactly, or by the least more: other rounding would be seen
                for below in [squared[3], squared[5].next_up()] {
                    let expected = (0..LANES).map(|i| u32::from(squared[i] < below) << i).sum::<u32>();
                    let found = match vectors {
                        Vectors::Portable => Portable.nearer([x, y, z], point, below),
                        #[cfg(target_arch = "x86_64")]
                        Vectors::Avx2(detected) => Avx2::new(detected).nearer([x, y, z], point, below),
                    };
                    assert_eq!(found, expected, "{vectors:?}");
                }
            }
        }
    }
}
