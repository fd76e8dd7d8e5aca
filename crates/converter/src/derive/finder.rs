//! The surfaces through the points of a unit: a thread's part of the work.

use std::ops::Range;

use super::boxes::{Box3, Boxes, Waiting};
use super::collect::Collect;
use super::runs::{Lookup, Runs};
use super::space::{Space, between, squared};
use super::surface::Surface;
use crate::error::ConvertError;
use crate::runtime::{Compare, LANES, Portable, Workers};

/// Points of a leaf of the hierarchy over a unit: two vectors of single precision.
const LEAF_POINTS: usize = 16;

/// Points after which a thread looks whether the run is to stop: few, since all of a cloud may be within a distance of each.
const POINTS_PER_LOOK: usize = 32;

/// What is known of the points outside of a unit.
#[derive(Clone, Copy)]
pub(super) struct Others<'a> {
    pub(super) runs: &'a Runs,
    pub(super) unit: usize,
}

/// Points that are reported together.
const POINTS_PER_STEP: usize = 512;

/// A thread's memory.
pub(super) struct Finder {
    /// Coordinates of the points of the unit, in Morton order.
    pub(super) columns: [Vec<i32>; 3],
    /// By point.
    pub(super) surfaces: Vec<Surface>,
    leaves: Boxes,
    stack: Vec<Waiting>,
    lookup: Lookup,
}

impl Finder {
    pub(super) fn new() -> Self {
        let columns = std::array::from_fn(|_| Vec::new());
        Self { columns, surfaces: Vec::new(), leaves: Boxes::default(), stack: Vec::new(), lookup: Lookup::new() }
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
        let leaf = |i: usize| i * LEAF_POINTS..((i + 1) * LEAF_POINTS).min(points);
        let columns = self.columns.each_ref().map(Vec::as_slice);
        let of = |range: Range<usize>| columns.map(|axis| &axis[range.clone()]);
        self.leaves.build((0..points.div_ceil(LEAF_POINTS)).map(|i| Box3::of(of(leaf(i)))));
        self.surfaces.clear();
        self.surfaces.reserve(points);
        let mut before: Option<([i32; 3], Surface)> = None;
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
            collect.begin(q, step);
            // its own leaf first: then the bound is near to what it will be
            let own = i / LEAF_POINTS;
            let known = own as u32..own as u32 + 1;
            scan(lanes, of(leaf(own)), q, space, collect);
            let mut near = self.leaves.near(q, space, &known, &mut self.stack);
            while let Some(run) = near.next(lanes, collect.bound()) {
                scan(lanes, of(leaf(run as usize)), q, space, collect);
            }
            if let Some(others) = others {
                beyond(lanes, q, space, others, &mut self.stack, &mut self.lookup, collect)?;
            }
            let surface = collect.surface(space);
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
    let mut near = runs.boxes.near(q, space, &own, stack);
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
