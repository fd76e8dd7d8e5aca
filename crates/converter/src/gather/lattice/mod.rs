//! The job lattice: the sources' own where they have one, else one that fits their coordinates.
//!
//! Per axis: never finer than what the sources resolve, never so coarse that a source loses what 31 bits could hold.

mod axis;
mod enough;
mod needs;
mod steps;

use pointmill_format::{Aabb, Lattice};

use self::axis::{AxisChoice, Room, choose};
use self::needs::{Knowledge, finest_of_sources, fixed_offset, needs};
use crate::cloud::{JobLattice, Stats};
use crate::error::{ConvertError, InputFault};
use crate::plan::{Plan, ScaleChoice};
use crate::reason::{AxisReason, Coarser, CoarserCause, LatticeBasis, LatticeReason};
use crate::sources::{Sources, tidy_product};

pub(super) use self::steps::ulp;

/// A step that could be this many times finer, had the headers been right, is worth a second read.
const WORTH_READING_AGAIN: f64 = 100.0;

/// A step more than this many times coarser than the sources' moves coordinates by more than one of theirs.
const COSTLY_STEPS: f64 = 2.0;

/// An axis that one step for all axes would leave with fewer steps than this has its own.
const FEWEST_STEPS: f64 = (1 << 20) as f64;

/// The same where z is the longest axis: x and y may be degrees.
const FEWEST_STEPS_OF_DEGREES: f64 = (1 << 26) as f64;

/// Steps of axes that differ by at most this factor become equal: the finest suits all.
const NEAR_STEPS: f64 = 1000.0;

/// The lattice for what the headers say.
pub(crate) fn from_headers(plan: &Plan, sources: &Sources) -> Result<JobLattice, ConvertError> {
    let chosen = choose_for(plan, sources, &Knowledge::of_headers(plan, sources));
    if !chosen.lattice.is_valid() {
        let cut = plan.filter.bounds.as_ref();
        let Aabb { min, max } = sources.bounds_hint(cut).unwrap_or(Aabb::EMPTY);
        return Err(InputFault::FarPoints { min, max }.into());
    }
    Ok(chosen)
}

/// True if headers already say that the step is coarser than the sources resolve, because the plan or the extent asks
/// for it: points that are apart may then fall together.
pub(crate) fn is_coarse(plan: &Plan, sources: &Sources) -> Result<bool, ConvertError> {
    let chosen = from_headers(plan, sources)?;
    let resolved = finest_of_sources(sources, &Knowledge::of_headers(plan, sources));
    let is_requested = matches!(plan.scale, ScaleChoice::Fixed(_));
    let is_coarse = |a: usize| match resolved[a] {
        Some(step) => chosen.lattice.scale[a] > step,
        None => is_requested || chosen.reason.axes[a].enough.is_some(),
    };
    Ok((0..3).any(is_coarse))
}

/// The lattice that the points ask for, now that they were read with `present`; `None` if `present` serves.
///
/// It must be coarser where integers or doubles do not hold the points. It is finer where a claim of the headers, or
/// of a sample, cost precision that the sources have.
pub(crate) fn settled(plan: &Plan, sources: &Sources, present: &JobLattice, stats: &Stats) -> Option<JobLattice> {
    let known = Knowledge::of_points(plan, sources, present, stats);
    let wanted = choose_for(plan, sources, &known);
    let resolved = finest_of_sources(sources, &known);
    let differs = |a: usize| {
        let (now, then) = (present.lattice.scale[a], wanted.lattice.scale[a]);
        let is_lost = resolved[a].is_none_or(|step| step < 0.75 * now);
        let is_imprecise = sources.tolerance.as_ref().is_some_and(|t| now > 2.0 * t.lattice[a]);
        let worth = match (known.is_broken(a) || is_imprecise, resolved[a]) {
            (true, _) => 1.0,
            (false, Some(_)) if is_lost => 1.5,
            _ => WORTH_READING_AGAIN,
        };
        known.room(a).certain > now || (then < now && then * worth <= now)
    };
    (wanted.lattice.is_valid() && (0..3).any(differs)).then_some(wanted)
}

/// By axis, what a lattice keeps of the precision of the sources.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Loss {
    /// All of it.
    Nothing,
    /// Less than they have: they resolve this step.
    Of(f64),
    /// They resolve more than is known.
    Unknown,
}

/// What `lattice` would lose of the points that were read with `present`.
pub(super) fn losses(
    plan: &Plan,
    sources: &Sources,
    present: &JobLattice,
    lattice: &JobLattice,
    stats: &Stats,
) -> [Loss; 3] {
    let known = Knowledge::of_points(plan, sources, present, stats);
    let resolved = finest_of_sources(sources, &known);
    std::array::from_fn(|a| {
        // a step that was requested is no loss, one that had to be coarser is
        let reason = lattice.reason.axes[a];
        let is_fixed = matches!(plan.scale, ScaleChoice::Fixed(_)) && reason.coarser.is_none();
        let is_requested = is_fixed || reason.enough.is_some();
        match resolved[a] {
            _ if is_requested => Loss::Nothing,
            Some(step) if lattice.lattice.scale[a] > COSTLY_STEPS * step => Loss::Of(step),
            Some(_) => Loss::Nothing,
            None => Loss::Unknown,
        }
    })
}

