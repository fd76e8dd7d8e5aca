//! The job lattice: the sources' own where they have one, else one that fits their coordinates.

use pointmill_format::{Aabb, Lattice, Resolution, ScanInfo};

use crate::cloud::{JobLattice, Stats, Steps};
use crate::error::{ConvertError, InputFault};
use crate::plan::{Plan, ScaleChoice};
use crate::reason::{LatticeBasis, LatticeReason};
use crate::sources::{Extent, Sources, intersection};

/// Bits that the extent of a cloud may take up on a lattice that is chosen here: one less than the integers have, since
/// the root cube is a power of two and need not start at the minimum.
const EXTENT_BITS: i32 = 30;

/// The step where nothing at all is known of the coordinates, world units.
const USUAL_STEP: f64 = 0.001;

/// The least step, world units: below it single precision of renderers ends.
const LEAST_STEP: f64 = 1e-30;

/// A step that could be this many times finer, had the headers been right, is worth a second read.
const WORTH_READING_AGAIN: f64 = 100.0;

/// The lattice for what the headers say.
pub(crate) fn from_headers(plan: &Plan, sources: &Sources) -> Result<JobLattice, ConvertError> {
    let extents: Vec<Option<Extent>> = sources.all.iter().map(|s| s.extent).collect();
    let chosen = choose_for(plan, sources, &extents);
    if !chosen.lattice.is_valid() {
        let cut = plan.filter.bounds.as_ref();
        let Aabb { min, max } = sources.bounds_hint(cut).unwrap_or(Aabb::EMPTY);
        return Err(InputFault::FarPoints { min, max }.into());
    }
    Ok(chosen)
}

/// A finer lattice, if what was declared of float scans made `present` far coarser than the points need: wrong headers
/// may cost a second read, not precision.
pub(super) fn refined(plan: &Plan, sources: &Sources, present: &JobLattice, stats: &Stats) -> Option<JobLattice> {
    if present.reason.coarser.is_some() || sources.all.iter().all(|s| s.scan.info().lattice.is_some()) {
        return None;
    }
    let measured = stats.sources.iter().map(|s| Extent { bounds: s.bounds, is_sampled: false });
    let extents: Vec<_> = measured.map(|e| (!e.bounds.is_empty()).then_some(e)).collect();
    let chosen = choose_for(plan, sources, &extents);
    (chosen.lattice.scale[0] * WORTH_READING_AGAIN <= present.lattice.scale[0]).then_some(chosen)
}

fn choose_for(plan: &Plan, sources: &Sources, extents: &[Option<Extent>]) -> JobLattice {
    let infos: Vec<&ScanInfo> = sources.all.iter().map(|s| s.scan.info()).collect();
    choose(plan.scale, &infos, extents, plan.filter.bounds.as_ref())
}

/// Chooses a lattice. `extents`: of each source; `cut`: the filter's box.
fn choose(choice: ScaleChoice, infos: &[&ScanInfo], extents: &[Option<Extent>], cut: Option<&Aabb>) -> JobLattice {
    let lattices: Vec<Lattice> = infos.iter().filter_map(|i| i.lattice).collect();
    let chosen = |lattice, basis| made(lattice, basis, Steps::Doubled);
    if let ScaleChoice::Fixed(s) = choice {
        let offset = std::array::from_fn(|a| fixed_offset(&lattices, a, s));
        return chosen(Lattice { scale: [s; 3], offset }, LatticeBasis::Requested);
    }
    let all_have_one = lattices.len() == infos.len();
    match lattices.first() {
        Some(first) if all_have_one && lattices.iter().all(|l| l == first) => chosen(*first, LatticeBasis::Sources),
        Some(first) if all_have_one => {
            // What headers declare never makes the lattice coarser: they may lie. Points that were read may.
            chosen(finest(first, &lattices), LatticeBasis::FinestOfSources)
        }
        first => {
            let need = Need::of(infos, extents, cut);
            match first {
                None => need.free(),
                Some(first) => need.refine(finest(first, &lattices)),
            }
        }
    }
}

/// 0 where it is a point of every source's lattice of that step, so that sources of any kind give the same lattice.
fn fixed_offset(lattices: &[Lattice], axis: usize, step: f64) -> f64 {
    let steps = |l: &Lattice| l.offset[axis] / step;
    if lattices.iter().all(|l| (steps(l) - steps(l).round()).abs() <= 1e-6) {
        return 0.0;
    }
    lattices.iter().map(|l| l.offset[axis]).fold(f64::INFINITY, f64::min)
}

fn finest(first: &Lattice, lattices: &[Lattice]) -> Lattice {
    let mut lattice = *first;
    for a in 0..3 {
        let scale = lattices.iter().map(|l| l.scale[a]).fold(f64::INFINITY, f64::min);
        let finest = lattices.iter().filter(|l| l.scale[a] == scale);
        lattice.scale[a] = scale;
        lattice.offset[a] = finest.map(|l| l.offset[a]).fold(f64::INFINITY, f64::min);
    }
    lattice
}

