//! The job lattice: the sources' own where they have one, else one that fits their coordinates.

use std::ops::ControlFlow;

use pointmill_format::{Aabb, Lattice, PointBatch, Positions, Resolution, Scan, ScanInfo, Scratch, Wanted};

use crate::job::far_out;
use crate::plan::ScaleChoice;

/// Bits that the extent of a cloud may take up on a lattice that is chosen here: one less than the integers have, since
/// the root cube is a power of two and need not start at the minimum.
const EXTENT_BITS: i32 = 30;

/// The step where nothing at all is known of the coordinates, world units.
const USUAL_STEP: f64 = 0.001;

/// The least step, world units: below it single precision of renderers ends.
const LEAST_STEP: f64 = 1e-30;

/// Points looked at in each of three places of a scan that declares no bounds.
const SAMPLE_POINTS: usize = 131_072;

/// The lattice of a job.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Choice {
    pub(crate) lattice: Lattice,
    /// Why this lattice, for people.
    pub(crate) reason: String,
    /// What may be done if 31 bits do not hold the extent.
    pub(crate) steps: Steps,
}

/// Which steps a lattice may take when it must become coarser.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Steps {
    /// Powers of two of the present one, so that coordinates of integer sources stay as near as they can.
    Doubled,
    /// Powers of ten, so that decimal coordinates stay exact.
    Decimal,
}

/// Where the points of a source lie, as far as is known before they are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) bounds: Aabb,
    /// From a sample: the true box is somewhat larger.
    pub(crate) is_sampled: bool,
}

impl Extent {
    /// Declared bounds, else those of a sample of the points; `None` if there is no point.
    pub(crate) fn of(scan: &dyn Scan) -> Option<Self> {
        let info = scan.info();
        if let Some(bounds) = info.bounds_declared.filter(|b| info.lattice.is_some() || !far_out(b)) {
            return Some(Self { bounds, is_sampled: false });
        }
        let bounds = if info.lattice.is_none() { sample(scan) } else { Aabb::EMPTY };
        (!bounds.is_empty()).then_some(Self { bounds, is_sampled: true })
    }
}

/// The box of points from the start, the middle and the end. Pieces that cannot be decoded tell of themselves later.
fn sample(scan: &dyn Scan) -> Aabb {
    let pieces = scan.pieces().len();
    let mut places = vec![0, pieces / 2, pieces.saturating_sub(1)];
    places.dedup();
    let (wanted, mut scratch, mut bounds) = (Wanted::positions(scan.info()), Scratch::default(), Aabb::EMPTY);
    for place in places.into_iter().filter(|p| *p < pieces) {
        let mut seen = 0;
        let mut sink = |batch: &PointBatch| {
            if let Positions::World([x, y, z]) = &batch.positions {
                let finite = |p: &[f64; 3]| p.iter().all(|v| v.is_finite());
                let points = x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]);
                points.filter(finite).for_each(|p| bounds.grow(p));
            }
            seen += batch.len();
            if seen < SAMPLE_POINTS { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let _ = scan.decode(place, &wanted, &mut scratch, &mut sink);
    }
    bounds
}

