//! From sources to the cloud: every point decoded once, put on the lattice of the run, and kept in blocks of records
//! that are grouped by the cells of a coarse grid, in memory or in one spill file.
//!
//! Headers choose the lattice and the grid before the first point is read. Where the points have another cube than headers
//! promise, or nothing is promised, records are grouped by its cells once all are in. Where they need another lattice, or do
//! not fit the integers of records, the pass is repeated; each pass makes its own store, and the one that succeeds makes
//! the cloud.

mod assemble;
mod axis;
mod batch;
mod census;
mod columns;
mod context;
mod cut;
mod exact;
mod fallen;
mod far;
mod lattice;
mod loose;
mod moved;
mod origins;
mod outliers;
mod partition;
mod pass;
mod places;
mod ranges;
mod read_unit;
mod select;
mod unit_check;
mod views;
mod visit;

use std::sync::Arc;

use pointmill_format::{Aabb, AxisGrid, Lattice, ReadError};

pub(crate) use assemble::Rows;
pub(crate) use axis::Moved;
pub(crate) use batch::{quantize_axis, stored_columns};
pub(crate) use columns::Part;
pub(crate) use context::Demand;
pub(crate) use lattice::{from_headers, is_coarse, settled};
pub(crate) use moved::is_more_than_rounding as moves;
pub(crate) use select::select;
pub(crate) use visit::{Reading, Visit};

use crate::cloud::{
    Census, CensusCell, Cloud, Gathered, Intake, JobBounds, JobLattice, JobPoint, MOST_STEPS, SharedPlace, Stats,
};
use crate::error::{ConvertError, InputFault, Unsupported};
use crate::job::{self, Keeper};
use crate::plan::{OriginPoints, Outliers, Plan, ScaleChoice};
use crate::runtime::{Clock, Phase, Runtime};
use crate::sources::{Fineness, Sources, far_out, intersection};
use crate::warning::Warning;
use far::FarPoints;
use lattice::Loss;
use partition::Hint;
use pass::{Pass, PassEnd};

/// Headers may mislead once about the bounds, and the bounds may then ask for a coarser lattice.
const MAX_PASSES: u32 = 5;

/// Outliers make the extent at least this many times longer.
const FAR_OUTSIDE: f64 = 10.0;

/// Fewer steps than this over the extent of a scene are a loss whatever the sources resolve; with more it has none that
/// a scene needs.
const FEWEST_STEPS: f64 = (1 << 20) as f64;

/// The same where the sources are known to resolve more.
const FEWEST_KNOWN_STEPS: f64 = (1 << 22) as f64;

