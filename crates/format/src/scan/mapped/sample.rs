//! Where the points of a scan are, before they are all read.

use std::ops::ControlFlow;

use crate::{Aabb, PointBatch, Positions, Scan, Scratch, Wanted};

/// Points looked at in each of three places of a scan that declares no bounds.
const SAMPLE_POINTS: usize = 65_536;

impl dyn Scan + '_ {
    /// Where the points are: the declared bounds, else those of a sample from the start, the middle and the end; `None`
    /// if no point was found. A hint: declared bounds may be wrong, and sampled ones are somewhat too small.
    pub fn bounds_hint(&self) -> Option<Aabb> {
        self.info().bounds_declared.or_else(|| Some(sample(self)).filter(|bounds| !bounds.is_empty()))
    }
}

/// The box of some points. Pieces that cannot be decoded give none.
fn sample(scan: &dyn Scan) -> Aabb {
    let pieces = scan.pieces().len();
    let mut places = vec![0, pieces / 2, pieces.saturating_sub(1)];
    places.dedup();
    let (wanted, mut scratch, mut bounds) = (Wanted::positions(scan.info()), Scratch::default(), Aabb::EMPTY);
    for place in places.into_iter().filter(|place| *place < pieces) {
        let mut seen = 0;
        let _ = scan.decode(place, &wanted, &mut scratch, &mut |batch| {
            grow(&mut bounds, scan, batch);
            seen += batch.len();
            if seen < SAMPLE_POINTS { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
    }
    bounds
}

fn grow(bounds: &mut Aabb, scan: &dyn Scan, batch: &PointBatch) {
    let point = |i: usize| match (&batch.positions, &scan.info().lattice) {
        (Positions::World(p), _) => p.each_ref().map(|axis| axis[i]),
        (Positions::Quantized(q), Some(lattice)) => lattice.world(q.each_ref().map(|axis| i64::from(axis[i]))),
        (Positions::Quantized(q), None) => q.each_ref().map(|axis| f64::from(axis[i])),
    };
    (0..batch.len()).map(point).filter(|p| p.iter().all(|v| v.is_finite())).for_each(|p| bounds.grow(p));
}
