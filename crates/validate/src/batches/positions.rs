//! From q back to the integers of the source's lattice.
//!
//! The lattice point nearest to the decoded position is the source's own wherever a cell of the box is finer than a
//! step; where it is not, the cell may still hold one lattice point alone. Encoding it must give q again.

use pointmill_format::Lattice;

use super::batch_records::Box32;
use super::formulas::{decode, encode, ulp};

/// The integers X of an axis that q allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Recovered {
    /// It can be nothing else.
    Exact(i64),
    /// Several lattice points have this q; the one nearest to the middle of the cell.
    Ambiguous(i64),
    /// No lattice point has this q; the nearest one.
    Foreign(i64),
}

/// One axis of one batch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis {
    scale: f64,
    offset: f64,
    origin: f64,
    m: f64,
    s: f64,
    /// Bits of q that are there.
    bits: u32,
    /// What a coordinate may be off by for the rounding of doubles, at most.
    rounding: f64,
    /// A cell, and all rounding, is less than half a step.
    fine: bool,
}

/// Doubles do not distinguish integers above.
const EXACT: f64 = 9_007_199_254_740_992.0;

impl Axis {
    pub(crate) fn new(lattice: &Lattice, origin: [f64; 3], bounds: &Box32, axis: usize, bits: u32) -> Self {
        let (m, s) = (bounds.min(axis), bounds.side(axis));
        let (scale, offset) = (lattice.scale[axis], lattice.offset[axis]);
        // p, r, the decoded r and the sum of it with the origin are rounded once each, at most at this size
        let size = origin[axis].abs() + offset.abs() + m + s;
        let rounding = bounds.rounding(axis) + 8.0 * ulp(size);
        let error = s / f64::from(1u32 << bits) / 2.0 + rounding;
        let largest = size / scale;
        let fine = error < scale / 2.0 && largest < EXACT;
        Self { scale, offset, origin: origin[axis], m, s, bits, rounding, fine }
    }

    /// Every q has one lattice point at most.
    pub(crate) fn is_fine(&self) -> bool {
        self.fine
    }

    /// World coordinate of X, a multiplication, then an addition.
    #[inline]
    pub(crate) fn world(&self, x: i64) -> f64 {
        x as f64 * self.scale + self.offset
    }

    /// r of X.
    #[inline]
    pub(crate) fn relative(&self, x: i64) -> f64 {
        self.world(x) - self.origin
    }

    /// The top bits of q of X.
    #[inline]
    pub(crate) fn top(&self, x: i64) -> u32 {
        encode(self.relative(x), self.m, self.s) >> (30 - self.bits)
    }

    /// X of the top bits `t` of q.
    #[inline]
    pub(crate) fn recover(&self, t: u32) -> Recovered {
        let world = self.origin + decode(t, self.m, self.s, self.bits);
        let nearest = ((world - self.offset) / self.scale).round();
        let x = nearest as i64;
        if self.fine {
            return if self.top(x) == t { Recovered::Exact(x) } else { Recovered::Foreign(x) };
        }
        if nearest.abs() >= EXACT {
            return Recovered::Ambiguous(x);
        }
        let at = |x: i64| self.top(x) == t;
        match ([x - 1, x + 1].map(at), at(x)) {
            ([false, false], true) => Recovered::Exact(x),
            (_, true) => Recovered::Ambiguous(x),
            (_, false) => self.search(x, t),
        }
    }

    /// X of `t`, of which `x` is none. q grows with X, so that halving finds the first one that is not below, however
    /// far off the rounding of large coordinates has put `x`.
    fn search(&self, x: i64, t: u32) -> Recovered {
        let far = (8.0 * self.rounding / self.scale + self.s / f64::from(1u32 << self.bits) / self.scale).ceil() + 2.0;
        if far >= EXACT {
            return Recovered::Ambiguous(x);
        }
        let (mut low, mut high) = (x - far as i64, x + far as i64);
        while low < high {
            let middle = low + (high - low) / 2;
            match self.top(middle) < t {
                true => low = middle + 1,
                false => high = middle,
            }
        }
        match (self.top(low) == t, self.top(low + 1) == t) {
            (true, true) => Recovered::Ambiguous(low),
            (true, false) => Recovered::Exact(low),
            (false, _) => Recovered::Foreign(x),
        }
    }

    /// r̂ of the top `bits` bits of `q`.
    #[inline]
    pub(crate) fn decoded(&self, q: u32, bits: u32) -> f64 {
        decode(q >> (30 - bits), self.m, self.s, bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(min: f32, max: f32, scale: f64, offset: f64, origin: f64, bits: u32) -> Axis {
        let bounds = Box32 { min: [min; 3], max: [max; 3] };
        Axis::new(&Lattice { scale: [scale; 3], offset: [offset; 3] }, [origin; 3], &bounds, 0, bits)
    }

    #[test]
    fn integers_come_back_where_cells_are_finer_than_steps() {
        let a = axis(0.5, 3.25, 0.001, -4_428_000.0, -4_428_000.0, 20);
        assert!(a.is_fine());
        for x in 500..=3250 {
            assert_eq!(a.recover(a.top(x)), Recovered::Exact(x));
        }
    }

    #[test]
    fn a_q_of_no_lattice_point_is_foreign() {
        let a = axis(0.5, 3.25, 0.001, 0.0, 0.0, 20);
        assert_eq!(a.recover(a.top(700) + 50), Recovered::Foreign(700));
    }

    #[test]
    fn steps_finer_than_doubles_have_their_cells_all_the_same() {
        // a step is a tenth of what doubles tell apart there, cells are finer still
        let a = axis(0.0, 1e-6, 1e-11, 1e6, 1e6, 30);
        assert!(!a.is_fine());
        for x in (0..100_000).step_by(37) {
            match a.recover(a.top(x)) {
                Recovered::Foreign(_) => panic!("{x} is a lattice point"),
                Recovered::Exact(found) => assert_eq!(found, x),
                Recovered::Ambiguous(found) => assert_eq!(a.top(found), a.top(x)),
            }
        }
        assert!(matches!(a.recover(a.top(5000) + 1), Recovered::Foreign(_)), "a cell without a point is found");
    }

    #[test]
    fn coarse_cells_are_ambiguous_and_say_so_unless_they_hold_one_point() {
        let a = axis(0.0, 4000.0, 0.001, 0.0, 0.0, 10);
        assert!(!a.is_fine());
        assert!(matches!(a.recover(17), Recovered::Ambiguous(_)));
        // cells of 1.5 steps hold one or two lattice points
        let a = axis(0.0, 1536.0, 1.0, 0.0, 0.0, 10);
        let mut exact = 0;
        for x in 0..=1536 {
            match a.recover(a.top(x)) {
                Recovered::Exact(found) => {
                    assert_eq!(found, x);
                    exact += 1;
                }
                Recovered::Ambiguous(found) => assert!((found - x).abs() <= 1),
                Recovered::Foreign(_) => panic!("{x} is a lattice point"),
            }
        }
        assert!(exact > 400 && exact < 700, "{exact}");
    }
}