/// Reads every point once; again only if the headers were wrong about the bounds. `warnings`: those so far. What a job has is not
/// read again.
#[allow(clippy::too_many_arguments)]
pub(crate) fn gather<'a>(
    plan: &'a Plan,
    sources: &'a Sources,
    intake: &'a Intake,
    demand: Demand,
    mut warnings: Vec<Warning>,
    keeper: Option<Keeper<'_>>,
    rt: &Runtime<'_>,
    clock: &mut Clock<'_>,
) -> Result<Cloud<'a>, ConvertError> {
    let mut lattice = from_headers(plan, sources)?;
    let hint = sources.bounds_hint(plan.filter.bounds.as_ref());
    // What a box cuts has other bounds than the box, as a rule.
    let is_promise = sources.declares_bounds() && plan.filter.bounds.is_none();
    let mut hint = hint.map(|bounds| Hint { bounds: quantized(&lattice.lattice, &bounds), is_promise });
    let mut far_cut = None;
    for pass in 1..=MAX_PASSES {
        clock.begin(Phase::Read, sources.points_declared);
        let is_said = warnings.iter().any(|w| matches!(w, Warning::CoarserStep { .. } | Warning::FinerStep { .. }));
        let mut warn = |warning: Warning| {
            rt.warn(&warning);
            warnings.push(warning);
        };
        let (misled, complete) =
            match Pass::new(plan, sources, intake, demand, &lattice, hint, far_cut, pass, keeper, rt)?.run()? {
                PassEnd::Empty(stats) => return Err(nothing_to_convert(sources, &stats)),
                PassEnd::Misled(stats) => (Some(stats), None),
                PassEnd::Complete(mut gathered) => {
                    // a step that was requested may put points together that the sources have apart
                    if gathered.is_lossless || plan.scale == ScaleChoice::Auto {
                        find_shared_places(&mut gathered, keeper, rt)?;
                    }
                    (None, Some(gathered))
                }
            };
        let Some(stats) = misled.as_deref().or(complete.as_deref().map(|gathered| &gathered.stats)) else { continue };
        let settled = lattice::settled(plan, sources, &lattice, stats);
        let read = Read { lattice: &lattice, stats, complete: complete.as_deref(), settled: settled.as_ref() };
        // what was settled of this pass is how others learn what follows from it
        let end_pass = |is_complete: bool| match keeper.and_then(Keeper::shared).filter(|_| is_complete) {
            Some(job) => job.end_settling(),
            None => Ok(()),
        };
        if far_cut.is_none()
            && let Some((others, points, without)) = read.without_outliers(plan, sources, rt)?
        {
            end_pass(complete.is_some())?;
            warn(Warning::OutliersDropped { points, others });
            hint = Some(Hint { bounds: quantized(&without.lattice, &others), is_promise: false });
            (far_cut, lattice) = (Some(others), without);
            continue;
        }
        read.refuse_far_out()?;
        let bounds = settled.as_ref().map_or(stats.bounds, |other| measured(plan, &other.lattice, stats, far_cut));
        match (settled, complete) {
            (Some(other), None) => {
                warn(change_of_step(&lattice, &other));
                hint = Some(Hint { bounds, is_promise: true });
                lattice = other;
            }
            (Some(other), Some(_)) if pass < MAX_PASSES => {
                end_pass(true)?;
                warn(change_of_step(&lattice, &other));
                hint = Some(Hint { bounds, is_promise: true });
                lattice = other;
            }
            (None, None) => {
                warn(Warning::ReadAgain);
                hint = Some(Hint { bounds, is_promise: true });
            }
            (_, Some(mut gathered)) => {
                if let Some(mark) = intake.mark {
                    let count = || fallen::count(&gathered, mark);
                    let can_be = |fallen: &Option<u64>| fallen.is_none_or(|points| points <= gathered.stats.points);
                    let fallen = job::settled(keeper, "fallen", &gathered.store, can_be, count)?;
                    gathered.stats.fallen_together = fallen;
                }
                if gathered.lattice.reason.is_forced_coarser() && !is_said {
                    let (scale, reason) = (gathered.lattice.lattice.scale, gathered.lattice.reason);
                    warn(Warning::CoarserStep { scale, reason });
                }
                finishing_warnings(plan, sources, &gathered).into_iter().for_each(&mut warn);
                let known = warnings.len() + gathered.stats.skipped.len();
                let cloud = Cloud::new(plan, sources, intake, *gathered, far_cut, warnings)?;
                cloud.warnings[known..].iter().for_each(|w| rt.warn(w));
                return Ok(cloud);
            }
        }
    }
    Err(Unsupported::TooFarApart.into())
}

/// Finds places that very many points share.
fn find_shared_places(
    gathered: &mut Gathered,
    keeper: Option<Keeper<'_>>,
    rt: &Runtime<'_>,
) -> Result<(), ConvertError> {
    let store = Arc::clone(&gathered.store);
    let points = gathered.stats.points;
    let can_be = |(places, Census { cells, bounds }): &(Vec<SharedPlace>, Census)| {
        let is_box = |place: &JobBounds| (0..3).all(|a| place.min[a] <= place.max[a]);
        places.iter().all(|place| place.points <= points)
            && CensusCell::can_be_of(cells, points)
            && bounds.values().all(is_box)
    };
    (gathered.shared_places, gathered.census) = job::settled(keeper, "places", &store, can_be, || {
        let places = places::find(gathered, rt)?;
        Ok((places, std::mem::take(&mut gathered.census)))
    })?;
    Ok(())
}

/// What there is to say of the points once all are in.
fn finishing_warnings(plan: &Plan, sources: &Sources, gathered: &Gathered) -> Vec<Warning> {
    let mut warnings = odd_places(plan, sources, gathered);
    if let Some(outliers) = outliers::find(gathered) {
        warnings.push(outliers.warning(gathered.lattice.is_held_back()));
    }
    for (source, stats) in sources.all.iter().zip(&gathered.stats.sources) {
        if let Some(resolution) = source.stored.coarse_single(&stats.bounds) {
            warnings.push(Warning::CoarseSingle { path: source.path.to_path_buf(), resolution });
        }
    }
    warnings
}