/// What the coordinates ask of a lattice.
struct Need {
    /// Smallest step that the integers hold, world units; 0 if the extent is not known (or is a point).
    room: f64,
    /// Steps below this carry nothing, world units; 0: not known.
    resolution: f64,
    /// All coordinates are in single precision, so that steps of powers of two lose nothing.
    is_single: bool,
    /// Largest coordinate.
    farthest: f64,
}

impl Need {
    fn of(infos: &[&ScanInfo], extents: &[Option<Extent>], cut: Option<&Aabb>) -> Self {
        let mut all = Aabb::EMPTY;
        let (mut resolution, mut is_single, mut is_sampled) = (f64::INFINITY, true, false);
        for (info, extent) in infos.iter().zip(extents) {
            let bounds = extent.map(|e| cut.map_or(e.bounds, |c| intersection(&e.bounds, c))).filter(|b| !b.is_empty());
            if let (Some(bounds), Some(extent)) = (&bounds, extent) {
                all = all.union(bounds);
                is_sampled |= extent.is_sampled;
            }
            if info.lattice.is_some() {
                continue; // its step is a candidate by itself
            }
            is_single &= info.resolution == Resolution::Single;
            resolution = resolution.min(match info.resolution {
                Resolution::Step(step) => step,
                Resolution::Single => bounds.map_or(0.0, |b| single_step(&b)),
                Resolution::Double => 0.0,
            });
        }
        let (mut extent, mut farthest) = (0.0f64, 0.0f64);
        if !all.is_empty() {
            extent = all.extent().into_iter().fold(0.0, f64::max);
            farthest = all.min.iter().chain(&all.max).fold(0.0, |far, v| v.abs().max(far));
        }
        // The true box of a sampled scan is larger, though hardly twice as large.
        let extent = if is_sampled { 2.0 * extent } else { extent };
        // Doubles themselves have 53 bits; a step is several of theirs, or the lattice would be uneven.
        let room = (extent / 2f64.powi(EXTENT_BITS)).max(farthest * 2f64.powi(-50));
        let room = if farthest > 0.0 { room.max(LEAST_STEP) } else { room };
        let resolution = if resolution.is_finite() { resolution } else { 0.0 };
        Self { room, resolution, is_single, farthest }
    }

    /// A lattice that no source prescribes.
    fn free(&self) -> JobLattice {
        if self.is_single && self.resolution > 0.0 {
            let step = self.resolution.max(power_above(2.0, self.room));
            let basis = if step > self.resolution {
                LatticeBasis::PowerOfTwo
            } else {
                LatticeBasis::SinglePrecision { farthest: self.farthest }
            };
            return made(cube(step), basis, Steps::Doubled);
        }
        if self.resolution >= self.room && self.resolution > 0.0 {
            return made(cube(self.resolution), LatticeBasis::StoredStep, Steps::Decimal);
        }
        if self.room == 0.0 {
            return made(cube(USUAL_STEP), LatticeBasis::Usual, Steps::Decimal);
        }
        made(cube(power_above(10.0, self.room)), LatticeBasis::PowerOfTen, Steps::Decimal)
    }

    /// A lattice that holds every point of `own`, and is as fine as the other sources need.
    fn refine(&self, own: Lattice) -> JobLattice {
        let wanted = self.resolution.max(self.room);
        let mut lattice = own;
        for scale in &mut lattice.scale {
            let mut parts = 1.0;
            while *scale / (parts * 10.0) >= wanted && parts < 1e9 && wanted > 0.0 {
                parts *= 10.0;
            }
            *scale /= parts;
        }
        let basis = if lattice == own { LatticeBasis::FinestOfSome } else { LatticeBasis::PartOfFinest };
        made(lattice, basis, Steps::Decimal)
    }
}

fn made(lattice: Lattice, basis: LatticeBasis, steps: Steps) -> JobLattice {
    JobLattice { lattice, reason: LatticeReason { basis, coarser: None }, steps }
}

fn cube(step: f64) -> Lattice {
    Lattice { scale: [step; 3], offset: [0.0; 3] }
}

/// The smallest power of `base` (2 or 10) that is not below `value`, as exact as a double can be.
fn power_above(base: f64, value: f64) -> f64 {
    let mut exponent = value.max(f64::MIN_POSITIVE).log(base).floor() as i32 - 1;
    let power = |e: i32| if base == 2.0 { 2f64.powi(e) } else { format!("1e{e}").parse().unwrap_or(f64::NAN) };
    while power(exponent) < value {
        exponent += 1;
    }
    power(exponent)
}

