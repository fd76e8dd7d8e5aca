//! The neighbourhood of a point while it is put together: the nearest points, or all within a distance.

use super::nearest::Nearest;
use super::space::Space;
use super::sums::Sums;
use super::surface::Surface;
use crate::plan::Neighbourhood;
use crate::runtime::Compare;

/// More than all roundings of a sum of two distances together.
const ROUNDED_UP: f32 = 1.0 + 1e-5;

/// More than what squares of lengths lose that are nearly too small for single precision; in steps.
const LEAST: f32 = 1e-18;

/// Squares of distances, to that of the farthest neighbour of the point before: within the first the neighbours of the next one are
/// expected, within the second they are gathered for several. More, and more points are looked at; less, and it is in vain more often.
const EXPECTED: f32 = 1.3;
const GATHERED: f32 = 1.7;

/// Takes the points around one.
pub(super) trait Collect {
    /// The square of the distance within which points are gathered of which several next neighbourhoods are chosen; nothing, if
    /// that cannot be told.
    fn gathered(&self) -> Option<f32>;
    /// The square of the distance within which the next neighbourhood is expected, so far from the point before.
    fn expected(&self, step: Option<f32>) -> f32;
    /// Begins with the next point, in the hope that its neighbourhood is within the square of a distance.
    fn begin_within(&mut self, q: [i32; 3], within: f32);
    /// True if that hope was right, once all points within that distance were offered.
    fn is_complete(&self) -> bool;
    /// Begins with the next point; the square of its distance from the one before, if there is one.
    fn begin(&mut self, q: [i32; 3], step: Option<f32>);
    /// The square of the distance up to which points matter.
    fn bound(&self) -> f32;
    /// Takes a point whose distance is at most the bound.
    fn offer(&mut self, lanes: impl Compare, squared: f32, place: [i32; 3]);
    /// The surface through them.
    fn surface(&mut self, space: &Space) -> Surface;
}

/// A way to put neighbourhoods together.
#[derive(Debug)]
pub(super) enum Collector {
    SoMany(SoMany),
    AllWithin(AllWithin),
}

impl Collector {
    pub(super) fn new(neighbourhood: Neighbourhood, space: &Space) -> Self {
        match neighbourhood {
            Neighbourhood::Nearest(count) => Self::SoMany(SoMany::new(count)),
            Neighbourhood::Within(radius) => Self::AllWithin(AllWithin::new(radius, space)),
        }
    }
}

impl Collector {
    /// So many points are a neighbourhood, where that is known before.
    pub(super) fn neighbours(&self) -> Option<usize> {
        match self {
            Self::SoMany(some) => Some(some.nearest.most()),
            Self::AllWithin(_) => None,
        }
    }
}

/// So many nearest ones.
#[derive(Debug)]
pub(super) struct SoMany {
    q: [i32; 3],
    nearest: Nearest,
    /// The square of the greatest distance in the neighbourhood before.
    before: f32,
}

impl SoMany {
    fn new(count: u32) -> Self {
        Self { q: [0; 3], nearest: Nearest::new(count as usize), before: f32::INFINITY }
    }

    /// The square of a distance within which the next neighbourhood is: the neighbours of the point before are at most as far as
    /// they were from that, and the step to this one.
    #[inline(always)]
    fn sure(&self, step: Option<f32>) -> f32 {
        step.map_or(f32::INFINITY, |step| {
            let reach = (self.before.sqrt() + step.sqrt()) * ROUNDED_UP + LEAST;
            reach * reach
        })
    }
}

impl Collect for SoMany {
    #[inline(always)]
    fn gathered(&self) -> Option<f32> {
        (self.before > 0.0 && self.before < f32::MAX / GATHERED).then_some(self.before * GATHERED)
    }

    #[inline(always)]
    fn expected(&self, step: Option<f32>) -> f32 {
        self.sure(step).min(self.before * EXPECTED)
    }

    #[inline(always)]
    fn begin_within(&mut self, q: [i32; 3], within: f32) {
        self.q = q;
        self.nearest.begin(within);
    }

    #[inline(always)]
    fn is_complete(&self) -> bool {
        self.nearest.is_full()
    }

    #[inline(always)]
    fn begin(&mut self, q: [i32; 3], step: Option<f32>) {
        self.begin_within(q, self.sure(step));
    }

    #[inline(always)]
    fn bound(&self) -> f32 {
        self.nearest.bound()
    }

    #[inline(always)]
    fn offer(&mut self, lanes: impl Compare, squared: f32, place: [i32; 3]) {
        self.nearest.offer(lanes, squared, place);
    }

    #[inline]
    fn surface(&mut self, space: &Space) -> Surface {
        self.before = self.nearest.reach();
        let Some(place) = self.nearest.farthest() else { return Surface::default() };
        let along = |a: usize| (f64::from(place[a]) - f64::from(self.q[a])) * space.ratio[a];
        let reach = [0, 1, 2].map(along).iter().map(|d| d * d).sum::<f64>().sqrt() * space.step;
        Surface::of(&Sums::of(self.q, self.nearest.places()), reach, space)
    }
}

/// All within a distance.
#[derive(Debug)]
pub(super) struct AllWithin {
    q: [i32; 3],
    radius: f64,
    bound: f32,
    sums: Sums,
}

impl AllWithin {
    fn new(radius: f64, space: &Space) -> Self {
        Self { q: [0; 3], radius, bound: space.squared(radius), sums: Sums::default() }
    }

    /// So many more points at the place itself.
    pub(super) fn add_middle(&mut self, count: u64) {
        self.sums.add_middle(count);
    }
}

impl Collect for AllWithin {
    #[inline(always)]
    fn gathered(&self) -> Option<f32> {
        Some(self.bound)
    }

    #[inline(always)]
    fn expected(&self, _: Option<f32>) -> f32 {
        self.bound
    }

    #[inline(always)]
    fn begin_within(&mut self, q: [i32; 3], _: f32) {
        self.begin(q, None);
    }

    #[inline(always)]
    fn is_complete(&self) -> bool {
        true
    }

    #[inline(always)]
    fn begin(&mut self, q: [i32; 3], _: Option<f32>) {
        self.q = q;
        self.sums = Sums::default();
    }

    #[inline(always)]
    fn bound(&self) -> f32 {
        self.bound
    }

    #[inline(always)]
    fn offer(&mut self, _: impl Compare, _: f32, place: [i32; 3]) {
        self.sums.add([0, 1, 2].map(|a| i64::from(place[a]) - i64::from(self.q[a])));
    }

    #[inline]
    fn surface(&mut self, space: &Space) -> Surface {
        Surface::of(&self.sums, self.radius, space)
    }
}