/// What there is to say of points at the origins of scans, and of places that very many points share.
fn odd_places(plan: &Plan, sources: &Sources, gathered: &Gathered) -> Vec<Warning> {
    let seen = sources.all.iter().zip(&gathered.stats.sources);
    let known = seen.clone().filter(|(source, _)| !source.origins.is_empty());
    let (points, of) = known.fold((0, 0), |(points, of), (_, s)| (points + s.at_origin, of + s.read));
    let mut warnings = Vec::new();
    if plan.filter.origin_points == OriginPoints::Keep && places::are_many_at_origin(points, of) {
        warnings.push(Warning::OriginPoints { points, of });
    }
    // What was just said is not said again.
    let step = gathered.lattice.lattice.scale;
    let is_near = |place: [f64; 3], origin: &[f64; 3]| (0..3).all(|a| (place[a] - origin[a]).abs() <= step[a]);
    let origins = sources.all.iter().flat_map(|source| &source.origins);
    let is_new = |place: &&SharedPlace| !origins.clone().any(|origin| is_near(place.position, origin));
    let new: Vec<&SharedPlace> = gathered.shared_places.iter().filter(is_new).collect();
    if let Some((SharedPlace { position, points }, more)) = new.split_first() {
        let (position, points, of, more) = (*position, *points, gathered.stats.points, more.len());
        let mut unknown = seen.filter(|(source, _)| source.origins.is_empty());
        let at_origin = position == [0.0; 3] && unknown.any(|(_, s)| s.at_origin > 0);
        warnings.push(Warning::SharedPlace { position, points, of, more, at_origin });
    }
    warnings
}

/// A pass over the sources, and what follows from it.
struct Read<'a> {
    lattice: &'a JobLattice,
    stats: &'a Stats,
    complete: Option<&'a Gathered>,
    settled: Option<&'a JobLattice>,
}

impl Read<'_> {
    /// Where points far from all others are to be dropped: the box of the others, the number of those outside, and the
    /// lattice without them.
    ///
    /// # Errors
    /// Such points cost precision, and the plan is to fail at that.
    fn without_outliers(
        &self,
        plan: &Plan,
        sources: &Sources,
        rt: &Runtime<'_>,
    ) -> Result<Option<(Aabb, u64, JobLattice)>, ConvertError> {
        if plan.outliers == Outliers::Keep {
            return Ok(None);
        }
        if let Some((far, without, axis)) = self.costly_outliers(plan, sources, rt)? {
            let (FarPoints { points, others }, step) = (far, self.settled.unwrap_or(self.lattice).lattice.scale);
            if plan.outliers == Outliers::Fail {
                let (step, without) = (step[axis], without.lattice.scale[axis]);
                return Err(InputFault::CostlyOutliers { points, others, axis, step, without }.into());
            }
            return Ok(Some((others, points, without)));
        }
        // those that cost levels of the tree alone
        let found = self.complete.filter(|_| plan.outliers == Outliers::Drop).and_then(outliers::find);
        Ok(found.map(|outliers| {
            let others = outliers.others();
            (others, outliers.points, lattice::inside(plan, sources, self.lattice, self.stats, &others))
        }))
    }

    /// Points so far from all others that these lose precision, the lattice without them, and the axis that loses most.
    fn costly_outliers(
        &self,
        plan: &Plan,
        sources: &Sources,
        rt: &Runtime<'_>,
    ) -> Result<Option<(FarPoints, JobLattice, usize)>, ConvertError> {
        let next = self.settled.unwrap_or(self.lattice);
        let losses = lattice::losses(plan, sources, self.lattice, next, self.stats);
        let is_crowded = || self.complete.is_some_and(|g| g.census.cells.iter().any(|c| 2 * c.points > g.stats.points));
        let is_suspect = |loss: &Loss| match loss {
            Loss::Nothing => false,
            Loss::Of(_) => true,
            Loss::Unknown => is_crowded(),
        };
        if !self.is_far_out() && !losses.iter().any(is_suspect) {
            return Ok(None);
        }
        let enough = losses.map(|loss| match loss {
            Loss::Of(step) => step * MOST_STEPS,
            Loss::Nothing => f64::INFINITY,
            Loss::Unknown => 0.0,
        });
        let Some(far) = far::find(sources, plan.filter.bounds.as_ref(), enough, rt)? else { return Ok(None) };
        let without = lattice::inside(plan, sources, self.lattice, self.stats, &far.others);
        let (extent, (min, max)) = (far.others.extent(), self.corners());
        let costs = |a: usize| {
            let (step, finer) = (next.lattice.scale[a], without.lattice.scale[a]);
            let is_far = extent[a] * FAR_OUTSIDE <= max[a] - min[a];
            let fewest = if losses[a] == Loss::Unknown { FEWEST_STEPS } else { FEWEST_KNOWN_STEPS };
            is_far && step > finer && step * fewest > extent[a]
        };
        let gain = |a: &usize| next.lattice.scale[*a] / without.lattice.scale[*a];
        let axis = (0..3).filter(|a| costs(*a)).max_by(|a, b| gain(a).total_cmp(&gain(b)));
        let axis = axis.or_else(|| self.is_far_out().then(|| (0..3).max_by(|a, b| gain(a).total_cmp(&gain(b))))?);
        Ok(axis.map(|axis| (far, without, axis)))
    }

    /// The least and the greatest coordinates.
    fn corners(&self) -> ([f64; 3], [f64; 3]) {
        let lattice = &self.lattice.lattice;
        (lattice.world(self.stats.bounds.min.0), lattice.world(self.stats.bounds.max.0))
    }

    fn is_far_out(&self) -> bool {
        let (min, max) = self.corners();
        far_out(&Aabb { min, max })
    }

    fn refuse_far_out(&self) -> Result<(), ConvertError> {
        let (min, max) = self.corners();
        if self.is_far_out() { Err(InputFault::FarPoints { min, max }.into()) } else { Ok(()) }
    }
}

