//! The surfaces through the points of a unit: a thread's part of the work.
//!
//! Points that follow each other in Morton order lie close together: what is around them is gathered once, and their neighbours are
//! chosen of that. Where these turn out to be farther away than was gathered, the hierarchy is asked for the one point.

use std::ops::Range;

use super::around::{Around, LEAF_POINTS, Places, leaf};
use super::boxes::{Box3, Boxes, Waiting};
use super::collect::Collect;
use super::runs::{Lookup, Others};
use super::space::{Space, between, squared};
use super::surface::Surface;
use crate::error::ConvertError;
use crate::runtime::{Compare, LANES, Portable, Workers};

/// Points after which a thread looks whether the run is to stop: few, since all of a cloud may be within a distance of each.
const POINTS_PER_LOOK: usize = 32;

/// Points around which what is near is gathered at once, at most, and the side of their box, to the distance that is gathered.
const TOGETHER: usize = 32;
const SIDE: f32 = 2.0;

/// So many points are looked at by themselves where there is too much around them.
const ALONE: usize = 16;

/// Points that are reported together.
const POINTS_PER_STEP: usize = 512;

/// A thread's memory.
pub(super) struct Finder {
    /// Coordinates of the points of the unit, in Morton order.
    pub(super) columns: [Vec<i32>; 3],
    /// By point.
    pub(super) surfaces: Vec<Surface>,
    leaves: Boxes,
    around: Around,
    stack: Vec<Waiting>,
    lookup: Lookup,
}

impl Finder {
    /// For neighbourhoods of so many points, where that is known.
    pub(super) fn new(neighbours: Option<usize>) -> Self {
        Self {
            columns: std::array::from_fn(|_| Vec::new()),
            surfaces: Vec::new(),
            leaves: Boxes::default(),
            around: Around::new(neighbours),
            stack: Vec::new(),
            lookup: Lookup::new(),
        }
    }

    /// Finds the surface through each point of the unit. `others`: nothing, if the unit is the cloud.
    #[inline(always)]
    pub(super) fn find(
        &mut self,
        lanes: impl Compare,
        space: &Space,
        others: Option<Others<'_>>,
        workers: &Workers<'_>,
        collect: &mut impl Collect,
    ) -> Result<(), ConvertError> {
        let points = self.columns[0].len();
        let columns = self.columns.each_ref().map(Vec::as_slice);
        self.leaves.build((0..points.div_ceil(LEAF_POINTS)).map(|i| Box3::of(leaf(columns, i))));
        self.surfaces.clear();
        self.surfaces.reserve(points);
        let places = Places { columns, leaves: &self.leaves, others, space };
        let (stack, lookup) = (&mut self.stack, &mut self.lookup);
        let mut search = Search { lanes, places, around: &mut self.around, within: 0.0, stack, lookup, collect };
        let mut before: Option<([i32; 3], Surface)> = None;
        let (mut gathered, mut alone) = (0..0, 0);
        for i in 0..points {
            if i % POINTS_PER_LOOK == 0 {
                workers.check_stop()?;
            }
            if i > 0 && i % POINTS_PER_STEP == 0 {
                workers.advance(POINTS_PER_STEP as u64);
            }
            let q = columns.map(|axis| axis[i]);
            let mut step = None;
            if let Some((place, surface)) = before {
                if place == q {
                    self.surfaces.push(surface);
                    continue;
                }
                step = Some(squared([0, 1, 2].map(|a| between(q[a], place[a])), space.scale));
            }
            if i >= gathered.end && i >= alone {
                gathered = search.gather(i)?;
                if gathered.is_empty() {
                    alone = i + ALONE;
                }
            }
            if !(gathered.contains(&i) && search.choose(q, step)) {
                search.one(i, q, step)?;
                gathered = 0..0; // the next ones are as far from their neighbours
            }
            let surface = search.collect.surface(space);
            before = Some((q, surface));
            self.surfaces.push(surface);
        }
        workers.advance((points - points.saturating_sub(1) / POINTS_PER_STEP * POINTS_PER_STEP) as u64);
        Ok(())
    }

    /// Offers the points of other units to a neighbourhood of which this one has offered its own.
    pub(super) fn look_beyond(
        &mut self,
        q: [i32; 3],
        space: &Space,
        others: Others<'_>,
        collect: &mut impl Collect,
    ) -> Result<(), ConvertError> {
        beyond(Portable, q, space, others, &mut self.stack, &mut self.lookup, collect)
    }
}

/// The search in a unit.
struct Search<'a, L, C> {
    lanes: L,
    places: Places<'a>,
    around: &'a mut Around,
    /// What it has gathered: of all points within this square of a distance of each of some.
    within: f32,
    stack: &'a mut Vec<Waiting>,
    lookup: &'a mut Lookup,
    collect: &'a mut C,
}

