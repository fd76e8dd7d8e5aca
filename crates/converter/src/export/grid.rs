//! The lattice of a file: the one of the sources, or one that holds those of all.

use pointmill_format::{Aabb, Lattice};

use crate::cloud::{JobBounds, JobLattice, Stats};
use crate::error::ConvertError;
use crate::gather::{from_headers, settled};
use crate::plan::{Plan, ScaleChoice};
use crate::sources::{Sources, tidy_product};

/// The offset moves in whole numbers of this many steps, so that it has few digits.
const ROUND_STEPS: f64 = 1e6;

/// A lattice for a file, before its points are read.
pub(super) fn before_reading(plan: &Plan, sources: &Sources) -> Result<JobLattice, ConvertError> {
    let chosen = from_headers(plan, sources)?;
    if let Some(lattice) = shared(plan, sources) {
        return Ok(JobLattice { lattice, ..chosen });
    }
    let hint = sources.bounds_hint(plan.filter.bounds.as_ref()).unwrap_or(Aabb { min: [0.0; 3], max: [0.0; 3] });
    let [min, max] = [hint.min, hint.max].map(|corner| steps(&chosen, corner));
    Ok(centred(chosen, min, max))
}

/// The lattice of all sources, if they have one and the same.
fn shared(plan: &Plan, sources: &Sources) -> Option<Lattice> {
    let mut all = sources.all.iter().filter(|source| source.pieces > 0).map(|source| source.stored.lattice);
    let first = all.next()??;
    (plan.scale == ScaleChoice::Auto && all.all(|other| other == Some(first))).then_some(first)
}

/// A lattice for points that were read with `present` and do not fit it; `None`: there is no better one.
pub(super) fn after_reading(plan: &Plan, sources: &Sources, present: &JobLattice, stats: &Stats) -> Option<JobLattice> {
    if let Some(other) = settled(plan, sources, present, stats) {
        let world = |q: [i64; 3]| present.lattice.world(q);
        let (min, max) = (world(stats.bounds.min.0), world(stats.bounds.max.0));
        let [min, max] = [min, max].map(|corner| steps(&other, corner));
        return Some(centred(other, min, max));
    }
    let JobBounds { min, max } = stats.bounds;
    let next = centred(present.clone(), min.0, max.0);
    (next != *present).then_some(next)
}

/// A place of the world on a lattice.
fn steps(of: &JobLattice, world: [f64; 3]) -> [i64; 3] {
    std::array::from_fn(|a| of.lattice.quantize(a, world[a]))
}

/// The lattice with an offset that puts all integers from `min` to `max` within 32 bits, if it does not do so.
fn centred(mut of: JobLattice, min: [i64; 3], max: [i64; 3]) -> JobLattice {
    for a in 0..3 {
        if min[a] > max[a] || (i32::try_from(min[a]).is_ok() && i32::try_from(max[a]).is_ok()) {
            continue;
        }
        let middle = min[a] as f64 / 2.0 + max[a] as f64 / 2.0;
        let steps = (middle / ROUND_STEPS).round() * ROUND_STEPS;
        let offset = of.lattice.offset[a] + tidy_product(of.lattice.scale[a], steps.abs()).copysign(steps);
        of.lattice.offset[a] = offset;
    }
    of
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reason::{LatticeBasis, LatticeReason};

    #[test]
    fn offsets_move_by_round_numbers_where_integers_would_not_fit() {
        let lattice = Lattice { scale: [0.001; 3], offset: [0.0, 5.0, 0.0] };
        let job = JobLattice { lattice, reason: LatticeReason::of_all(LatticeBasis::Requested) };
        let moved = centred(job.clone(), [5_400_123_456, -9, 7], [5_400_999_999, 9, 6]);
        assert_eq!(moved.lattice.offset, [5_401_000.0, 5.0, 0.0]);
        assert_eq!(centred(job, [-5_400_123_456; 3], [-5_400_000_000; 3]).lattice.offset[0], -5_400_000.0);
    }
}
