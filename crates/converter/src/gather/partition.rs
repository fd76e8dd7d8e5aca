//! The coarse grid by which records are grouped while they are read, before the exact bounds are known.

use pointmill_format::{Lattice, NodeKey};

use crate::cloud::{ANCHOR_BITS, Cube, JobBounds, JobColumns, JobPoint, StoredOrigin, TREE_BITS, morton};

/// Bits of a packed cell coordinate, per axis.
const CELL_BITS: u32 = 21;

/// Aim of the grid: points in an occupied cell of a surface-like cloud.
const POINTS_PER_CELL: u64 = 32_768;

/// Cells of the grid, and the frame in which records keep their integers.
#[derive(Debug, Clone)]
pub(super) struct Partition {
    /// What is stored as zeros.
    origin: StoredOrigin,
    grid: Grid,
}

#[derive(Debug, Clone)]
enum Grid {
    /// Scales that are equal, or powers of two apart: cells of `2^shift` lattice steps on the absolute lattice. They are
    /// octree nodes of any cube whose anchor is at least that coarse, so the bounds need not be known:
    /// `cell = (q >> shift) - first`.
    Absolute { shift: [u32; 3], first: [i64; 3] },
    /// Other scales: cells of a cube that is believed until the bounds are known.
    OfCube { cube: Box<Cube>, level: u32 },
}

impl Partition {
    /// A grid for about `points` points inside `hint`.
    pub(super) fn choose(hint: Option<JobBounds>, lattice: &Lattice, points: u64) -> Self {
        let hint = hint.unwrap_or(JobBounds::new([0; 3], [1 << 20; 3]));
        let center: [i64; 3] = std::array::from_fn(|a| hint.min[a] / 2 + hint.max[a] / 2);
        // Integers of a single LAS file fit as they are; only far-apart lattices need another zero.
        let fits = |v: i64| i32::try_from(v).is_ok();
        let origin = if hint.min.0.iter().chain(&hint.max.0).all(|v| fits(*v)) { [0; 3] } else { center };
        // Surfaces: cells quadruple with each level.
        let level = (points / POINTS_PER_CELL).max(1).ilog2().div_ceil(2).clamp(ANCHOR_BITS + 2, 8);
        let cube = Cube::around(&hint, lattice);
        let shift = match cube {
            Ok(cube) => cube.aligned_shift(level).ok_or(cube),
            Err(_) => Ok(Cube::largest_shift(lattice, level)),
        };
        let grid = match shift {
            Ok(shift) => {
                // whole multiples of what wider cells may span
                let first = std::array::from_fn(|a| ((center[a] >> shift[a]) - (1 << (CELL_BITS - 1))) >> 8 << 8);
                Grid::Absolute { shift, first }
            }
            Err(cube) => Grid::OfCube { cube: Box::new(cube), level },
        };
        Self { origin: StoredOrigin(JobPoint(origin)), grid }
    }

    pub(super) fn origin(&self) -> StoredOrigin {
        self.origin
    }

    /// True if every point within `bounds` can be stored and has a cell.
    pub(super) fn holds(&self, bounds: &JobBounds) -> bool {
        let stored = (0..3).all(|a| {
            let fits = |q: i64| q.checked_sub(self.origin.0[a]).is_some_and(|v| i32::try_from(v).is_ok());
            fits(bounds.min[a]) && fits(bounds.max[a])
        });
        stored
            && match &self.grid {
                Grid::Absolute { shift, first } => (0..3).all(|a| {
                    (bounds.min[a] >> shift[a]) >= first[a] && (bounds.max[a] >> shift[a]) - first[a] < 1 << CELL_BITS
                }),
                Grid::OfCube { .. } => true,
            }
    }

    /// Packed cells of points that the partition holds.
    pub(super) fn cells(&self, q: &JobColumns, out: &mut Vec<u64>) {
        out.clear();
        let [x, y, z] = &q.0;
        let points = x.iter().zip(y).zip(z);
        match &self.grid {
            Grid::Absolute { shift, first } => out.extend(points.map(|((x, y), z)| {
                pack([
                    ((x >> shift[0]) - first[0]) as u64,
                    ((y >> shift[1]) - first[1]) as u64,
                    ((z >> shift[2]) - first[2]) as u64,
                ])
            })),
            Grid::OfCube { cube, level } => out.extend(points.map(|((x, y), z)| {
                // Points outside the believed cube get some cell: the pass is then repeated anyway.
                pack(cube.tree(JobPoint([*x, *y, *z])).cell(TREE_BITS - level).map(u64::from))
            })),
        }
    }

