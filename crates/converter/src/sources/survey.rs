//! Where the points of a scan are, and how finely their coordinates are stored, before they are read: what the file
//! declares, or a sample. What a sample shows is a claim: every point is compared with it when it is read.

use std::ops::ControlFlow;

use pointmill_format::{Aabb, AxisGrid, Lattice, PointBatch, Positions, Resolution, Scan, Scratch, Wanted};

use super::decimals::Decimals;

/// Points looked at in each of three places of a scan without a lattice.
const SAMPLE_POINTS: usize = 131_072;

/// The step of single precision at `far` ≥ 0; `None` at 0, where it has none.
pub(crate) fn single_step(far: f64) -> Option<f64> {
    (far > 0.0 && far.is_finite()).then(|| 2f64.powi((far.log2().floor() as i32).max(-126) - 23))
}

/// True for bounds that cannot be coordinates.
pub(crate) fn far_out(bounds: &Aabb) -> bool {
    bounds.min.iter().chain(&bounds.max).any(|v| !Lattice::is_sound_offset(*v))
}

/// Where the points of a source are, as far as is known before they are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) bounds: Aabb,
    /// From a sample: the true box is somewhat larger.
    pub(crate) is_sampled: bool,
}

/// How finely an axis of a source is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Fineness {
    /// All coordinates are of this grid. `is_claim`: a sample of them is.
    Grid { grid: AxisGrid, is_claim: bool },
    /// In steps of that size, anywhere.
    Step(f64),
    /// In single precision.
    Single,
    /// More finely than is known.
    Double,
}

impl Fineness {
    /// Differs where the fineness does.
    pub(super) fn bits(self) -> [u64; 3] {
        match self {
            Self::Grid { grid, is_claim } => [1 + u64::from(is_claim), grid.step.to_bits(), grid.offset.to_bits()],
            Self::Step(step) => [3, step.to_bits(), 0],
            Self::Single => [4, 0, 0],
            Self::Double => [5, 0, 0],
        }
    }
}

/// What is known of a source before it is read.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Survey {
    /// `None` if there is no point.
    pub(crate) extent: Option<Extent>,
    pub(crate) fineness: [Fineness; 3],
}

impl Survey {
    /// Declared bounds, else those of a sample of the points; the lattice or resolution that the file states, else the
    /// decimals of a sample. `stops`: true once the run is to end, and the result no longer matters.
    pub(super) fn of(scan: &dyn Scan, stops: &dyn Fn() -> bool) -> Self {
        let info = scan.info();
        let declared = info.bounds_declared.filter(|b| info.lattice.is_some() || !far_out(b));
        let declared = declared.map(|bounds| Extent { bounds, is_sampled: false });
        if let Some(lattice) = info.lattice {
            let fineness = std::array::from_fn(|a| {
                let grid = AxisGrid { step: lattice.scale[a], offset: lattice.offset[a] };
                Fineness::Grid { grid, is_claim: false }
            });
            return Self { extent: declared, fineness };
        }
        let is_open = |r: &Resolution| matches!(r, Resolution::Double);
        if declared.is_some() && !info.resolution.iter().any(is_open) {
            return Self { extent: declared, fineness: info.resolution.map(|r| stated(r, None)) };
        }
        let Sample { bounds, decimals, is_whole } = sample(scan, stops);
        let sampled = (!bounds.is_empty()).then_some(Extent { bounds, is_sampled: !is_whole });
        let longest = [0, 1, 2].map(|a| bounds.max[a] - bounds.min[a]).into_iter().fold(0.0, f64::max);
        let fineness = std::array::from_fn(|a| stated(info.resolution[a], decimals[a].grid(longest)));
        Self { extent: declared.or(sampled), fineness }
    }
}

fn stated(resolution: Resolution, sampled: Option<AxisGrid>) -> Fineness {
    match (resolution, sampled) {
        (Resolution::Grid(grid), _) => Fineness::Grid { grid, is_claim: true },
        (Resolution::Step(step), _) => Fineness::Step(step),
        (Resolution::Single, _) => Fineness::Single,
        (Resolution::Double, Some(grid)) => Fineness::Grid { grid, is_claim: true },
        (Resolution::Double, None) => Fineness::Double,
    }
}

struct Sample {
    bounds: Aabb,
    decimals: [Decimals; 3],
    /// Every point was looked at.
    is_whole: bool,
}

/// Points from the start, the middle and the end. Pieces that cannot be decoded are reported later.
fn sample(scan: &dyn Scan, stops: &dyn Fn() -> bool) -> Sample {
    let pieces = scan.pieces().len();
    let mut places = vec![0, pieces / 2, pieces.saturating_sub(1)];
    places.dedup();
    let is_few = pieces <= places.len();
    let mut sample = Sample { bounds: Aabb::EMPTY, decimals: Default::default(), is_whole: is_few };
    let (wanted, mut scratch) = (Wanted::positions(scan.info()), Scratch::default());
    for place in places.into_iter().filter(|p| *p < pieces) {
        let mut seen = 0;
        let decoded = scan.decode(place, &wanted, &mut scratch, &mut |batch: &PointBatch| {
            if let Positions::World(columns) = &batch.positions {
                let [x, y, z] = columns;
                let finite = |p: &[f64; 3]| p.iter().all(|v| v.is_finite());
                for p in x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]).filter(finite) {
                    sample.bounds.grow(p);
                    sample.decimals.iter_mut().zip(p).for_each(|(d, v)| d.see(v));
                }
            }
            seen += batch.len();
            if seen < SAMPLE_POINTS && !stops() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        sample.is_whole &= decoded.is_ok() && seen as u64 == scan.pieces()[place].points;
    }
    sample
}

/// The box that lies in both; empty if they do not meet.
pub(crate) fn intersection(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb { min: std::array::from_fn(|i| a.min[i].max(b.min[i])), max: std::array::from_fn(|i| a.max[i].min(b.max[i])) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_has_its_step_at_the_largest_coordinate() {
        assert_eq!([500_000.0, 5_400_000.0, 100.0].map(single_step), [Some(0.031_25), Some(0.5), Some(2f64.powi(-17))]);
        assert_eq!(single_step(0.0), None);
    }
}
