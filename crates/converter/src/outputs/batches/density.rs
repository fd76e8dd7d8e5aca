//! The cell of the coarsest level of detail where the plan does not state one: from the density of the points.

use pointmill_format::{Aabb, Lattice, NodeKey};

use crate::cloud::{Cell, Cloud};

/// Points that a cell of level 0 should hold. Of a surface level 0 then shows one point in 64, level 1 one in 16 and level
/// 2 one in 4.
const POINTS_PER_CELL: f64 = 64.0;

/// A power of two such that half of the points lie in cells with fewer than about [`POINTS_PER_CELL`] points, half in
/// cells with more; places that very many points share count once. It depends on the points and the headers alone, and is
/// a cell that the format can have, whatever the cloud.
pub(super) fn fitting_cell(cloud: &Cloud<'_>, tight: &Aabb) -> f64 {
    let extent = tight.extent().into_iter().fold(0.0, f64::max);
    // Cells are counted from whole units: a small cloud may lie nearly one unit away from the first.
    let reach = (0..3).map(|a| tight.max[a] - tight.min[a].floor()).fold(extent, f64::max);
    let wanted = if extent > 0.0 { side_for(cloud).min(extent) } else { 1.0 };
    // 2^29 cells at most: the format has room for 2^30.
    let least = (reach / f64::from(1 << 29)).max(f64::MIN_POSITIVE);
    let power = 2f64.powi(wanted.max(least).log2().round() as i32);
    if power < least { 2.0 * power } else { power }
}

/// Points of a part of the cloud, and the area of the surface that they lie on, world units squared.
#[derive(Debug, Clone, Copy)]
struct Patch {
    points: u64,
    area: f64,
}

impl Patch {
    /// The side of a square of that surface with [`POINTS_PER_CELL`] points.
    fn side(&self) -> f64 {
        (POINTS_PER_CELL * self.area / self.points as f64).sqrt()
    }
}

fn side_for(cloud: &Cloud<'_>) -> f64 {
    let mut keys: Vec<(NodeKey, u64)> = cloud.cells.iter().map(|cell| (cell.key, cell.distinct())).collect();
    let lattice = &cloud.lattice.lattice;
    let side = |level: u8| cloud.frame.cube.side / 2f64.powi(i32::from(level));
    let patch = |cell: &Cell| {
        let area =
            cell.bounds.map_or(f64::INFINITY, |b| area([0, 1, 2].map(|a| b.extent(a)), lattice, cell.distinct()));
        Patch { points: cell.distinct(), area: area.min(side(cell.key.level).powi(2)) }
    };
    let mut patches: Vec<Patch> = cloud.cells.iter().map(patch).collect();
    // Where cells hold too few points to tell how dense these are, wider ones do.
    while let Some((key, _)) = keys.first().filter(|(key, _)| key.level > 0 && is_sparse(&mut patches)) {
        let level = key.level - 1;
        for (key, _) in &mut keys {
            *key = key.ancestor(level).unwrap_or(NodeKey::ROOT);
        }
        // Cells are in Morton order, so that those of a wider one follow each other.
        keys.dedup_by(|next, previous| {
            let is_same = next.0 == previous.0;
            previous.1 += if is_same { next.1 } else { 0 };
            is_same
        });
        patches = keys.iter().map(|(_, points)| Patch { points: *points, area: side(level).powi(2) }).collect();
    }
    median(&mut patches, Patch::side)
}

/// True if half of the points share their cell with fewer than are wanted.
fn is_sparse(patches: &mut [Patch]) -> bool {
    median(patches, |patch| patch.points as f64) < POINTS_PER_CELL
}

/// The value that half of all points are not above.
fn median(patches: &mut [Patch], value: impl Fn(&Patch) -> f64) -> f64 {
    patches.sort_by(|a, b| value(a).total_cmp(&value(b)));
    let half = patches.iter().map(|patch| patch.points).sum::<u64>().div_ceil(2);
    let mut points = 0;
    let middle = patches.iter().find(|patch| {
        points += patch.points;
        points >= half
    });
    middle.map_or(1.0, value)
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

    #[test]
    fn half_of_the_points_decide() {
        let patch = |points, area| Patch { points, area };
        assert_eq!(patch(256, 64.0).side(), 4.0);
        // one point far away has a cell of its own, however wide
        let mut patches = [patch(1, 1e18), patch(4096, 64.0), patch(4000, 64.0)];
        assert_eq!(median(&mut patches, Patch::side), 1.0);
        assert_eq!(median(&mut [], Patch::side), 1.0);
        assert!(is_sparse(&mut [patch(60, 1.0), patch(60, 1.0), patch(64, 1.0)]));
        assert!(!is_sparse(&mut [patch(60, 1.0), patch(64, 1.0)]));
    }

    #[test]
    fn surfaces_and_lines_have_an_area() {
        let lattice = Lattice { scale: [0.5, 1.0, 2.0], offset: [0.0; 3] };
        assert_eq!(area([8, 3, 1], &lattice, 1_000), 12.0);
        assert_eq!(area([0, 0, 320], &lattice, 640), 640.0 * 64.0);
    }
}
