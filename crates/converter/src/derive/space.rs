//! Distances between points of the lattice, the same from wherever they are looked at.

/// How integers of the lattice become distances: those of an axis times its step. Squares of distances are single precision, in units of the
/// square of the longest step; they depend on the two points alone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Space {
    /// By axis, at most 1.
    pub(super) scale: [f32; 3],
    /// The longest step, world units.
    pub(super) step: f64,
    /// The same as `scale`, in double precision.
    pub(super) ratio: [f64; 3],
}

impl Space {
    pub(super) fn new(steps: [f64; 3]) -> Self {
        let step = steps.into_iter().fold(0.0, f64::max);
        let ratio = steps.map(|s| s / step);
        Self { scale: ratio.map(|r| r as f32), step, ratio }
    }

    /// The square of a length in world units, as those of distances are.
    pub(super) fn squared(&self, length: f64) -> f32 {
        ((length / self.step) * (length / self.step)) as f32
    }
}

/// `a - b`, rounded once. Extents of clouds have at most 31 bits.
#[inline(always)]
pub(super) fn between(a: i32, b: i32) -> f32 {
    a.wrapping_sub(b) as f32
}

/// How far `q` is outside of `min..=max`, rounded once.
#[inline(always)]
pub(super) fn outside(q: i32, min: i32, max: i32) -> f32 {
    apart([q, q], [min, max])
}

/// How far two ranges, ends included, are apart, rounded once.
#[inline(always)]
pub(super) fn apart(a: [i32; 2], b: [i32; 2]) -> f32 {
    b[0].wrapping_sub(a[1]).max(a[0].wrapping_sub(b[1])).max(0) as f32
}

/// The square of the length of a difference.
#[inline(always)]
pub(super) fn squared(d: [f32; 3], scale: [f32; 3]) -> f32 {
    let [x, y, z] = [d[0] * scale[0], d[1] * scale[1], d[2] * scale[2]];
    x * x + y * y + z * z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_point_of_a_box_is_nearer_than_the_box() {
        let mut random = pointmill_testkit::Random::new(3);
        let space = Space::new([0.001, 0.02, 0.013]);
        for _ in 0..20_000 {
            let shift = 2 + random.below(29) as u32; // extents of 31 bits
            let mut next = || (random.next_u64() as i32) >> shift;
            let (q, a, b) = ([next(), next(), next()], [next(), next(), next()], [next(), next(), next()]);
            let beside = std::array::from_fn(|i| outside(q[i], a[i].min(b[i]), a[i].max(b[i])));
            let least = squared(beside, space.scale);
            let r = [next(), next(), next()];
            let box_of = |a: [i32; 3], b: [i32; 3], i: usize| [a[i].min(b[i]), a[i].max(b[i])];
            let of_boxes = squared(std::array::from_fn(|i| apart(box_of(q, r, i), box_of(a, b, i))), space.scale);
            assert!(least >= of_boxes, "{q:?} {r:?} {a:?} {b:?}");
            for p in [a, b, [a[0], b[1], a[2]]] {
                let d = squared(std::array::from_fn(|i| between(p[i], q[i])), space.scale);
                assert!(d >= least, "{q:?} {a:?} {b:?}");
            }
        }
    }
}
