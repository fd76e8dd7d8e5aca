//! The neighbourhood of a point while it is put together: the nearest points, or all within a distance.

use super::nearest::{Near, Nearest};
use super::space::Space;
use super::sums::Sums;
use super::surface::Surface;
use crate::plan::Neighbourhood;

/// Takes the points around one.
pub(super) trait Collect {
    /// Begins with the next point.
    fn begin(&mut self, q: [i32; 3]);
    /// The square of the distance up to which points matter.
    fn bound(&self) -> f32;
    /// Takes a point whose distance is at most the bound.
    fn offer(&mut self, squared: f32, place: [i32; 3]);
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
    fn begin(&mut self, q: [i32; 3]) {
        self.q = q;
        self.nearest.clear();
    }

    #[inline(always)]
    fn bound(&self) -> f32 {
        self.nearest.bound()
    }

    #[inline(always)]
    fn offer(&mut self, squared: f32, place: [i32; 3]) {
        self.nearest.offer(Near::new(squared, place));
    }

    #[inline]
    fn surface(&self, space: &Space) -> Surface {
        let all = self.nearest.all();
        let Some(last) = all.last() else { return Surface::default() };
        let place = last.place();
        let along = |a: usize| (f64::from(place[a]) - f64::from(self.q[a])) * space.ratio[a];
        let reach = [0, 1, 2].map(along).iter().map(|d| d * d).sum::<f64>().sqrt() * space.step;
        Surface::of(&Sums::of(self.q, all), reach, space)
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
    fn begin(&mut self, q: [i32; 3]) {
        self.q = q;
        self.sums = Sums::default();
    }

    #[inline(always)]
    fn bound(&self) -> f32 {
        self.bound
    }

    #[inline(always)]
    fn offer(&mut self, _: f32, place: [i32; 3]) {
        self.sums.add([0, 1, 2].map(|a| i64::from(place[a]) - i64::from(self.q[a])));
    }

    #[inline]
    fn surface(&self, space: &Space) -> Surface {
        Surface::of(&self.sums, self.radius, space)
    }
}