    /// True if the cells are octree nodes of the final cube.
    pub(super) fn fits(&self, cube: &Cube, bounds: &JobBounds) -> bool {
        match &self.grid {
            Grid::Absolute { shift, .. } => self.holds(bounds) && cube.is_anchored_on(*shift),
            Grid::OfCube { cube: believed, .. } => self.holds(bounds) && **believed == *cube,
        }
    }

    /// The octree node of a packed cell that is `wider` levels above those of the partition.
    pub(super) fn node(&self, packed: u64, wider: u32, cube: &Cube) -> NodeKey {
        let cell = unpack(packed);
        match &self.grid {
            Grid::Absolute { shift, first } => {
                let at = |a: usize| cell[a] as i64 + (first[a] >> wider) - (cube.min[a] >> (shift[a] + wider));
                let [x, y, z] = [0, 1, 2].map(|a| at(a) as u32);
                NodeKey { level: (cube.level_of(*shift) - wider) as u8, x, y, z }
            }
            Grid::OfCube { level, .. } => {
                let [x, y, z] = cell.map(|c| c as u32);
                NodeKey { level: (*level - wider) as u8, x, y, z }
            }
        }
    }
}

/// The cell `wider` levels above one of the partition.
pub(super) fn coarser(packed: u64, wider: u32) -> u64 {
    if wider == 0 { packed } else { pack(unpack(packed).map(|c| c >> wider)) }
}

pub(super) fn pack(cell: [u64; 3]) -> u64 {
    let mask = (1 << CELL_BITS) - 1;
    (cell[0] & mask) << (2 * CELL_BITS) | (cell[1] & mask) << CELL_BITS | (cell[2] & mask)
}

/// Rank of a packed cell in Morton order.
pub(super) fn morton_of(packed: u64) -> u64 {
    morton::interleave(unpack(packed).map(|c| c as u32))
}

fn unpack(packed: u64) -> [u64; 3] {
    let mask = (1 << CELL_BITS) - 1;
    [packed >> (2 * CELL_BITS) & mask, packed >> CELL_BITS & mask, packed & mask]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(hint: JobBounds, actual: JobBounds, scale: [f64; 3]) -> bool {
        let lattice = Lattice { scale, offset: [0.0; 3] };
        let partition = Partition::choose(Some(hint), &lattice, 20_000_000);
        let cube = Cube::around(&actual, &lattice).unwrap();
        if !partition.fits(&cube, &actual) {
            return false;
        }
        // Every corner lies in the node that the partition names.
        let mut cells = Vec::new();
        for corner in 0..8 {
            let q: [i64; 3] = std::array::from_fn(|a| if corner >> a & 1 == 0 { actual.min[a] } else { actual.max[a] });
            partition.cells(&JobColumns(q.map(|v| vec![v])), &mut cells);
            let node = partition.node(cells[0], 0, &cube);
            assert_eq!([node.x, node.y, node.z], cube.tree(JobPoint(q)).cell(31 - u32::from(node.level)));
        }
        true
    }

    #[test]
    fn cells_are_octree_nodes_even_when_the_header_was_somewhat_wrong() {
        let hint = JobBounds::new([1000, -70_000, 5], [101_000, 30_123, 9_000]);
        assert!(check(hint, hint, [0.01; 3]));
        let slightly_larger = JobBounds::new([900, -70_003, 5], [101_000, 31_123, 12_000]);
        assert!(check(hint, slightly_larger, [0.01; 3]));
        let half = JobBounds::new([1000, -30_000, 5], [40_000, 123, 9_000]);
        assert!(check(hint, half, [0.01; 3]));
        let tiny = JobBounds::new([1000; 3], [1300; 3]);
        assert!(!check(hint, tiny, [0.01; 3]), "cells coarser than the anchor must be refused");
        assert!(check(hint, slightly_larger, [0.25, 0.5, 0.125]), "powers of two apart");
        assert!(check(hint, half, [0.25, 0.5, 0.125]));
        assert!(check(hint, hint, [0.01, 0.01, 0.001]));
        assert!(!check(hint, slightly_larger, [0.01, 0.01, 0.001]));
    }
}
