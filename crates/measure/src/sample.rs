//! A fair part of a large scene: whole columns of ground, evenly spread.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill_format::{Aabb, Positions, Scan, Scratch, Wanted};

use crate::MeasureError;
use crate::cloud::in_parallel;

/// Columns that a sample should have, as far as the scene lets it: many are fair, few are whole.
const COLUMNS: f64 = 12.0;

/// Columns per side, at most.
const MOST_PER_SIDE: f64 = 512.0;

/// Which columns of a scene are measured.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sample {
    /// Their boxes, without gaps in height.
    pub(crate) boxes: Vec<Aabb>,
    /// Columns with points.
    pub(crate) occupied: usize,
    /// Points in the boxes.
    pub(crate) points: u64,
}

/// Chooses columns with about `wanted` of the `points` of the scans.
///
/// # Errors
/// A scan that cannot be read, the request to stop.
pub(crate) fn choose(
    scans: &[Box<dyn Scan>],
    points: u64,
    wanted: u64,
    should_stop: &(dyn Fn() -> bool + Sync),
) -> Result<Sample, MeasureError> {
    let share = wanted as f64 / points.max(1) as f64;
    let side = (COLUMNS / share).sqrt().ceil().clamp(2.0, MOST_PER_SIDE) as usize;
    let declared = declared_bounds(scans);
    let is_known = declared.is_some();
    let bounds = declared.map_or_else(|| measured_bounds(scans, should_stop), Ok)?;
    let mut grid = Grid { bounds, side };
    let (mut counts, outside) = count(scans, &grid, should_stop)?;
    // headers that are wrong
    if outside > 0 && is_known {
        grid.bounds = measured_bounds(scans, should_stop)?;
        counts = count(scans, &grid, should_stop)?.0;
    }
    let chosen = spread(&counts, &grid.along_the_curve(), wanted);
    Ok(Sample {
        points: chosen.iter().map(|column| counts[*column]).sum(),
        occupied: counts.iter().filter(|count| **count > 0).count(),
        boxes: chosen.into_iter().map(|column| grid.column_box(column)).collect(),
    })
}

/// Columns in the order of `order`, so that of every run of them about the same share of points is chosen.
fn spread(counts: &[u64], order: &[usize], wanted: u64) -> Vec<usize> {
    let total: u64 = counts.iter().sum();
    let share = wanted as f64 / total.max(1) as f64;
    let (mut owed, mut chosen) = (0.0, Vec::new());
    let occupied = || order.iter().copied().filter(|column| counts[*column] > 0);
    for column in occupied() {
        let count = counts[column] as f64;
        owed += share * count;
        if owed >= count / 2.0 {
            owed -= count;
            chosen.push(column);
        }
    }
    if chosen.is_empty() {
        // all points in few columns: the smallest
        chosen.extend(occupied().min_by_key(|column| counts[*column]));
    }
    chosen
}

/// Points of each column, and points in none.
fn count(
    scans: &[Box<dyn Scan>],
    grid: &Grid,
    should_stop: &(dyn Fn() -> bool + Sync),
) -> Result<(Vec<u64>, u64), MeasureError> {
    let outside = AtomicU64::new(0);
    let counts: Vec<AtomicU64> = (0..grid.side * grid.side).map(|_| AtomicU64::new(0)).collect();
    visit_batches(scans, should_stop, &|positions| {
        for position in positions {
            let counter = grid.column(*position).map_or(&outside, |column| &counts[column]);
            counter.fetch_add(1, Ordering::Relaxed);
        }
    })?;
    Ok((counts.into_iter().map(AtomicU64::into_inner).collect(), outside.into_inner()))
}

/// A grid of columns over the ground.
struct Grid {
    bounds: Aabb,
    side: usize,
}

impl Grid {
    fn column(&self, place: [f64; 3]) -> Option<usize> {
        if !self.bounds.contains(place) {
            return None;
        }
        let [x, y, _] = place;
        let along = |value: f64, a: usize| {
            let extent = self.bounds.max[a] - self.bounds.min[a];
            let share = if extent > 0.0 { (value - self.bounds.min[a]) / extent } else { 0.0 };
            ((share * self.side as f64) as usize).min(self.side - 1)
        };
        Some(along(y, 1) * self.side + along(x, 0))
    }

    fn column_box(&self, column: usize) -> Aabb {
        let Aabb { min, max } = self.bounds;
        let edge = |i: usize, a: usize| {
            if i == self.side { max[a] } else { min[a] + (max[a] - min[a]) * (i as f64 / self.side as f64) }
        };
        let (x, y) = (column % self.side, column / self.side);
        Aabb { min: [edge(x, 0), edge(y, 1), min[2]], max: [edge(x + 1, 0), edge(y + 1, 1), max[2]] }
    }

