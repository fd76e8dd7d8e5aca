//! A fair part of a large scene: whole columns of ground, evenly spread.

use std::ops::ControlFlow;
use std::sync::Mutex;

use pointmill_format::{Aabb, Positions, Scan, Scratch, Wanted};

use crate::MeasureError;
use crate::cloud::{in_parallel, locked};

/// Columns that a sample should have, as far as the scene lets it: many are fair, few are whole.
const COLUMNS: f64 = 12.0;

/// The ground is halved so often at most.
const MOST_HALVINGS: u32 = 16;

/// Points by which columns are chosen, at least, if the scene has as many: those of a column are known to a quarter at worst.
const PROBES: u64 = 1 << 20;

/// Which columns of a scene are measured.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sample {
    /// Their boxes, without gaps in height.
    pub(crate) boxes: Vec<Aabb>,
    /// Columns with points.
    pub(crate) occupied: usize,
}

/// Chooses columns with about `wanted` of the `points` of the scans. Columns have equal numbers of points, whatever ground
/// they cover: a point far from all others widens one of them, and changes no other.
///
/// # Errors
/// A scan that cannot be read, the request to stop.
pub(crate) fn choose(
    scans: &[Box<dyn Scan>],
    points: u64,
    wanted: u64,
    should_stop: &(dyn Fn() -> bool + Sync),
) -> Result<Sample, MeasureError> {
    let (bounds, mut probes) = probe(scans, points.div_ceil(PROBES).max(1), should_stop)?;
    let share = wanted as f64 / points.max(1) as f64;
    let halvings = (COLUMNS / share).log2().ceil().clamp(2.0, f64::from(MOST_HALVINGS)) as u32;
    let mut columns = Vec::new();
    divide(&mut probes, bounds, halvings, &mut columns);
    let counts: Vec<u64> = columns.iter().map(|column| column.points).collect();
    let chosen = spread(&counts, share * counts.iter().sum::<u64>() as f64);
    Ok(Sample { occupied: columns.len(), boxes: chosen.into_iter().map(|i| columns[i].bounds).collect() })
}

/// A part of the ground, from the lowest to the highest point of the scene.
#[derive(Debug)]
struct Column {
    bounds: Aabb,
    points: u64,
}

/// Halves the ground `halvings` times by numbers of points, across its longer side; columns that follow each other are
/// neighbours. A plane lies between two coordinates, so that no point is in two columns. `probes`: x and y.
fn divide(probes: &mut [[f64; 2]], bounds: Aabb, halvings: u32, columns: &mut Vec<Column>) {
    let longer = usize::from(bounds.extent()[1] > bounds.extent()[0]);
    let plane = || [longer, 1 - longer].into_iter().find_map(|axis| Some((axis, middle(probes, axis)?)));
    let Some((axis, plane)) = (halvings > 0).then(plane).flatten() else {
        columns.push(Column { bounds, points: probes.len() as u64 });
        return;
    };
    let (mut low, mut high) = (bounds, bounds);
    (low.max[axis], high.min[axis]) = (plane, plane);
    probes.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
    let (below, above) = probes.split_at_mut(probes.partition_point(|p| p[axis] < plane));
    divide(below, low, halvings - 1, columns);
    divide(above, high, halvings - 1, columns);
}

/// A coordinate with half of the points on either side, as nearly as may be, and none on it; `None` if they share theirs.
fn middle(probes: &[[f64; 2]], axis: usize) -> Option<f64> {
    let mut values: Vec<f64> = probes.iter().map(|p| p[axis]).collect();
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len() / 2;
    let at_half = *values.get(half)?;
    // the ends of the run of equals at the middle
    let ends = [values.partition_point(|v| *v < at_half), values.partition_point(|v| *v <= at_half)];
    let inside = ends.into_iter().filter(|end| (1..values.len()).contains(end));
    let end = inside.min_by_key(|end| end.abs_diff(half))?;
    let (below, above) = (values[end - 1], values[end]);
    let plane = below + (above - below) / 2.0;
    // doubles next to each other have none between
    Some(if plane > below { plane } else { above })
}

/// Columns of which about `wanted` points are, so that of every run of columns about the same share is chosen.
fn spread(counts: &[u64], wanted: f64) -> Vec<usize> {
    let share = wanted / counts.iter().sum::<u64>().max(1) as f64;
    let (mut owed, mut chosen) = (0.0, Vec::new());
    for (column, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let count = *count as f64;
        owed += share * count;
        if owed >= count / 2.0 {
            owed -= count;
            chosen.push(column);
        }
    }
    if chosen.is_empty() {
        // all points in few columns: the smallest
        let occupied = (0..counts.len()).filter(|column| counts[*column] > 0);
        chosen.extend(occupied.min_by_key(|column| counts[*column]));
    }
    chosen
}