impl<L: Compare, C: Collect> Search<'_, L, C> {
    /// Gathers what is around the next points; those are returned.
    #[inline(always)]
    fn gather(&mut self, i: usize) -> Result<Range<usize>, ConvertError> {
        let Some(within) = self.collect.gathered() else { return Ok(0..0) };
        let columns = self.places.columns;
        let most = SIDE * SIDE * within;
        let mut of = Box3::at(columns.map(|axis| axis[i]));
        let mut end = i + 1;
        while end < columns[0].len().min(i + TOGETHER) {
            let mut all = of;
            all.join(&Box3::at(columns.map(|axis| axis[end])));
            let side = |a: usize| between(all.max[a], all.min[a]) * self.places.space.scale[a];
            if (0..3).any(|a| side(a) * side(a) > most) {
                break;
            }
            (of, end) = (all, end + 1);
        }
        self.within = within;
        let is_all = self.around.gather(self.lanes, of, within, &self.places, self.stack, self.lookup)?;
        Ok(if is_all { i..end } else { 0..0 })
    }

    /// Puts the neighbourhood of a point together of what was gathered. False: it reaches beyond that.
    #[inline(always)]
    fn choose(&mut self, q: [i32; 3], step: Option<f32>) -> bool {
        let expected = self.collect.expected(step).min(self.within);
        for within in [expected, self.within] {
            self.collect.begin_within(q, within);
            self.around.offer_all(self.lanes, q, self.places.space, self.collect);
            if self.collect.is_complete() {
                return true;
            }
            if expected == self.within {
                break;
            }
        }
        false
    }

    /// Puts the neighbourhood of a point together of what the hierarchy finds.
    #[inline(always)]
    fn one(&mut self, i: usize, q: [i32; 3], step: Option<f32>) -> Result<(), ConvertError> {
        let Places { columns, leaves, others, space } = self.places;
        self.collect.begin(q, step);
        // its own leaf first: then the bound is near to what it will be
        let own = i / LEAF_POINTS;
        let known = own as u32..own as u32 + 1;
        scan(self.lanes, leaf(columns, own), q, space, self.collect);
        let mut near = leaves.near(Box3::at(q), space, &known, self.stack);
        while let Some(found) = near.next(self.lanes, self.collect.bound()) {
            scan(self.lanes, leaf(columns, found as usize), q, space, self.collect);
        }
        match others {
            Some(others) => beyond(self.lanes, q, space, others, self.stack, self.lookup, self.collect),
            None => Ok(()),
        }
    }
}

/// Offers the points of other units.
#[inline(always)]
fn beyond(
    lanes: impl Compare,
    q: [i32; 3],
    space: &Space,
    Others { runs, unit }: Others<'_>,
    stack: &mut Vec<Waiting>,
    lookup: &mut Lookup,
    collect: &mut impl Collect,
) -> Result<(), ConvertError> {
    let own = runs.of(unit);
    let mut near = runs.boxes.near(Box3::at(q), space, &own, stack);
    while let Some(run) = near.next(lanes, collect.bound()) {
        if !own.contains(&run) {
            scan(lanes, lookup.columns(runs, run)?, q, space, collect);
        }
    }
    Ok(())
}

/// Offers some points.
#[inline(always)]
fn scan(lanes: impl Compare, [x, y, z]: [&[i32]; 3], q: [i32; 3], space: &Space, collect: &mut impl Collect) {
    let distance = |place: [i32; 3]| squared([0, 1, 2].map(|a| between(place[a], q[a])), space.scale);
    let ((xs, x_rest), (ys, y_rest), (zs, z_rest)) =
        (x.as_chunks::<LANES>(), y.as_chunks::<LANES>(), z.as_chunks::<LANES>());
    for ((x, y), z) in xs.iter().zip(ys).zip(zs) {
        let mut distances = [0.0; LANES];
        for (i, d) in distances.iter_mut().enumerate() {
            *d = distance([x[i], y[i], z[i]]);
        }
        let mut hits = lanes.at_most(&distances, collect.bound());
        while hits != 0 {
            let i = hits.trailing_zeros() as usize % LANES;
            hits &= hits - 1;
            if distances[i] <= collect.bound() {
                collect.offer(lanes, distances[i], [x[i], y[i], z[i]]);
            }
        }
    }
    for ((x, y), z) in x_rest.iter().zip(y_rest).zip(z_rest) {
        let d = distance([*x, *y, *z]);
        if d <= collect.bound() {
            collect.offer(lanes, d, [*x, *y, *z]);
        }
    }
}
