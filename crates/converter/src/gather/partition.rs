//! The coarse grid by which records are grouped while they are read: cells of the cube that the headers promise. Where the
//! points have another cube, their records are grouped by its cells later ([`super::loose`]).

use pointmill_format::Lattice;

use crate::cloud::{Cube, JobBounds, JobColumns, JobPoint, StoredOrigin, TREE_BITS, high, morton};

/// Bits of a packed cell coordinate, per axis.
const CELL_BITS: u32 = 21;

/// Aim of the grid: points in an occupied cell of a surface-like cloud.
const POINTS_PER_CELL: u64 = 32_768;

/// Levels of the grid, least and most.
const LEVELS: (u32, u32) = (6, 8);

/// Where the points are, as far as it is known before they are read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hint {
    pub(super) bounds: JobBounds,
    /// A header says so. Else the points will not have exactly these bounds.
    pub(super) is_promise: bool,
}

/// Cells of the grid, and the frame in which records keep their integers.
#[derive(Debug, Clone)]
pub(super) struct Partition {
    /// What is stored as zeros.
    origin: StoredOrigin,
    /// The level of the octree that the cells have.
    pub(super) level: u32,
    /// The cube that is believed; `None`: cells would be of no use.
    cube: Option<Cube>,
}

impl Partition {
    /// A grid for about `points` points.
    pub(super) fn choose(hint: Option<Hint>, lattice: &Lattice, points: u64) -> Self {
        let bounds = hint.map_or(JobBounds::new([0; 3], [1 << 20; 3]), |hint| hint.bounds);
        let center: [i64; 3] = std::array::from_fn(|a| bounds.min[a] / 2 + bounds.max[a] / 2);
        // Integers of a single LAS file fit as they are; only far-apart lattices need another zero.
        let fits = |v: i64| i32::try_from(v).is_ok();
        let origin = if bounds.min.0.iter().chain(&bounds.max.0).all(|v| fits(*v)) { [0; 3] } else { center };
        // Surfaces: cells quadruple with each level.
        let level = (points / POINTS_PER_CELL).max(1).ilog2().div_ceil(2).clamp(LEVELS.0, LEVELS.1);
        let promised = hint.filter(|hint| hint.is_promise);
        let cube = promised.and_then(|hint| Cube::around(&hint.bounds, lattice).ok());
        Self { origin: StoredOrigin(JobPoint(origin)), level, cube }
    }

    pub(super) fn origin(&self) -> StoredOrigin {
        self.origin
    }

    /// True if every point within `bounds` can be stored.
    pub(super) fn holds(&self, bounds: &JobBounds) -> bool {
        (0..3).all(|a| {
            let fits = |q: i64| q.checked_sub(self.origin.0[a]).is_some_and(|v| i32::try_from(v).is_ok());
            fits(bounds.min[a]) && fits(bounds.max[a])
        })
    }

    /// True if points are to be grouped by its cells.
    pub(super) fn has_cells(&self) -> bool {
        self.cube.is_some()
    }

    /// True if its cells are nodes of that cube.
    pub(super) fn is_of(&self, cube: &Cube) -> bool {
        self.cube.as_ref() == Some(cube)
    }

    /// Packed cells of points. Those outside of the believed cube get some cell.
    pub(super) fn cells(&self, q: &JobColumns, out: &mut Vec<u64>) {
        out.clear();
        let Some(cube) = &self.cube else { return };
        let [x, y, z] = &q.0;
        let points = x.iter().zip(y).zip(z);
        let last = (1 << self.level) - 1;
        match cube.cell_factors(self.level) {
            Some(factors) => {
                let cell = |v: i64, a: usize| high(v.wrapping_sub(cube.min[a]) as u64, factors[a]).min(last);
                out.extend(points.map(|((x, y), z)| pack([cell(*x, 0), cell(*y, 1), cell(*z, 2)])));
            }
            None => out.extend(points.map(|((x, y), z)| {
                let cell = cube.tree(JobPoint([*x, *y, *z])).cell(TREE_BITS - self.level);
                pack(cell.map(|c| u64::from(c).min(last)))
            })),
        }
    }
}