/// Chooses the lattice of a job. `extents`: of each source; `cut`: the filter's box.
pub(crate) fn choose(
    choice: ScaleChoice,
    infos: &[&ScanInfo],
    extents: &[Option<Extent>],
    cut: Option<&Aabb>,
) -> Choice {
    let lattices: Vec<Lattice> = infos.iter().filter_map(|i| i.lattice).collect();
    let chosen = |lattice, reason: &str| Choice { lattice, reason: reason.to_owned(), steps: Steps::Doubled };
    if let ScaleChoice::Fixed(s) = choice {
        let offset = std::array::from_fn(|a| fixed_offset(&lattices, a, s));
        return chosen(Lattice { scale: [s; 3], offset }, "asked for with --scale");
    }
    let all_have_one = lattices.len() == infos.len();
    match lattices.first() {
        Some(first) if all_have_one && lattices.iter().all(|l| l == first) => chosen(*first, "that of the sources"),
        Some(first) if all_have_one => {
            // What headers declare never makes the lattice coarser: they may lie. Points that were read may.
            chosen(finest(first, &lattices), "the finest scale of the sources, per axis")
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
                continue; // its own step is a candidate of its own
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
        // Doubles themselves have 53 bits; a step is some of their own steps, or the lattice would be uneven.
        let room = (extent / 2f64.powi(EXTENT_BITS)).max(farthest * 2f64.powi(-50));
        let room = if farthest > 0.0 { room.max(LEAST_STEP) } else { room };
        let resolution = if resolution.is_finite() { resolution } else { 0.0 };
        Self { room, resolution, is_single, farthest }
    }

    /// A lattice of our own choice.
    fn free(&self) -> Choice {
        let far = self.farthest;
        if self.is_single && self.resolution > 0.0 {
            let step = self.resolution.max(power_above(2.0, self.room));
            let why = if step > self.resolution {
                "the finest power of two that 31-bit integers hold; single precision of the sources would be finer"
            } else {
                "single precision of the sources: coordinates up to"
            };
            let told = if step > self.resolution {
                String::new()
            } else {
                format!(" {far:.6} resolve no finer on every axis")
            };
            return Choice { lattice: cube(step), reason: format!("{why}{told}"), steps: Steps::Doubled };
        }
        if self.resolution >= self.room && self.resolution > 0.0 {
            let reason = "the step in which the sources store coordinates".to_owned();
            return Choice { lattice: cube(self.resolution), reason, steps: Steps::Decimal };
        }
        if self.room == 0.0 {
            let reason = "the inputs have no lattice and no extent".to_owned();
            return Choice { lattice: cube(USUAL_STEP), reason, steps: Steps::Decimal };
        }
        let reason = "the sources have no lattice; the finest power of ten that 31-bit integers hold".to_owned();
        Choice { lattice: cube(power_above(10.0, self.room)), reason, steps: Steps::Decimal }
    }

    /// A lattice that holds every point of `own`, and is as fine as the other sources need.
    fn refine(&self, own: Lattice) -> Choice {
        let wanted = self.resolution.max(self.room);
        let mut lattice = own;
        for scale in &mut lattice.scale {
            let mut parts = 1.0;
            while *scale / (parts * 10.0) >= wanted && parts < 1e9 && wanted > 0.0 {
                parts *= 10.0;
            }
            *scale /= parts;
        }
        let reason = if lattice == own {
            "the finest scale of the sources that have a lattice, per axis; the others are rounded to it"
        } else {
            "a tenth part (or tenth of it, …) of the finest scale of the sources that have a lattice, for the others' sake"
        };
        Choice { lattice, reason: reason.to_owned(), steps: Steps::Decimal }
    }
}

impl Steps {
    /// A step at least `factor` times as coarse.
    pub(crate) fn coarsen(self, step: f64, factor: f64) -> f64 {
        match self {
            Self::Doubled => step * factor,
            Self::Decimal => {
                let mut times = 1.0;
                while times < factor {
                    times *= 10.0;
                }
                tidy(step * times)
            }
        }
    }
}

fn cube(step: f64) -> Lattice {
    Lattice { scale: [step; 3], offset: [0.0; 3] }
}

fn intersection(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb { min: std::array::from_fn(|i| a.min[i].max(b.min[i])), max: std::array::from_fn(|i| a.max[i].min(b.max[i])) }
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

/// The nearest double with few decimal digits, if there is one within rounding.
fn tidy(step: f64) -> f64 {
    format!("{step:.12e}").parse().ok().filter(|t: &f64| ((t - step) / step).abs() < 1e-13).unwrap_or(step)
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

    fn free(resolution: Resolution, min: [f64; 3], max: [f64; 3]) -> Choice {
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

    #[test]
    fn coarser_decimal_steps_stay_decimal() {
        assert_eq!(Steps::Decimal.coarsen(1e-6, 2.0), 1e-5);
        assert_eq!(Steps::Decimal.coarsen(1e-6, 64.0), 1e-4);
        assert_eq!(Steps::Doubled.coarsen(0.5, 4.0), 2.0);
    }
}
