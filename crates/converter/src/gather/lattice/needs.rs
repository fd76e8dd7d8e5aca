//! What the sources ask of a lattice, from what is known of them.

use pointmill_format::{Aabb, AxisGrid, Lattice};

use super::axis::{GridOrigin, Need, Reach, Room};
use crate::cloud::{JobLattice, SourceStats, Stats};
use crate::plan::Plan;
use crate::sources::{Fineness, Source, Sources, intersection, single_step};

/// The true box of a sampled scan is larger, though hardly twice as large.
const SAMPLE_MARGIN: f64 = 2.0;

/// What is known of the points: by headers and samples, or because they were read.
pub(super) struct Knowledge<'a> {
    sources: &'a Sources,
    /// By source; `None`: none was read.
    seen: Option<&'a [SourceStats]>,
    /// Points outside are left out.
    cuts: Vec<Aabb>,
    /// Of all points, as far as anything says.
    pub(super) all: [Reach; 3],
    /// Of those for which no header's word is taken.
    certain: [Reach; 3],
}

impl<'a> Knowledge<'a> {
    /// What the headers declare and samples show. Declared bounds never make a prescribed step coarser: they may lie.
    pub(super) fn of_headers(plan: &Plan, sources: &'a Sources) -> Self {
        let nothing = [Reach::default(); 3];
        let cuts = plan.filter.bounds.into_iter().collect();
        let mut known = Self { sources, seen: None, cuts, all: nothing, certain: nothing };
        let (mut all, mut seen, mut is_sampled) = (Aabb::EMPTY, Aabb::EMPTY, false);
        for (i, source) in sources.all.iter().enumerate() {
            if let Some(lattice) = source.stored.lattice {
                for (reach, offset) in known.certain.iter_mut().zip(lattice.offset) {
                    reach.farthest = reach.farthest.max(offset.abs());
                }
            }
            let bounds = known.bounds(i);
            if bounds.is_empty() {
                continue;
            }
            all = all.union(&bounds);
            let is_own = source.stored.lattice.is_none() && source.bounds_declared.is_none();
            is_sampled |= source.extent.is_some_and(|e| e.is_sampled);
            if is_own {
                seen = seen.union(&bounds);
            }
        }
        for (a, certain) in known.certain.iter_mut().enumerate() {
            let own = Reach::of(&seen, a);
            *certain = Reach { extent: own.extent, farthest: certain.farthest.max(own.farthest) };
        }
        let margin = if is_sampled { SAMPLE_MARGIN } else { 1.0 };
        known.all = [0, 1, 2].map(|a| Reach::of(&all, a)).map(|r| Reach { extent: margin * r.extent, ..r });
        known
    }

    /// What is known once every point was read onto the lattice `present`.
    pub(super) fn of_points(plan: &Plan, sources: &'a Sources, present: &JobLattice, stats: &'a Stats) -> Self {
        let lattice = &present.lattice;
        let (min, max) = (lattice.world(stats.bounds.min.0), lattice.world(stats.bounds.max.0));
        let mut all = [0, 1, 2].map(|a| Reach::of(&Aabb { min, max }, a));
        // decoding adds the offset, however near 0 the sum is
        for source in &sources.all {
            if let Some(own) = source.stored.lattice {
                all.iter_mut().zip(own.offset).for_each(|(r, offset)| r.farthest = r.farthest.max(offset.abs()));
            }
        }
        let cuts = plan.filter.bounds.into_iter().collect();
        Self { sources, seen: Some(&stats.sources), cuts, all, certain: all }
    }

    /// The same, if only the points inside a box were there.
    pub(super) fn inside(mut self, bounds: &Aabb) -> Self {
        self.cuts.push(*bounds);
        let all = [0, 1, 2].map(|a| Reach::of(bounds, a));
        Self { all, certain: all, ..self }
    }

    /// Of a source, cut by the filter; empty: unknown.
    fn bounds(&self, source: usize) -> Aabb {
        let bounds = match self.seen {
            Some(seen) => seen[source].bounds,
            None => self.sources.all[source].extent.map_or(Aabb::EMPTY, |e| e.bounds),
        };
        self.cuts.iter().fold(bounds, |bounds, cut| intersection(&bounds, cut))
    }

