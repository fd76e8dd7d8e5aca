//! From sources to the cloud: every point decoded once, put on the lattice of the run, and kept in blocks of records
//! that are grouped by the cells of a coarse grid, in memory or in one spill file.
//!
//! Headers choose the lattice and the grid before the first point is read. Where the points prove them wrong, the pass is
//! repeated with another lattice or the measured bounds; each pass makes its own, and the one that succeeds makes the
//! cloud.

mod axis;
mod batch;
mod columns;
mod context;
mod cut;
mod exact;
mod lattice;
mod origins;
mod outliers;
mod partition;
mod pass;
mod places;
mod ranges;
mod select;

use pointmill_format::{Aabb, AxisGrid, Lattice, ReadError};

pub(crate) use context::Demand;
pub(crate) use lattice::from_headers;

use crate::cloud::{Cloud, Gathered, Intake, JobBounds, JobLattice, JobPoint, SharedPlace, Stats};
use crate::error::{ConvertError, InputFault, Unsupported};
use crate::plan::{OriginPoints, Plan};
use crate::runtime::{Clock, Phase, Runtime};
use crate::sources::{Fineness, Sources, far_out, intersection};
use crate::warning::Warning;
use origins::Origins;
use pass::{Pass, PassEnd};

/// Headers may mislead once about the bounds, and the bounds may then ask for a coarser lattice.
const MAX_PASSES: usize = 4;

/// Reads every point once; again only if the headers were wrong about the bounds.
pub(crate) fn gather<'a>(
    plan: &'a Plan,
    sources: &'a Sources,
    intake: &'a Intake,
    demand: Demand,
    rt: &Runtime<'_>,
    clock: &mut Clock<'_>,
) -> Result<Cloud<'a>, ConvertError> {
    let mut warnings = sources.warnings.clone();
    let mut lattice = from_headers(plan, sources)?;
    let hint = sources.bounds_hint(plan.filter.bounds.as_ref());
    let mut hint = hint.map(|bounds| quantized(&lattice.lattice, &bounds));
    for pass in 1..=MAX_PASSES {
        clock.begin(Phase::Read, sources.points_declared);
        let mut warn = |warning: Warning| {
            rt.warn(&warning);
            warnings.push(warning);
        };
        let (stats, complete) = match Pass::new(plan, sources, intake, demand, &lattice, hint, rt).run()? {
            PassEnd::Empty(stats) => return Err(nothing_to_convert(sources, &stats)),
            PassEnd::Misled(stats) => (stats, None),
            PassEnd::Complete(gathered) => (Box::new(gathered.stats.clone()), Some(gathered)),
        };
        let settled = settled(plan, sources, &lattice, &stats)?;
        match (settled, complete) {
            (Some(other), None) => {
                warn(change_of_step(&lattice, &other));
                hint = Some(measured(plan, &other.lattice, &stats));
                lattice = other;
            }
            (Some(other), Some(_)) if pass < MAX_PASSES => {
                warn(change_of_step(&lattice, &other));
                hint = Some(measured(plan, &other.lattice, &stats));
                lattice = other;
            }
            (None, None) => {
                warn(Warning::ReadAgain);
                hint = Some(stats.bounds);
            }
            (_, Some(mut gathered)) => {
                gathered.shared_places = places::find(&mut gathered)?;
                odd_places(plan, sources, &gathered).into_iter().for_each(&mut warn);
                if let Some(outliers) = outliers::find(&gathered) {
                    warn(outliers.warning(gathered.lattice.is_held_back()));
                }
                for (source, stats) in sources.all.iter().zip(&gathered.stats.sources) {
                    if let Some(resolution) = source.survey.coarse_single(&stats.bounds) {
                        warn(Warning::CoarseSingle { path: source.scan.info().path.clone(), resolution });
                    }
                }
                let known = warnings.len() + gathered.stats.warnings.len();
                let cloud = Cloud::new(plan, sources, intake, *gathered, warnings)?;
                cloud.warnings[known..].iter().for_each(|w| rt.warn(w));
                return Ok(cloud);
            }
        }
    }
    Err(Unsupported::TooFarApart.into())
}