/// The lattice for the points of `stats`, read with `present`, that are inside a box.
pub(super) fn inside(plan: &Plan, sources: &Sources, present: &JobLattice, stats: &Stats, bounds: &Aabb) -> JobLattice {
    choose_for(plan, sources, &Knowledge::of_points(plan, sources, present, stats).inside(bounds))
}

fn choose_for(plan: &Plan, sources: &Sources, known: &Knowledge<'_>) -> JobLattice {
    let rooms = shared_rooms(known);
    if let ScaleChoice::Fixed(step) = plan.scale {
        return requested(step, sources, rooms);
    }
    let choices = std::array::from_fn(|a| choose(&needs(sources, known, a), rooms[a]));
    let mut choices = equal_where_possible(choices, rooms);
    if let Some(tolerance) = &sources.tolerance {
        choices.iter_mut().zip(tolerance.lattice).for_each(|(choice, allowed)| enough::coarsen(choice, allowed));
    }
    let lattice = Lattice { scale: choices.map(|c| c.grid.step), offset: choices.map(|c| c.grid.offset) };
    JobLattice { lattice, reason: LatticeReason { axes: choices.map(|c| c.reason) } }
}

/// The step of the plan on all axes, unless it is finer than integers or doubles allow.
fn requested(step: f64, sources: &Sources, rooms: [Room; 3]) -> JobLattice {
    let offset = std::array::from_fn(|a| fixed_offset(sources, a, step));
    let mut made = JobLattice {
        lattice: Lattice { scale: [step; 3], offset },
        reason: LatticeReason::of_all(LatticeBasis::Requested),
    };
    let certain = rooms.iter().map(|r| r.certain).fold(0.0, f64::max);
    let factor = steps::times_coarser(certain / step);
    if factor > 1.0 {
        let by_doubles = rooms.iter().any(|r| r.doubles >= certain);
        let cause = if by_doubles { CoarserCause::Doubles } else { CoarserCause::Extent };
        let reason =
            AxisReason { basis: LatticeBasis::Requested, coarser: Some(Coarser { factor, cause }), enough: None };
        made.lattice.scale = [tidy_product(step, factor); 3];
        made.reason.axes = [reason; 3];
    }
    made
}

/// The room of each axis. Where steps are chosen freely all axes have that of the longest one, since equal steps are
/// the fastest, unless an axis would lose by it.
fn shared_rooms(known: &Knowledge<'_>) -> [Room; 3] {
    let mut rooms = [0, 1, 2].map(|a| known.room(a));
    let extent = |a: usize| known.all[a].extent;
    let longest = [0, 1, 2].map(extent).into_iter().fold(0.0, f64::max);
    let fewest = if extent(2) >= longest { FEWEST_STEPS_OF_DEGREES } else { FEWEST_STEPS };
    let widest = rooms.iter().map(|r| r.wished).fold(0.0, f64::max);
    for (a, room) in rooms.iter_mut().enumerate() {
        if extent(a) == 0.0 || extent(a) / widest >= fewest || extent(a) >= longest {
            room.wished = widest;
        }
    }
    rooms
}

/// Axes that ask for nothing take the step of the others; steps that sources do not prescribe become equal where the
/// finest fits all, since the octree of equal steps is the fastest.
fn equal_where_possible(mut choices: [AxisChoice; 3], rooms: [Room; 3]) -> [AxisChoice; 3] {
    let finest =
        choices.iter().filter(|c| !c.is_free).copied().reduce(|a, b| if b.grid.step < a.grid.step { b } else { a });
    let Some(finest) = finest else { return choices };
    for (choice, room) in choices.iter_mut().zip(rooms) {
        if choice.is_free && room.certain <= finest.grid.step {
            (choice.grid.step, choice.reason) = (finest.grid.step, finest.reason);
        }
    }
    let steps = choices.map(|c| pointmill_format::AxisGrid { step: c.grid.step, offset: 0.0 });
    let is_binary = choices.iter().all(|c| (c.grid.step / finest.grid.step).log2().fract() == 0.0);
    if is_binary || choices.iter().any(|c| c.is_prescribed) {
        return choices;
    }
    if let Some(common) = pointmill_format::AxisGrid::common(&steps)
        && (0..3).all(|a| common.step >= rooms[a].certain && steps[a].step <= common.step * NEAR_STEPS)
    {
        choices.iter_mut().for_each(|c| c.grid.step = common.step);
    }
    choices
}

#[cfg(test)]
mod tests;