/// The step of single precision at the largest coordinate of the axis where that is least: no axis loses.
fn single_step(bounds: &Aabb) -> f64 {
    let step = |a: usize| {
        let far = bounds.min[a].abs().max(bounds.max[a].abs());
        if far > 0.0 { 2f64.powi(far.log2().floor() as i32 - 23) } else { f64::INFINITY }
    };
    let least = (0..3).map(step).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(lattice: Option<Lattice>, resolution: Resolution) -> ScanInfo {
        let mut info = ScanInfo::new("x", "", 0);
        (info.lattice, info.resolution) = (lattice, resolution);
        info
    }

    fn with(lattices: &[Lattice], choice: ScaleChoice) -> Lattice {
        let infos: Vec<_> = lattices.iter().map(|l| info(Some(*l), Resolution::Double)).collect();
        choose(choice, &infos.iter().collect::<Vec<_>>(), &vec![None; infos.len()], None).lattice
    }

    fn free(resolution: Resolution, min: [f64; 3], max: [f64; 3]) -> JobLattice {
        let extent = Extent { bounds: Aabb { min, max }, is_sampled: false };
        choose(ScaleChoice::Auto, &[&info(None, resolution)], &[Some(extent)], None)
    }

    #[test]
    fn sources_that_agree_keep_their_lattice_and_others_get_the_finest() {
        let a = Lattice { scale: [0.01; 3], offset: [100.0, 0.0, 0.0] };
        let b = Lattice { scale: [0.001; 3], offset: [200.0, 0.0, -5.0] };
        assert_eq!(with(&[a, a], ScaleChoice::Auto), a);
        assert_eq!(with(&[a, b], ScaleChoice::Auto), b);
        assert_eq!(with(&[a, b], ScaleChoice::Fixed(0.5)).offset, [0.0, 0.0, 0.0]);
        assert_eq!(with(&[a, b], ScaleChoice::Fixed(0.3)).offset, [100.0, 0.0, -5.0]);
    }

    #[test]
    fn declared_bounds_however_wide_do_not_make_the_lattice_of_sources_coarser() {
        let b = Lattice { scale: [0.001; 3], offset: [0.0; 3] };
        let lie = Extent { bounds: Aabb { min: [-1e12; 3], max: [1e12; 3] }, is_sampled: false };
        let choice = choose(ScaleChoice::Auto, &[&info(Some(b), Resolution::Double)], &[Some(lie)], None);
        assert_eq!(choice.lattice, b);
    }

    #[test]
    fn doubles_get_the_finest_power_of_ten_that_the_integers_hold() {
        let step = |min, max| free(Resolution::Double, min, max).lattice.scale[0];
        assert_eq!(step([0.0; 3], [1000.0, 10.0, 10.0]), 1e-6);
        assert_eq!(step([500_000.0; 3], [500_000.2; 3]), 1e-9);
        assert_eq!(step([0.0; 3], [2e6; 3]), 1e-2);
        // two numbers near 10^7 a millimetre apart: doubles resolve 2e-9
        assert_eq!(step([1e7; 3], [1e7 + 1e-3; 3]), 1e-8);
        assert_eq!(step([7.0; 3], [7.0; 3]), 1e-14);
    }

    #[test]
    fn single_precision_gets_its_own_step_and_no_finer() {
        let c = free(Resolution::Single, [499_000.0, 5_400_000.0, 100_000.0], [500_000.0, 5_401_000.0, 110_000.0]);
        assert_eq!(c.lattice.scale, [2f64.powi(-7); 3], "the axis with the smallest coordinates decides");
        let near = free(Resolution::Single, [-1.0; 3], [1.0; 3]);
        assert_eq!(near.lattice.scale[0], 2f64.powi(-23));
        // an axis near 0 would ask for more than 31 bits of another
        let flat = free(Resolution::Single, [0.0, 0.0, 0.0], [1e6, 1e6, 1e-3]);
        assert_eq!(flat.lattice.scale[0], power_above(2.0, 1e6 / 2f64.powi(30)));
    }

    #[test]
    fn stored_steps_are_kept_where_the_integers_hold_them() {
        let step = |s| free(Resolution::Step(s), [0.0; 3], [1000.0; 3]).lattice.scale[0];
        assert_eq!(step(0.00025), 0.00025);
        assert_eq!(step(1e-9), 1e-6);
    }

    #[test]
    fn beside_a_lattice_the_others_get_decimal_parts_of_its_step() {
        let own = Lattice { scale: [0.01; 3], offset: [0.5, 0.0, 0.0] };
        let extent = Some(Extent { bounds: Aabb { min: [0.0; 3], max: [1000.0; 3] }, is_sampled: false });
        let infos = [info(Some(own), Resolution::Double), info(None, Resolution::Double)];
        let c = choose(ScaleChoice::Auto, &[&infos[0], &infos[1]], &[extent, extent], None);
        assert_eq!((c.lattice.scale, c.lattice.offset), ([1e-6; 3], own.offset));
        let coarse = [info(Some(own), Resolution::Double), info(None, Resolution::Step(0.02))];
        assert_eq!(choose(ScaleChoice::Auto, &[&coarse[0], &coarse[1]], &[extent, extent], None).lattice, own);
    }
}