/// The bounds of all points, and x and y of each `step`-th of a piece.
fn probe(
    scans: &[Box<dyn Scan>],
    step: u64,
    should_stop: &(dyn Fn() -> bool + Sync),
) -> Result<(Aabb, Vec<[f64; 2]>), MeasureError> {
    let all = Mutex::new((Aabb::EMPTY, Vec::new()));
    visit_batches(scans, should_stop, &|piece, first, positions| {
        let mut mine = Aabb::EMPTY;
        positions.iter().for_each(|position| mine.grow(*position));
        let mut all = locked(&all);
        all.0 = all.0.union(&mine);
        let is_probe = |(i, _): &(u64, &[f64; 3])| is_probe(piece, first + i, step);
        all.1.extend((0..).zip(positions).filter(is_probe).map(|(_, [x, y, _])| [*x, *y]));
    })?;
    Ok(all.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// Whether a point of a piece is one of each `step`. Every piece begins elsewhere, so that those shorter than a step count as
/// much as longer ones.
fn is_probe(piece: usize, point: u64, step: u64) -> bool {
    (point + (piece as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) % step) % step == 0
}

/// Calls `with` for the positions of all points that are numbers, on all threads, with the number of the piece and that of the
/// first point among these points of the piece.
fn visit_batches(
    scans: &[Box<dyn Scan>],
    should_stop: &(dyn Fn() -> bool + Sync),
    with: &(dyn Fn(usize, u64, &[[f64; 3]]) + Sync),
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
                let mut first = 0;
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
                    with(piece, first, positions);
                    first += positions.len() as u64;
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

    fn columns(points: &[[f64; 2]], halvings: u32) -> Vec<Column> {
        let mut bounds = Aabb::EMPTY;
        points.iter().for_each(|[x, y]| bounds.grow([*x, *y, 0.0]));
        let mut columns = Vec::new();
        divide(&mut points.to_vec(), bounds, halvings, &mut columns);
        columns
    }

    #[test]
    fn columns_hold_equal_numbers_of_points_whatever_lies_far_away() {
        let mut random = pointmill_testkit::Random::new(3);
        // denser on the right
        let mut points: Vec<[f64; 2]> =
            (0..6400).map(|_| [500_000.0 + 100.0 * random.unit().sqrt(), 40.0 * random.unit()]).collect();
        points.push([-1e9, 1e9]);
        let found = columns(&points, 6);
        assert_eq!(found.len(), 64);
        assert!(found.iter().all(|c| (100..=102).contains(&c.points)), "{found:?}");
        for [x, y] in &points {
            assert_eq!(found.iter().filter(|c| c.bounds.contains([*x, *y, 0.0])).count(), 1, "{x} {y}");
        }
    }

    #[test]
    fn planes_lie_between_coordinates_that_many_points_share() {
        let grid: Vec<[f64; 2]> = (0..900).map(|i| [f64::from(i % 3), f64::from(i / 3 % 2)]).collect();
        let found = columns(&grid, 9);
        assert_eq!(found.iter().map(|c| c.points).collect::<Vec<_>>(), [150; 6]);
        assert_eq!(columns(&[[1.0; 2]; 5], 3).len(), 1, "one place cannot be divided");
        assert_eq!(columns(&[], 3).len(), 1);
        let next = 1f64.next_up();
        assert_eq!(middle(&[[1.0; 2], [next; 2]], 0), Some(next), "nothing lies between");
        assert_eq!(middle(&[[0.0; 2], [1.0; 2], [1.0; 2], [1.0; 2]], 0), Some(0.5));
    }

    #[test]
    fn short_pieces_have_their_share_of_probes() {
        let probes = |pieces: usize, points: u64| {
            (0..pieces)
                .flat_map(|piece| (0..points).map(move |i| (piece, i)))
                .filter(|(p, i)| is_probe(*p, *i, 1000))
                .count()
        };
        assert_eq!(probes(1, 50_000), 50);
        assert!(probes(5000, 10).abs_diff(50) <= 5, "{}", probes(5000, 10));
        assert!((0..7).all(|i| is_probe(3, i, 1)));
    }

    #[test]
    fn the_share_of_points_is_the_same_everywhere() {
        // twice as dense in the second half
        let counts: Vec<u64> = (0..256).map(|column| if column < 128 { 100 } else { 200 }).collect();
        let total = counts.iter().sum::<u64>() as f64;
        let chosen = spread(&counts, total / 4.0);
        let of = |second: bool| chosen.iter().filter(|c| (**c >= 128) == second).count();
        assert!(of(false).abs_diff(32) <= 1 && of(true).abs_diff(32) <= 1, "{} {}", of(false), of(true));
        assert_eq!(spread(&counts, total).len(), 256);
        // never nothing
        assert_eq!(spread(&counts, 0.0).len(), 1);
        assert_eq!(spread(&[0, 5, 3, 0], 1.0), [2]);
        assert_eq!(spread(&[0], 1.0), [0; 0]);
    }
}