fn pack(cell: [u64; 3]) -> u64 {
    cell[0] << (2 * CELL_BITS) | cell[1] << CELL_BITS | cell[2]
}

/// The Morton code of a packed cell.
pub(super) fn morton_of(packed: u64) -> u64 {
    let mask = (1 << CELL_BITS) - 1;
    morton::interleave([packed >> (2 * CELL_BITS) & mask, packed >> CELL_BITS & mask, packed & mask].map(|c| c as u32))
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn partition(bounds: JobBounds, scale: [f64; 3], points: u64) -> (Partition, Cube) {
        let lattice = Lattice { scale, offset: [0.0; 3] };
        let hint = Some(Hint { bounds, is_promise: true });
        (Partition::choose(hint, &lattice, points), Cube::around(&bounds, &lattice).unwrap())
    }

    #[test]
    fn cells_are_nodes_of_the_promised_cube() {
        let bounds = JobBounds::new([1000, -70_000, 5], [101_000, 30_123, 9_000]);
        let mut random = Random::new(2);
        for scale in [[0.01; 3], [0.25, 0.5, 0.125], [0.01, 0.01, 0.001], [0.3, 0.001, 40.0]] {
            for points in [0, 20_000_000, 10_000_000_000] {
                let (partition, cube) = partition(bounds, scale, points);
                assert!(partition.has_cells() && partition.is_of(&cube));
                let columns = JobColumns([0, 1, 2].map(|a| {
                    let inside = (0..500).map(|_| bounds.min[a] + random.below(bounds.extent(a) + 1) as i64);
                    [bounds.min[a], bounds.max[a]].into_iter().chain(inside).collect()
                }));
                let mut cells = Vec::new();
                partition.cells(&columns, &mut cells);
                for (i, cell) in cells.iter().enumerate() {
                    let expected = morton::path(cube.tree(columns.point(i)), 31 - partition.level, partition.level);
                    assert_eq!(morton_of(*cell), expected, "{scale:?} {:?}", columns.point(i));
                }
            }
        }
    }

    #[test]
    fn other_points_get_some_cell_and_other_bounds_are_another_cube() {
        let bounds = JobBounds::new([1000, -70_000, 5], [101_000, 30_123, 9_000]);
        let (partition, _) = partition(bounds, [0.01; 3], 20_000_000);
        let far = [i64::MIN, -5, 999, 101_002, 1 << 40, i64::MAX].to_vec();
        let mut cells = Vec::new();
        partition.cells(&JobColumns([far.clone(), far.clone(), far]), &mut cells);
        assert!(cells.iter().all(|cell| morton_of(*cell) < 1 << (3 * partition.level)));
        let mut other = bounds;
        other.max[0] += 2;
        let lattice = Lattice { scale: [0.01; 3], offset: [0.0; 3] };
        assert!(!partition.is_of(&Cube::around(&other, &lattice).unwrap()));
        let hint = Hint { bounds, is_promise: false };
        assert!(!Partition::choose(Some(hint), &lattice, 20_000_000).has_cells());
        assert!(!Partition::choose(None, &lattice, 20_000_000).has_cells());
    }

    #[test]
    fn integers_have_room_for_32_bits_around_their_zero() {
        let far = 1 << 40;
        let (partition, _) = partition(JobBounds::new([far; 3], [far + 1000; 3]), [0.01; 3], 1);
        let bounds = |min: i64, max: i64| JobBounds::new([far, far, min], [far, far, max]);
        assert!(partition.holds(&bounds(far - (1 << 31) + 500, far + (1 << 31) + 499)));
        assert!(!partition.holds(&bounds(far, far + (1 << 31) + 500)));
    }
}
