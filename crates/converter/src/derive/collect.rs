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

/// Takes the points around one.
pub(super) trait Collect {
    /// Begins with the next point; the square of its distance from the one before, if there is one.
    fn begin(&mut self, q: [i32; 3], step: Option<f32>);
    /// The square of the distance up to which points matter.
    fn bound(&self) -> f32;
    /// Takes a point whose distance is at most the bound.
    fn offer(&mut self, lanes: impl Compare, squared: f32, place: [i32; 3]);
    /// The surface through them.
    fn surface(&self, space: &Space) -> Surface;
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

/// So many nearest ones.
#[derive(Debug)]
pub(super) struct SoMany {
    q: [i32; 3],
    nearest: Nearest,
}

impl SoMany {
    fn new(count: u32) -> Self {
        Self { q: [0; 3], nearest: Nearest::new(count as usize) }
    }
}

impl Collect for SoMany {
    #[inline(always)]
    fn begin(&mut self, q: [i32; 3], step: Option<f32>) {
        self.q = q;
        // the neighbours of the point before are at most as far as they were from that, and the step to this one
        let before = self.nearest.reach();
        self.nearest.begin(step.map_or(f32::INFINITY, |step| {
            let reach = (before.sqrt() + step.sqrt()) * ROUNDED_UP + LEAST;
            reach * reach
        }));
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
    fn surface(&self, space: &Space) -> Surface {
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
    fn surface(&self, space: &Space) -> Surface {
        Surface::of(&self.sums, self.radius, space)
    }
}