/// What there is to say of points at the origins of scans, and of places that very many points share.
fn odd_places(plan: &Plan, sources: &Sources, gathered: &Gathered) -> Vec<Warning> {
    let origins: Vec<Origins> = sources.all.iter().map(|s| Origins::of(s.scan.info())).collect();
    let (known, unknown): (Vec<_>, Vec<_>) =
        origins.iter().zip(&gathered.stats.sources).partition(|(origins, _)| origins.are_known);
    let mut warnings = Vec::new();
    let (points, of) = known.iter().fold((0, 0), |(points, of), (_, s)| (points + s.at_origin, of + s.read));
    if plan.filter.origin_points == OriginPoints::Keep && places::are_many_at_origin(points, of) {
        warnings.push(Warning::OriginPoints { points, of });
    }
    // What was just said is not said again.
    let step = gathered.lattice.lattice.scale;
    let is_new = |place: &&SharedPlace| known.iter().all(|(origins, _)| !origins.are_near(place.position, step));
    let new: Vec<&SharedPlace> = gathered.shared_places.iter().filter(is_new).collect();
    if let Some((SharedPlace { position, points }, more)) = new.split_first() {
        let (position, points, of, more) = (*position, *points, gathered.stats.points, more.len());
        let at_origin = position == [0.0; 3] && unknown.iter().any(|(_, s)| s.at_origin > 0);
        warnings.push(Warning::SharedPlace { position, points, of, more, at_origin });
    }
    warnings
}

/// The lattice that the points turned out to need, if it is another one.
fn settled(
    plan: &Plan,
    sources: &Sources,
    lattice: &JobLattice,
    stats: &Stats,
) -> Result<Option<JobLattice>, ConvertError> {
    let (min, max) = (lattice.lattice.world(stats.bounds.min.0), lattice.lattice.world(stats.bounds.max.0));
    if far_out(&Aabb { min, max }) {
        return Err(InputFault::FarPoints { min, max }.into());
    }
    Ok(lattice::settled(plan, sources, lattice, stats))
}

fn change_of_step(before: &JobLattice, after: &JobLattice) -> Warning {
    let (then, now) = (before.lattice.scale, after.lattice.scale);
    let (scale, reason) = (now, after.reason);
    if (0..3).any(|a| now[a] > then[a]) {
        Warning::CoarserStep { scale, reason }
    } else {
        Warning::FinerStep { scale, reason }
    }
}

/// The box of all points that passed the filter's box, on a lattice.
fn measured(plan: &Plan, lattice: &Lattice, stats: &Stats) -> JobBounds {
    let all = stats.sources.iter().fold(Aabb::EMPTY, |all, s| all.union(&s.bounds));
    quantized(lattice, &plan.filter.bounds.as_ref().map_or(all, |cut| intersection(&all, cut)))
}

/// True if every position of the sources is a point of the lattice, as far as is known.
pub(crate) fn is_lossless(sources: &Sources, lattice: &JobLattice) -> bool {
    let Lattice { scale, offset } = lattice.lattice;
    let is_held = |a: usize, fineness: Fineness| match fineness {
        Fineness::Grid { grid, .. } => AxisGrid { step: scale[a], offset: offset[a] }.holds(&grid),
        Fineness::Step(_) | Fineness::Single | Fineness::Double => false,
    };
    sources.all.iter().all(|s| (0..3).all(|a| is_held(a, s.survey.fineness[a])))
}

/// A box of the world on a lattice.
pub(crate) fn quantized(lattice: &Lattice, bounds: &Aabb) -> JobBounds {
    let at = |corner: [f64; 3]| JobPoint(std::array::from_fn(|a| lattice.quantize(a, corner[a])));
    JobBounds { min: at(bounds.min), max: at(bounds.max) }
}

fn nothing_to_convert(sources: &Sources, stats: &Stats) -> ConvertError {
    let read: u64 = stats.sources.iter().map(|s| s.read).sum();
    match sources.all.as_slice() {
        [first, others @ ..] if read == 0 => {
            let info = first.scan.info();
            let others = match others.len() {
                0 => String::new(),
                n => format!(", nor do {n} more inputs"),
            };
            let what = format!("holds no points up to its end{others}");
            ReadError::broken(&info.path, info.file_bytes, what).advise("there is nothing to convert").into()
        }
        _ => {
            let Stats { outside_bounds, other_class, thinned, invalid, origin_skipped: at_origin, .. } = *stats;
            InputFault::NothingLeft { read, outside_bounds, other_class, thinned, invalid, at_origin }.into()
        }
    }
}
