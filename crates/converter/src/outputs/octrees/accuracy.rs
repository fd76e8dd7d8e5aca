//! How far `stored · scale + offset` can be from the point of the lattice, both in doubles.

use crate::cloud::Cloud;
use crate::report::{FormatErrors, PositionErrors};

/// The coordinates of one axis.
#[derive(Debug, Clone, Copy)]
struct Axis {
    scale: f64,
    /// World coordinate of the job lattice's 0, and of the stored 0.
    job_offset: f64,
    offset: f64,
    /// Integers on the job lattice: that of the stored 0, the least and the greatest.
    anchor: i64,
    min: i64,
    max: i64,
}

/// The errors of a dataset whose stored 0 is the point `anchor` of the job lattice, and at `offset`. Integers come back in
/// any case, and are what a reader compares.
pub(in crate::outputs) fn errors(cloud: &Cloud<'_>, anchor: [i64; 3], offset: [f64; 3]) -> FormatErrors {
    let (lattice, bounds) = (&cloud.lattice.lattice, &cloud.stats.bounds);
    if bounds.is_empty() {
        return FormatErrors { merged: Some(0), ..FormatErrors::default() };
    }
    let axis = |a: usize| Axis {
        scale: lattice.scale[a],
        job_offset: lattice.offset[a],
        offset: offset[a],
        anchor: anchor[a],
        min: bounds.min[a],
        max: bounds.max[a],
    };
    let errors = PositionErrors::rounding(std::array::from_fn(|a| axis(a).bound()));
    FormatErrors { errors, lost: 0, merged: Some(0) }
}

impl Axis {
    /// No two roundings of one position differ more. Each product and each sum is off by half a unit in its last place
    /// at most; the offset by what it differs from `anchor · scale + job_offset`.
    fn bound(&self) -> f64 {
        let Self { scale, job_offset, offset, anchor, min, max } = *self;
        if anchor == 0 && offset == job_offset || self.is_exact() {
            return 0.0;
        }
        let product = |q: i64| q as f64 * scale;
        let larger = |a: f64, b: f64| a.abs().max(b.abs());
        let job = larger(product(min), product(max));
        let stored = larger(product(max - anchor), product(min - anchor));
        let world = larger(product(min) + job_offset, product(max) + job_offset);
        let plain = product(anchor) + job_offset;
        let moved = (offset - plain).abs() + half_ulp(product(anchor)) + half_ulp(plain);
        // a coordinate just below a power of two may be rounded up to it
        let sums = 2.0 * half_ulp(world.next_up());
        (half_ulp(job) + half_ulp(stored) + sums + moved) * (1.0 + 8.0 * f64::EPSILON)
    }

    /// True if nothing is rounded: the step is a power of two, and all coordinates are whole steps that a double holds.
    fn is_exact(&self) -> bool {
        let is_power = self.scale.to_bits() << 12 == 0;
        let whole = |v: f64| (v / self.scale).fract() == 0.0 && (v / self.scale).abs() < 2f64.powi(52);
        let small = |q: i64| q.unsigned_abs() < 1 << 52;
        is_power
            && whole(self.job_offset)
            && whole(self.offset)
            && [self.anchor, self.min, self.max].map(small) == [true; 3]
    }
}

/// Half of the distance from `v` to the next double.
pub(in crate::outputs) fn half_ulp(v: f64) -> f64 {
    (v.abs().next_up() - v.abs()) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::tidy_world;

    fn axis(scale: f64, job_offset: f64, anchor: i64, [min, max]: [i64; 2]) -> Axis {
        Axis { scale, job_offset, offset: tidy_world(anchor, scale, job_offset), anchor, min, max }
    }

    #[test]
    fn no_rounding_exceeds_the_bound_and_it_is_not_far_above() {
        for (scale, offset, anchor) in
            [(0.001, 0.0, 4_428_000_000), (0.01, -7.3, 12_345), (3e-7, 1e3, -50), (0.1, 0.0, 7)]
        {
            let ends = [anchor, anchor + (1 << 30)];
            let axis = axis(scale, offset, anchor, ends);
            let mut worst: f64 = 0.0;
            for q in (ends[0]..=ends[1]).step_by(10_007) {
                let decoded = (q - anchor) as f64 * scale + axis.offset;
                worst = worst.max((decoded - (q as f64 * scale + offset)).abs());
            }
            let bound = axis.bound();
            assert!(worst > 0.0 && worst <= bound && bound < 8.0 * worst, "{scale}: {worst:e} {bound:e}");
        }
    }

    #[test]
    fn what_is_not_rounded_is_exact() {
        assert_eq!(axis(0.001, 12.5, 0, [0, 99]).bound(), 0.0);
        assert_eq!(axis(0.0625, 5e5, -1_000_000, [-1_000_000, 1_000_000]).bound(), 0.0);
        assert!(axis(0.0625, 0.1, 5, [5, 9]).bound() > 0.0);
    }
}