    /// True if a point of a source contradicted its grid.
    fn is_off_grid(&self, source: usize, axis: usize) -> bool {
        self.seen.is_some_and(|seen| seen[source].off_grid[axis])
    }

    /// The least steps for an axis.
    pub(super) fn room(&self, axis: usize) -> Room {
        Room::new(self.all[axis], self.certain[axis])
    }

    /// True if a point contradicted the grid of a source.
    pub(super) fn is_broken(&self, axis: usize) -> bool {
        self.seen.is_some_and(|seen| seen.iter().any(|source| source.off_grid[axis]))
    }

    fn farthest(&self, source: usize, axis: usize) -> f64 {
        Reach::of(&self.bounds(source), axis).farthest
    }
}

/// What the sources ask of an axis, in their order; what neighbours have in common once.
pub(super) fn needs(sources: &Sources, known: &Knowledge<'_>, axis: usize) -> Vec<Need> {
    let mut needs = Vec::new();
    for (i, source) in sources.all.iter().enumerate() {
        let need = need(source, known, i, axis);
        if needs.last() != Some(&need) {
            needs.push(need);
        }
    }
    needs
}

fn need(source: &Source, known: &Knowledge<'_>, i: usize, axis: usize) -> Need {
    let lattice = source.stored.lattice;
    let own = |l: Lattice| AxisGrid { step: l.scale[axis], offset: l.offset[axis] };
    match (source.stored.fineness[axis], lattice) {
        (Fineness::Grid { is_claim: true, .. }, Some(lattice)) if known.is_off_grid(i, axis) => {
            Need::Grid { grid: own(lattice), origin: GridOrigin::Lattice }
        }
        (Fineness::Grid { is_claim: true, .. }, None) if known.is_off_grid(i, axis) => Need::Finest,
        (Fineness::Grid { grid, is_claim: false }, _) => Need::Grid { grid, origin: GridOrigin::Lattice },
        (Fineness::Grid { grid, .. }, Some(_)) => Need::Grid { grid, origin: GridOrigin::Divisor },
        (Fineness::Grid { grid, .. }, None) => {
            let is_stated = matches!(source.stored.resolution[axis], pointmill_format::Resolution::Grid(_));
            let origin = if is_stated { GridOrigin::Stated } else { GridOrigin::Decimals };
            Need::Grid { grid, origin }
        }
        (Fineness::Step(step), _) => Need::Step(step),
        (Fineness::Single, _) => {
            let farthest = known.farthest(i, axis);
            single_step(farthest).map_or(Need::Nothing, |step| Need::Single { step, farthest })
        }
        (Fineness::Double, _) if known.bounds(i).is_empty() => Need::Nothing,
        (Fineness::Double, _) => Need::Finest,
    }
}

/// The finest step that a source resolves, by axis; `None` where one resolves more than is known.
pub(super) fn finest_of_sources(sources: &Sources, known: &Knowledge<'_>) -> [Option<f64>; 3] {
    std::array::from_fn(|a| {
        let mut finest = f64::INFINITY;
        for need in needs(sources, known, a) {
            finest = finest.min(match need {
                Need::Grid { grid, .. } => grid.step,
                Need::Step(step) | Need::Single { step, .. } => step,
                Need::Finest => return None,
                Need::Nothing => continue,
            });
        }
        Some(finest)
    })
}

/// 0 where it is a point of every source's grid of that step, so that sources of any kind give the same lattice; else
/// the least of their offsets.
pub(super) fn fixed_offset(sources: &Sources, axis: usize, step: f64) -> f64 {
    let offset = |s: &Source| match s.stored.fineness[axis] {
        Fineness::Grid { grid, .. } => Some(grid.offset),
        _ => None,
    };
    let offsets: Vec<f64> = sources.all.iter().filter_map(offset).collect();
    let is_whole = |o: &f64| (o / step - (o / step).round()).abs() <= 1e-6;
    if offsets.iter().all(is_whole) { 0.0 } else { offsets.into_iter().fold(f64::INFINITY, f64::min) }
}