    /// All columns along a Morton curve: neighbours in it are neighbours on the ground.
    fn along_the_curve(&self) -> Vec<usize> {
        let mut columns: Vec<usize> = (0..self.side * self.side).collect();
        let code = |column: &usize| {
            pointmill_format::batches::morton21([(column % self.side) as u32, (column / self.side) as u32, 0])
        };
        columns.sort_by_key(code);
        columns
    }
}

/// The bounds that the headers of all scans declare.
fn declared_bounds(scans: &[Box<dyn Scan>]) -> Option<Aabb> {
    let is_usable = |b: &Aabb| b.min.iter().chain(&b.max).all(|v| v.is_finite()) && !b.is_empty();
    let declared = scans.iter().map(|scan| scan.info().bounds_declared.filter(is_usable));
    declared.collect::<Option<Vec<_>>>().map(|all| all.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds)))
}

fn measured_bounds(scans: &[Box<dyn Scan>], should_stop: &(dyn Fn() -> bool + Sync)) -> Result<Aabb, MeasureError> {
    let all = std::sync::Mutex::new(Aabb::EMPTY);
    visit_batches(scans, should_stop, &|positions| {
        let mut mine = Aabb::EMPTY;
        positions.iter().for_each(|position| mine.grow(*position));
        let mut all = crate::cloud::locked(&all);
        *all = all.union(&mine);
    })?;
    Ok(all.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// Calls `with` for the positions of all points that are numbers, on all threads.
fn visit_batches(
    scans: &[Box<dyn Scan>],
    should_stop: &(dyn Fn() -> bool + Sync),
    with: &(dyn Fn(&[[f64; 3]]) + Sync),
) -> Result<(), MeasureError> {
    for scan in scans {
        let info = scan.info();
        let wanted = Wanted::positions(info);
        in_parallel(
            scan.pieces().len(),
            || (Scratch::default(), Vec::new()),
            |piece, (scratch, positions)| {
                if should_stop() {
                    return Err(MeasureError::Interrupted);
                }
                scan.decode(piece, &wanted, scratch, &mut |batch| {
                    positions.clear();
                    match (&batch.positions, &info.lattice) {
                        (Positions::Quantized(p), Some(lattice)) => positions.extend(
                            (0..batch.len()).map(|i| lattice.world(p.each_ref().map(|axis| i64::from(axis[i])))),
                        ),
                        (Positions::World(p), _) => {
                            let all = (0..batch.len()).map(|i| p.each_ref().map(|axis| axis[i]));
                            positions.extend(all.filter(|p| p.iter().all(|v| v.is_finite())));
                        }
                        (Positions::Quantized(_), None) => {}
                    }
                    with(positions);
                    ControlFlow::Continue(())
                })?;
                Ok(())
            },
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_points_is_the_same_everywhere() {
        let grid = Grid { bounds: Aabb { min: [0.0; 3], max: [16.0, 16.0, 1.0] }, side: 16 };
        // twice as dense on the right
        let counts: Vec<u64> = (0..256).map(|column| if column % 16 < 8 { 100 } else { 200 }).collect();
        let total: u64 = counts.iter().sum();
        let chosen = spread(&counts, &grid.along_the_curve(), total / 4);
        let of = |right: bool| chosen.iter().filter(|c| (**c % 16 >= 8) == right).count();
        assert!(of(false).abs_diff(32) <= 1 && of(true).abs_diff(32) <= 1, "{} {}", of(false), of(true));
        assert_eq!(spread(&counts, &grid.along_the_curve(), total).len(), 256);
        // never nothing
        assert_eq!(spread(&counts, &grid.along_the_curve(), 0).len(), 1);
        assert_eq!(spread(&[0, 5, 3, 0], &[0, 1, 2, 3], 1), [2]);
    }

    #[test]
    fn boxes_hold_what_was_counted_in_them() {
        let bounds = Aabb { min: [500_000.1, -3.0, 7.0], max: [500_777.7, 0.3, 7.0] };
        let grid = Grid { bounds, side: 7 };
        let mut random = pointmill_testkit::Random::new(3);
        for _ in 0..1000 {
            let place = [0, 1, 2].map(|a| bounds.min[a] + (bounds.max[a] - bounds.min[a]) * random.unit());
            let column = grid.column(place).unwrap();
            assert!(grid.column_box(column).contains(place));
        }
        assert_eq!(grid.column(bounds.max), Some(48));
        assert_eq!(grid.column([0.0; 3]), None);
        assert_eq!(grid.column([500_500.0, -1.0, 7.1]), None, "above");
        assert_eq!(Grid { bounds: Aabb::EMPTY, side: 7 }.column([0.0; 3]), None);
        let flat = Grid { bounds: Aabb { min: [1.0; 3], max: [1.0; 3] }, side: 2 };
        assert_eq!(flat.column([1.0; 3]), Some(0));
    }
}
