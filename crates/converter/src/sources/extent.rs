//! Where the points of a scan are, before they are read: declared bounds, or a sample.

use std::ops::ControlFlow;

use pointmill_format::{Aabb, PointBatch, Positions, Scan, Scratch, Wanted};

/// Points looked at in each of three places of a scan that declares no bounds.
const SAMPLE_POINTS: usize = 131_072;

/// No renderer's single precision holds coordinates beyond this, and no scanner gives them.
const FARTHEST: f64 = 1e30;

/// True for bounds that cannot be coordinates.
pub(crate) fn far_out(bounds: &Aabb) -> bool {
    bounds.min.iter().chain(&bounds.max).any(|v| v.abs() > FARTHEST)
}

/// Where the points of a source are, as far as is known before they are read.
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

/// The box of points from the start, the middle and the end. Pieces that cannot be decoded are reported later.
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

/// The box that lies in both; empty if they do not meet.
pub(crate) fn intersection(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb { min: std::array::from_fn(|i| a.min[i].max(b.min[i])), max: std::array::from_fn(|i| a.max[i].min(b.max[i])) }
}
