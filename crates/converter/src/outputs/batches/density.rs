//! The cell of the coarsest level of detail where the plan does not state one: from the density of the points.

use pointmill_format::{Aabb, Lattice, NodeKey};

use crate::cloud::{CensusCell, Cloud, JobBounds};

/// Points that a cell of level 0 should hold. Of a surface level 0 then shows one point in 64, level 1 one in 16 and level
/// 2 one in 4.
const POINTS_PER_CELL: f64 = 64.0;

/// The power of two at which the number of occupied cells is nearest to one for every [`POINTS_PER_CELL`] points, as far as
/// the cells of the partition tell; places that very many points share count once. It depends on the points and the headers
/// alone, and is a cell that the format can have, whatever the cloud.
pub(super) fn fitting_cell(cloud: &Cloud<'_>, tight: &Aabb) -> f64 {
    let extent = tight.extent().into_iter().fold(0.0, f64::max);
    // Cells are counted from whole units: a small cloud may lie nearly one unit away from the first.
    let reach = (0..3).map(|a| tight.max[a] - tight.min[a].floor()).fold(extent, f64::max);
    // 2^29 cells at most: the format has room for 2^30.
    let least = power_above((reach / f64::from(1 << 29)).max(f64::MIN_POSITIVE));
    if extent > 0.0 { Density::of(cloud).cell(power_above(extent), least) } else { least.max(1.0) }
}

/// The least power of two that is not below `v`, > 0 and far from the ends of doubles.
fn power_above(v: f64) -> f64 {
    let power = 2f64.powi(v.log2().floor() as i32);
    if power < v { 2.0 * power } else { power }
}

/// Points of a cell of the partition, and the area of the surface that they lie on, world units squared.
#[derive(Debug, Clone, Copy)]
struct Patch {
    points: u64,
    area: f64,
}

/// What the cells of the partition tell of how densely points lie.
struct Density {
    patches: Vec<Patch>,
    /// Side, and number of occupied cells, of the partition's level and those above, finest first.
    levels: Vec<(f64, u64)>,
}

impl Density {
    fn of(cloud: &Cloud<'_>) -> Self {
        let lattice = &cloud.lattice.lattice;
        let side = |level: u8| cloud.frame.cube.side / 2f64.powi(i32::from(level));
        let patch = |cell: &CensusCell| {
            let own = |b: JobBounds| area([0, 1, 2].map(|a| b.extent(a)), lattice, cell.distinct());
            let area = cloud
                .census
                .bounds
                .get(&cell.key)
                .copied()
                .map_or(f64::INFINITY, own)
                .min(side(cell.key.level).powi(2));
            Patch { points: cell.distinct(), area }
        };
        let mut keys: Vec<NodeKey> = cloud.census.cells.iter().map(|cell| cell.key).collect();
        let finest = keys.iter().map(|key| key.level).min().unwrap_or(0);
        let at = |level: u8| {
            keys.iter_mut().for_each(|key| *key = key.ancestor(level).unwrap_or(*key));
            keys.dedup(); // those of a wider cell follow each other in Morton order
            (side(level), keys.len() as u64)
        };
        let levels = (0..=finest).rev().map(at).collect();
        Self { patches: cloud.census.cells.iter().map(patch).collect(), levels }
    }

    /// Halves the cell from `widest` on, not below `least`, until there are enough.
    fn cell(&self, widest: f64, least: f64) -> f64 {
        let points: u64 = self.patches.iter().map(|patch| patch.points).sum();
        let aim = points as f64 / POINTS_PER_CELL;
        let (mut cell, mut before) = (widest.max(least), 0.0);
        loop {
            let cells = self.occupied(cell);
            if cells >= aim {
                // of the two around the aim the nearer, in octaves
                let is_nearer = before > 0.0 && aim / before < cells / aim;
                return if is_nearer { 2.0 * cell } else { cell };
            }
            if cell / 2.0 < least {
                return cell;
            }
            (cell, before) = (cell / 2.0, cells);
        }
    }

    /// About how many cells of that side are occupied.
    fn occupied(&self, side: f64) -> f64 {
        match self.levels.iter().rev().find(|(wide, _)| *wide <= side) {
            // Of a level of the partition it is known; between two levels a surface is in between.
            Some((near, cells)) => (*cells as f64 * (near / side).powi(2)).max(1.0),
            // Below, a cell holds one point at least, and no more cells are there than its surface has room for.
            None => self.patches.iter().map(|p| (p.area / (side * side)).min(p.points as f64).max(1.0)).sum(),
        }
    }
}

/// Area of a surface in a box of that many steps: its two longest sides; of a line, a strip of squares with as many points
/// as a cell should have.
fn area(steps: [u64; 3], lattice: &Lattice, points: u64) -> f64 {
    let mut sides: [f64; 3] = std::array::from_fn(|a| steps[a] as f64 * lattice.scale[a]);
    sides.sort_by(f64::total_cmp);
    let [_, middle, longest] = sides;
    longest * middle.max(longest * POINTS_PER_CELL / points as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of side 1, with cells around them that grow as those of a surface do.
    fn density(patches: &[(u64, f64)]) -> Density {
        let patches: Vec<Patch> = patches.iter().map(|(points, area)| Patch { points: *points, area: *area }).collect();
        let cells = patches.len() as u64;
        let level = |l: i32| (2f64.powi(l), (cells >> (2 * l)).max(1));
        Density { patches, levels: (0..12).map(level).collect() }
    }

    #[test]
    fn there_is_a_cell_for_every_64_points() {
        let cell = |d: Density| d.cell(4096.0, 2f64.powi(-40));
        assert_eq!(cell(density(&[(64, 1.0); 256])), 1.0);
        assert_eq!(cell(density(&[(4096, 1.0); 256])), 0.125);
        assert_eq!(cell(density(&[(1, 1.0); 1024])), 8.0, "every point in a cell of its own");
        // half of the points in one dense cell, half spread thinly: level 0 is not for these alone
        let mut mixed = vec![(2048, 1.0)];
        mixed.extend([(2, 1.0); 1024]);
        assert_eq!(cell(density(&mixed)), 4.0);
        // a point far away has a cell of its own, however wide
        let mut far = density(&[(1, 1e18), (640_000, 1.0)]);
        far.levels = vec![(1e9, 2), (2e9, 1)];
        assert_eq!(far.cell(2f64.powi(31), 2f64.powi(-40)), 2f64.powi(-7));
        assert_eq!(density(&[(5, 1.0)]).cell(4.0, 1e-3), 4.0);
        assert_eq!(density(&[(1 << 40, 1.0)]).cell(4.0, 0.25), 0.25);
    }

    #[test]
    fn powers_of_two_are_not_below() {
        assert_eq!([1.0, 1.5, 0.25, 3e-9].map(power_above), [1.0, 2.0, 0.25, 2f64.powi(-28)]);
    }

    #[test]
    fn surfaces_and_lines_have_an_area() {
        let lattice = Lattice { scale: [0.5, 1.0, 2.0], offset: [0.0; 3] };
        assert_eq!(area([8, 3, 1], &lattice, 1_000), 12.0);
        assert_eq!(area([0, 0, 320], &lattice, 640), 640.0 * 640.0 * 64.0 / 640.0);
    }
}
