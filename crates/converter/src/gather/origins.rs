//! Points exactly at the origin of their scan: some scanners write them where they measured nothing.

use pointmill_format::{PointBatch, Positions, ScanInfo};

/// Where the scanners of a file stood.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Origins {
    /// Index in the file of the first point of each scan, ascending, and its origin.
    parts: Vec<(u64, Origin)>,
}

/// An origin as the coordinates of its file have it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Origin {
    World([f64; 3]),
    /// Integers of the file's lattice; `None`: none of its points.
    Lattice(Option<[i32; 3]>),
}

impl Origins {
    pub(super) fn of(info: &ScanInfo) -> Self {
        let origin = |world: [f64; 3]| match &info.lattice {
            None => Origin::World(world),
            Some(lattice) => {
                let q: [i64; 3] = std::array::from_fn(|a| lattice.quantize(a, world[a]));
                let is_point = (0..3).all(|a| is_same(lattice.world(q)[a], world[a], lattice.offset[a]));
                let integers = q.map(|v| i32::try_from(v).ok());
                Origin::Lattice(match integers {
                    [Some(x), Some(y), Some(z)] if is_point => Some([x, y, z]),
                    _ => None,
                })
            }
        };
        if info.parts.is_empty() {
            // the file does not say; a point may as well have been measured there
            return Self { parts: vec![(0, origin([0.0; 3]))] };
        }
        let present = info.parts.iter().filter(|part| !part.range.is_empty());
        Self { parts: present.map(|part| (part.range.start, origin(part.translation))).collect() }
    }

    /// Points of a batch that lie exactly at their origin.
    pub(super) fn count(&self, batch: &PointBatch) -> u64 {
        let mut count = 0;
        let mut start = 0;
        while start < batch.len() {
            let first = batch.first_point + start as u64;
            let next = self.parts.partition_point(|(part, _)| *part <= first);
            let end = self.parts.get(next).map_or(batch.len() as u64, |(part, _)| part - batch.first_point);
            let end = (end as usize).min(batch.len());
            count += self.before(next).map_or(0, |origin| origin.count(&batch.positions, start..end));
            start = end;
        }
        count
    }

    /// True if a point of a batch lies exactly at its origin.
    pub(super) fn hold(&self, batch: &PointBatch, i: usize) -> bool {
        let next = self.parts.partition_point(|(part, _)| *part <= batch.first_point + i as u64);
        self.before(next).is_some_and(|origin| origin.count(&batch.positions, i..i + 1) > 0)
    }

    fn before(&self, part: usize) -> Option<&Origin> {
        self.parts.get(part.checked_sub(1)?).map(|(_, origin)| origin)
    }
}

impl Origin {
    fn count(&self, positions: &Positions, range: std::ops::Range<usize>) -> u64 {
        match (self, positions) {
            (Self::World(origin), Positions::World(p)) => equal(p, *origin, range),
            (Self::Lattice(Some(origin)), Positions::Quantized(p)) => equal(p, *origin, range),
            _ => 0,
        }
    }
}

/// Rows of the columns that are equal to `point`.
fn equal<T: Copy + PartialEq>(columns: &[Vec<T>; 3], point: [T; 3], range: std::ops::Range<usize>) -> u64 {
    let [x, y, z] = columns;
    let rows = x[range.clone()].iter().zip(&y[range.clone()]).zip(&z[range]);
    rows.map(|((x, y), z)| u64::from((*x == point[0]) & (*y == point[1]) & (*z == point[2]))).sum()
}

/// True if a coordinate of the lattice is `world` but for rounding.
fn is_same(found: f64, world: f64, offset: f64) -> bool {
    (found - world).abs() <= 4.0 * f64::EPSILON * (world.abs() + offset.abs())
}