fn change_of_step(before: &JobLattice, after: &JobLattice) -> Warning {
    let (then, now) = (before.lattice.scale, after.lattice.scale);
    let (scale, reason) = (now, after.reason);
    if (0..3).any(|a| now[a] < then[a]) {
        Warning::FinerStep { scale, reason }
    } else {
        Warning::CoarserStep { scale, reason }
    }
}

/// The box of all points that passed the filter's box, on a lattice.
fn measured(plan: &Plan, lattice: &Lattice, stats: &Stats, far_cut: Option<Aabb>) -> JobBounds {
    let all = stats.sources.iter().fold(Aabb::EMPTY, |all, s| all.union(&s.bounds));
    let cuts = plan.filter.bounds.iter().chain(&far_cut);
    quantized(lattice, &cuts.fold(all, |all, cut| intersection(&all, cut)))
}

/// True if every position of the sources is a point of the lattice, as far as is known.
pub(crate) fn is_lossless(sources: &Sources, lattice: &JobLattice) -> bool {
    let Lattice { scale, offset } = lattice.lattice;
    let is_held = |a: usize, fineness: Fineness| match fineness {
        Fineness::Grid { grid, .. } => AxisGrid { step: scale[a], offset: offset[a] }.holds(&grid),
        Fineness::Step(_) | Fineness::Single | Fineness::Double => false,
    };
    sources.all.iter().all(|s| (0..3).all(|a| is_held(a, s.stored.fineness[a])))
}

/// A box of the world on a lattice.
pub(crate) fn quantized(lattice: &Lattice, bounds: &Aabb) -> JobBounds {
    let at = |corner: [f64; 3]| JobPoint(std::array::from_fn(|a| lattice.quantize(a, corner[a])));
    JobBounds { min: at(bounds.min), max: at(bounds.max) }
}

pub(crate) fn nothing_to_convert(sources: &Sources, stats: &Stats) -> ConvertError {
    let read: u64 = stats.sources.iter().map(|s| s.read).sum();
    match sources.all.as_slice() {
        [first, others @ ..] if read == 0 => {
            let others = match others.len() {
                0 => String::new(),
                n => format!(", nor do {n} more inputs"),
            };
            let what = format!("holds no points up to its end{others}");
            ReadError::broken(&first.path, first.file_bytes, what).advise("there is nothing to convert").into()
        }
        _ => {
            let Stats { outside_bounds, other_class, thinned, invalid, origin_skipped: at_origin, .. } = *stats;
            InputFault::NothingLeft { read, outside_bounds, other_class, thinned, invalid, at_origin }.into()
        }
    }
}
