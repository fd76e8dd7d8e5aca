//! The true point count, bounds, and range of each attribute, from decoding every point.

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use pointmill_format::{Aabb, PointBatch, Positions, ReadError, Scan, Scratch, Wanted, with_column};

/// Figures of the points themselves.
#[derive(Debug, Clone)]
pub(crate) struct Measured {
    pub(crate) points: u64,
    /// Those among them that have no finite position.
    pub(crate) invalid: u64,
    /// World coordinates of the others; [`Aabb::EMPTY`] if there are none.
    pub(crate) bounds: Aabb,
    /// For each attribute of the scan, in order, and each of its elements: lowest and highest raw value. Empty without
    /// points; not-a-number values do not count.
    pub(crate) ranges: Vec<Vec<[f64; 2]>>,
}

impl Measured {
    fn nothing(scan: &dyn Scan) -> Self {
        let attributes = &scan.info().attributes;
        let empty = [f64::INFINITY, f64::NEG_INFINITY];
        let ranges = attributes.iter().map(|a| vec![empty; a.elements]).collect();
        Self { points: 0, invalid: 0, bounds: Aabb::EMPTY, ranges }
    }

    fn add(&mut self, batch: &PointBatch, scan: &dyn Scan) {
        self.points += batch.len() as u64;
        match (&batch.positions, scan.info().lattice) {
            (Positions::Quantized(axes), Some(lattice)) => {
                let ends = |pick: fn(&[i32]) -> Option<i32>| {
                    Some([pick(&axes[0])?, pick(&axes[1])?, pick(&axes[2])?].map(i64::from))
                };
                let corners = [ends(|v| v.iter().min().copied()), ends(|v| v.iter().max().copied())];
                corners.into_iter().flatten().for_each(|corner| self.bounds.grow(lattice.world(corner)));
            }
            (Positions::World([x, y, z]), _) => {
                for ((x, y), z) in x.iter().zip(y).zip(z) {
                    let p = [*x, *y, *z];
                    if p.iter().all(|v| v.is_finite()) { self.bounds.grow(p) } else { self.invalid += 1 }
                }
            }
            (Positions::Quantized(_), None) => {} // no reader gives integers without a lattice
        }
        for (column, ranges) in batch.columns.iter().zip(&mut self.ranges) {
            let elements = ranges.len().max(1);
            with_column!(column, values => for point in values.chunks_exact(elements) {
                for (value, range) in point.iter().zip(ranges.iter_mut()) {
                    #[allow(clippy::unnecessary_cast)] // one of the types is f64
                    let value = *value as f64;
                    *range = [range[0].min(value), range[1].max(value)];
                }
            });
        }
    }

    fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.invalid += other.invalid;
        self.bounds = self.bounds.union(&other.bounds);
        for (mine, theirs) in self.ranges.iter_mut().flatten().zip(other.ranges.iter().flatten()) {
            *mine = [mine[0].min(theirs[0]), mine[1].max(theirs[1])];
        }
    }
}

/// Decodes every piece of `scan`, on all cores. The second value is the first piece, in file order, that failed; the
/// figures then cover what could be decoded.
pub(crate) fn measure(scan: &dyn Scan) -> (Measured, Option<ReadError>) {
    let next = AtomicUsize::new(0);
    let total = Mutex::new((Measured::nothing(scan), None::<(usize, ReadError)>));
    let work = || {
        let mut scratch = Scratch::default();
        let mut mine = Measured::nothing(scan);
        let mut fault: Option<(usize, ReadError)> = None;
        loop {
            // two at once, which take less time in some formats when one thread decodes them
            let first = next.fetch_add(2, Ordering::Relaxed);
            if first >= scan.pieces().len() {
                break;
            }
            for piece in first..scan.pieces().len().min(first + 2) {
                scratch.next_piece = (piece == first).then_some(piece + 1);
                let wanted = Wanted::all(scan.info());
                let mut sink = |batch: &PointBatch| {
                    mine.add(batch, scan);
                    ControlFlow::Continue(())
                };
                if let Err(e) = scan.decode(piece, &wanted, &mut scratch, &mut sink) {
                    fault.get_or_insert((piece, e));
                }
            }
        }
        let mut total = total.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        total.0.merge(&mine);
        if let Some(fault) = fault
            && total.1.as_ref().is_none_or(|(piece, _)| fault.0 < *piece)
        {
            total.1 = Some(fault);
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(scan.pieces().len()).max(1);
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(work);
        }
        work();
    });
    let (measured, fault) = total.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    (measured, fault.map(|(_, error)| error))
}
