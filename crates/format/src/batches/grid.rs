//! From world coordinates to cells, Morton coordinates and float32 boxes (`docs/formats/batches.md`, §2 and §5).

use crate::Aabb;
use crate::WriteError;
use crate::geometry::morton::{morton21, morton32};

/// Levels of detail that have cells: 0, 1, 2. Points that are in none of them have level 3.
pub const LOD_LEVELS: u32 = 3;

/// Morton coordinates have 21 bits while the cube is at most 2^19 cells wide, so that level 2 is still a subtree.
const MAX_EXPONENT_OF_21_BITS: u32 = 19;

/// The same for 32 bits: a wider cube has no place for the cells.
const MAX_EXPONENT: u32 = 30;

/// The grid of levels and Morton order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// World coordinates of the corner: whole units, on or below the tight minimum.
    pub origin: [f64; 3],
    /// Side of the cells of level 0, world units.
    pub cell: f64,
    /// The Morton cube is 2^exponent cells wide, 0 … 30.
    pub exponent: u32,
    /// Bits of a Morton coordinate: 21, or 32 if the exponent is above 19.
    pub morton_bits: u32,
}

impl Grid {
    /// The grid of a cloud with the tight box `tight` (world; empty for no points) and level-0 cells of side `cell`.
    ///
    /// # Errors
    /// [`WriteError::Cell`], [`WriteError::CellTooSmall`], [`WriteError::Extent`].
    pub fn new(tight: &Aabb, cell: f64) -> Result<Self, WriteError> {
        if !(cell.is_finite() && cell > 0.0) {
            return Err(WriteError::Cell(cell));
        }
        let mut grid = Self { origin: [0.0; 3], cell, exponent: 0, morton_bits: 21 };
        if tight.is_empty() {
            return Ok(grid);
        }
        grid.origin = tight.min.map(f64::floor);
        let far = grid.relative(tight.max);
        if !far.iter().all(|r| *r <= f64::from(f32::MAX)) {
            return Err(WriteError::Extent(tight.min, tight.max));
        }
        let extent = far.into_iter().fold(0.0, f64::max);
        let cells = extent / cell; // no smaller than any u: division is monotonous
        grid.exponent = (0..=MAX_EXPONENT)
            .find(|e| cells < power_of_two(*e))
            .ok_or_else(|| WriteError::CellTooSmall { cell, extent, least: extent / power_of_two(MAX_EXPONENT - 1) })?;
        grid.morton_bits = Self::morton_bits_for(grid.exponent);
        Ok(grid)
    }

    /// Bits of a Morton coordinate for that exponent: 21 or 32.
    pub const fn morton_bits_for(exponent: u32) -> u32 {
        if exponent <= MAX_EXPONENT_OF_21_BITS { 21 } else { 32 }
    }

    /// True if exponent and bits belong together, the cell is > 0 and everything is finite.
    pub fn is_valid(&self) -> bool {
        self.exponent <= MAX_EXPONENT
            && self.morton_bits == Self::morton_bits_for(self.exponent)
            && self.cell.is_finite()
            && self.cell > 0.0
            && self.origin.iter().all(|o| o.is_finite())
    }

    /// r = p − origin, for a point inside the box that the grid was made for: ≥ 0.
    #[must_use]
    pub fn relative(&self, world: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| world[a] - self.origin[a])
    }

    /// u = r / cell: the position in cells, < 2^exponent.
    #[must_use]
    pub fn cells(&self, relative: [f64; 3]) -> [f64; 3] {
        relative.map(|r| r / self.cell)
    }

    /// Morton coordinates of a position in cells, each below 2^[`Self::morton_bits`].
    #[must_use]
    pub fn morton_coordinates(&self, cells: [f64; 3]) -> [u32; 3] {
        let scale = power_of_two(self.morton_bits - self.exponent);
        cells.map(|u| (u * scale) as u32)
    }

    /// Morton code of a position in cells: 63 or 96 bits.
    #[must_use]
    pub fn morton_code(&self, cells: [f64; 3]) -> u128 {
        let coordinates = self.morton_coordinates(cells);
        if self.morton_bits == 21 { u128::from(morton21(coordinates)) } else { morton32(coordinates) }
    }

    /// The cell of `level` (0, 1, 2) that holds a position in cells.
    pub fn lod_cell(cells: [f64; 3], level: u32) -> [u32; 3] {
        cells.map(|u| (u * power_of_two(level)) as u32)
    }

    /// d²: squared distance from a position in cells to the centre of its cell of `level`, in sides of that cell.
    pub fn centre_distance_squared(cells: [f64; 3], level: u32) -> f64 {
        let [dx, dy, dz] = cells.map(|u| {
            let v = u * power_of_two(level);
            v - (v.floor() + 0.5)
        });
        (dx * dx + dy * dy) + dz * dz
    }
}

/// 2^k, k < 64.
fn power_of_two(k: u32) -> f64 {
    (1u64 << k) as f64
}

/// The largest float32 that is not above `v`; `v` within the range of float32.
pub fn f32_below(v: f64) -> f32 {
    let nearest = v as f32;
    if f64::from(nearest) > v { nearest.next_down() } else { nearest }
}

