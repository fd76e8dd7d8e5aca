//! A handful of points far from all others: they decide the extent, and with it the step and the tree of everybody.

use pointmill_format::Aabb;

use crate::cloud::{CensusCell, Gathered};
use crate::warning::Warning;

/// This many points, or one in a million, are a handful.
const HANDFUL: u64 = 16;

/// In a cloud with fewer points per outlier they are no handful any more.
const RARE: u64 = 100;

/// The box without them must be this many times smaller to be worth a warning.
const WORTH: f64 = 10.0;

/// The box that holds all but a handful of points, and how many these are, if it is much smaller than the cloud's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outliers {
    pub(super) points: u64,
    /// World coordinates; whole cells.
    pub(super) others: Aabb,
    /// Longest side of the cloud over that of `others`.
    pub(super) factor: f64,
}

impl Outliers {
    /// The box of all others in whole world units.
    pub(super) fn others(&self) -> Aabb {
        Aabb { min: self.others.min.map(f64::floor), max: self.others.max.map(f64::ceil) }
    }

    /// For the user; the box in whole world units. `holds_back_step`: a smaller extent would allow a finer step.
    pub(super) fn warning(&self, holds_back_step: bool) -> Warning {
        let (points, others, factor) = (self.points, self.others(), self.factor);
        Warning::Outliers { points, others, factor, holds_back_step }
    }
}

/// Looks at the cells of the partition, not at the points. What counts is how many places there are on either side: a
/// hundred thousand points in one place are one, or the advice would leave out all that was measured.
pub(super) fn find(gathered: &Gathered) -> Option<Outliers> {
    let handful = handful(gathered.census.cells.iter().map(CensusCell::distinct).sum());
    let cells: Vec<&CensusCell> = gathered.census.cells.iter().collect();
    let (kept, left_out) = trim(cells, handful);
    let (cube, lattice) = (&gathered.frame.cube, &gathered.lattice.lattice);
    let corner = cube.offset(lattice);
    let mut others = Aabb::EMPTY;
    for cell in &kept {
        let side = cube.side / 2f64.powi(i32::from(cell.key.level));
        let at = [cell.key.x, cell.key.y, cell.key.z].map(f64::from);
        others.grow(std::array::from_fn(|a| corner[a] + at[a] * side));
        others.grow(std::array::from_fn(|a| corner[a] + (at[a] + 1.0) * side));
    }
    let bounds = &gathered.stats.bounds;
    let longest = |extent: [f64; 3]| extent.into_iter().fold(0.0, f64::max);
    let whole = longest([0, 1, 2].map(|a| bounds.extent(a) as f64 * lattice.scale[a]));
    let factor = whole / longest(others.extent());
    (left_out > 0 && factor >= WORTH).then_some(Outliers { points: left_out, others, factor })
}

/// How many of `places` distinct points are too few to matter.
fn handful(places: u64) -> u64 {
    HANDFUL.max(places / 1_000_000).min(places / RARE)
}

/// Leaves out cells from both ends of every axis as long as the distinct points in them are a handful; also returns the
/// number of points left out, distinct or not.
fn trim(mut cells: Vec<&CensusCell>, handful: u64) -> (Vec<&CensusCell>, u64) {
    let (mut left_out, mut points_left_out) = (0, 0);
    let along = |axis: usize, c: &CensusCell| [c.key.x, c.key.y, c.key.z][axis];
    for axis in 0..3 {
        for from_end in [false, true] {
            cells.sort_by_key(|c| if from_end { u32::MAX - along(axis, c) } else { along(axis, c) });
            // Largest gap wins: cells before it go, if they are few enough.
            let mut points = 0;
            let mut cut = (0, 0, 0);
            for (i, pair) in cells.windows(2).enumerate() {
                points += pair[0].distinct();
                if left_out + points > handful {
                    break;
                }
                let gap = along(axis, pair[0]).abs_diff(along(axis, pair[1]));
                if gap > 1 && gap >= cut.0 {
                    cut = (gap, i + 1, points);
                }
            }
            points_left_out += cells.drain(..cut.1).map(|cell| cell.points).sum::<u64>();
            left_out += cut.2;
        }
    }
    (cells, points_left_out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pointmill_format::NodeKey;

    fn cell(x: u32, points: u64) -> CensusCell {
        CensusCell { key: NodeKey { level: 8, x, y: 3, z: 0 }, points, repeats: 0 }
    }

    fn shared(x: u32, points: u64) -> CensusCell {
        CensusCell { repeats: points - 1, ..cell(x, points) }
    }

    #[test]
    fn few_points_beyond_a_gap_are_left_out_and_many_are_not() {
        let cells = [cell(0, 3), cell(100, 50_000), cell(101, 70_000), cell(255, 2)];
        let (kept, left_out) = trim(cells.iter().collect(), 16);
        assert_eq!((kept.len(), left_out), (2, 5));
        let many = [cell(0, 30), cell(100, 50_000)];
        assert_eq!(trim(many.iter().collect(), 16).1, 0);
    }

    #[test]
    fn a_mass_of_points_in_one_place_counts_as_one() {
        let find = |cells: &[CensusCell]| {
            let (kept, left_out) = trim(cells.iter().collect(), handful(cells.iter().map(CensusCell::distinct).sum()));
            (kept.len(), left_out)
        };
        assert_eq!(find(&[shared(0, 99_999), cell(255, 1)]), (2, 0), "the only other point stays");
        assert_eq!(find(&[shared(0, 99_999), cell(255, 90)]), (2, 0));
        assert_eq!(find(&[shared(0, 99_999), cell(255, 5_000)]), (1, 99_999));
    }

    #[test]
    fn most_of_a_small_cloud_are_no_outliers() {
        assert_eq!([10, 99, 100, 2_000, 50_000_000].map(handful), [0, 0, 1, 16, 50]);
    }

    #[test]
    fn thin_edges_without_a_gap_stay() {
        let cells: Vec<CensusCell> = (0..200).map(|x| cell(x, if x < 5 { 1 } else { 9_000 })).collect();
        assert_eq!(trim(cells.iter().collect(), 16).1, 0);
    }
}