/// The smallest float32 that is not below `v`; `v` within the range of float32.
pub fn f32_above(v: f64) -> f32 {
    let nearest = v as f32;
    if f64::from(nearest) < v { nearest.next_up() } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(min: [f64; 3], max: [f64; 3], cell: f64) -> Grid {
        Grid::new(&Aabb { min, max }, cell).unwrap()
    }

    #[test]
    fn the_origin_is_whole_and_the_cube_the_smallest_that_holds_all() {
        let g = grid([-0.5, 500_000.1, 3.0], [0.4, 500_002.25, 3.0], 1.0);
        assert_eq!((g.origin, g.exponent, g.morton_bits), ([-1.0, 500_000.0, 3.0], 2, 21));
        assert_eq!(grid([0.0; 3], [4.0; 3], 1.0).exponent, 3, "a point on the border of the cube needs a larger one");
        assert_eq!(grid([0.0; 3], [0.0; 3], 1e-9).exponent, 0);
        assert_eq!(grid([0.0; 3], [524_287.9; 3], 1.0).morton_bits, 21);
        assert_eq!(grid([0.0; 3], [524_288.0; 3], 1.0).morton_bits, 32);
        assert_eq!(Grid::new(&Aabb::EMPTY, 2.0).unwrap().origin, [0.0; 3]);
    }

    #[test]
    fn cells_that_are_too_small_and_boxes_that_are_too_large_are_refused_with_advice() {
        let unit = Aabb { min: [0.0; 3], max: [1e6; 3] };
        let error = Grid::new(&unit, 1e-4).unwrap_err();
        let WriteError::CellTooSmall { least, .. } = error else { panic!("{error}") };
        assert!(Grid::new(&unit, least).is_ok() && Grid::new(&unit, least / 2.1).is_err());
        for cell in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(Grid::new(&unit, cell), Err(WriteError::Cell(_))));
        }
        for far in [1e39, f64::INFINITY] {
            assert!(matches!(Grid::new(&Aabb { min: [0.0; 3], max: [far; 3] }, 1.0), Err(WriteError::Extent(..))));
        }
    }

    #[test]
    fn cells_are_subtrees_of_the_morton_order() {
        for max in [3.9, 524_288.5] {
            let g = grid([0.0; 3], [max; 3], 1.0);
            for u in [[0.0; 3], [0.24, 0.25, 0.5], [max, 1.0, 2.999]] {
                for level in 0..LOD_LEVELS {
                    let shift = g.morton_bits - g.exponent - level;
                    assert_eq!(g.morton_coordinates(u).map(|c| c >> shift), Grid::lod_cell(u, level));
                }
            }
        }
    }

    #[test]
    fn distances_are_in_sides_of_the_cell() {
        assert_eq!(Grid::centre_distance_squared([7.5, 0.5, 2.5], 0), 0.0);
        assert_eq!(Grid::centre_distance_squared([0.5; 3], 1), 0.75, "a corner");
        assert_eq!(Grid::centre_distance_squared([0.0, 0.125, 0.375], 2), 0.25);
    }

    #[test]
    fn float32_neighbours_enclose_the_double() {
        for v in [0.0, 0.1, 0.7, 1.0, 2.25, 1e-50, 123_456.789, 16_777_217.0, f64::from(f32::MAX), -0.1] {
            let (below, above) = (f32_below(v), f32_above(v));
            assert!(f64::from(below) <= v && v <= f64::from(above), "{v}");
            assert!(below == above || below.next_up() == above, "{v}: as tight as can be");
        }
    }

    #[test]
    fn positions_from_the_origin_are_doubles() {
        let g = grid([5_400_000.062_5, -1.5, 0.0], [5_400_001.0, 3.0, 0.25], 0.25);
        assert_eq!(g.relative([5_400_000.562_5, -1.25, 0.25]), [0.5625, 0.75, 0.25]);
        let fine = 0.25 - 2f64.powi(-30); // more bits than single precision has
        assert_eq!(g.relative([5_400_000.562_5, -1.25, fine]), [0.5625, 0.75, fine]);
        assert_eq!(g.cells([0.5625, 0.75, 0.25]), [2.25, 3.0, 1.0]);
    }

    #[test]
    fn codes_have_the_bits_of_the_grid() {
        let wide = |exponent, morton_bits| Grid { origin: [0.0; 3], cell: 2.0, exponent, morton_bits };
        // the first halves along x, y and z are the three lowest bits of the highest digit
        for (grid, top) in [(wide(2, 21), 60), (wide(20, 32), 93)] {
            let half = power_of_two(grid.exponent) / 2.0;
            for (cells, digit) in [([half, 0.0, 0.0], 1), ([0.0, half, 0.0], 2), ([0.0, half, half], 6)] {
                assert_eq!(grid.morton_code(cells), digit << top, "{cells:?}");
            }
            assert!(grid.is_valid());
        }
        assert!(!Grid { cell: 0.0, ..wide(2, 21) }.is_valid() && !wide(2, 32).is_valid() && !wide(20, 21).is_valid());
    }
}
