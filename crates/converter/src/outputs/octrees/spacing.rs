//! The distance between points in the root, of which each level has half of the one above.

use pointmill_format::NodeKey;
use serde_json::{Value, json};

use crate::cloud::{CensusCell, Cloud};
use crate::error::ConvertError;
use crate::octree::{Sampling, Spacing};
use crate::plan::{PlanError, PlanFault, Setting};

/// Points in the root that viewers are served best with: a first picture worth looking at, in one request.
const ROOT_POINTS: f64 = 20_000.0;

/// Spacings along the side of the cube, where they are chosen. With the least a root has no fewer points than those of the
/// reference converter (128, which keep less distance); more than the greatest would make nodes of a surface too large.
const USUAL: std::ops::RangeInclusive<f64> = 148.0..=200.0;

/// The same where cells are a power of two.
const USUAL_CELLS: f64 = 128.0;

/// A root of more points than this would keep a viewer waiting, and beyond its budget of points it is not drawn at all: a
/// cloud that fills its cube gets fewer spacings.
const MOST_ROOT_POINTS: f64 = 40_000.0;

/// Points of a Poisson sample with 128 spacings along the side of the cube, for each of 128³ cells that is occupied:
/// 0.41 (a line) to 0.51 (terrain), measured.
const POINTS_PER_CELL: f64 = 0.46;

/// The level of these cells.
const CELL_LEVEL: u8 = 7;

/// The level at which occupied cells are counted: the census has it of every cloud.
const COUNTED_LEVEL: u8 = 6;

/// A spacing, and why it was chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChosenSpacing {
    pub(in crate::outputs) spacing: Spacing,
    /// World units, in the root.
    pub(in crate::outputs) root: f64,
    why: Why,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Why {
    Requested,
    /// Cells of a grid are a power of two.
    Cells,
    /// Points that the root was expected to have.
    Expected(f64),
}

impl ChosenSpacing {
    /// As it is `requested` (world units), or chosen for the root to hold [`ROOT_POINTS`].
    ///
    /// # Errors
    /// A request that the tree cannot keep.
    pub(in crate::outputs) fn of(
        sampling: Sampling,
        requested: Option<f64>,
        cloud: &Cloud<'_>,
    ) -> Result<Self, ConvertError> {
        let side = cloud.frame.cube.side;
        let has_cells = match sampling {
            Sampling::Poisson => false,
            Sampling::Grid | Sampling::Random { .. } => true,
        };
        let Some(requested) = requested else {
            if has_cells {
                return Ok(Self::new(USUAL_CELLS, side, Why::Cells));
            }
            let (divisor, expected) = Surface::of(&cloud.census.cells).divisor();
            return Ok(Self::new(divisor, side, Why::Expected(expected)));
        };
        let (coarsest, finest) = Spacing::DIVISORS.into_inner();
        let (least, most) = (side / finest, side / coarsest);
        if !(least..=most).contains(&requested) {
            return Err(PlanError::new(Setting::Spacing, PlanFault::NotBetween { least, most }).into());
        }
        let divisor = side / requested;
        // no finer than requested
        let divisor = if has_cells { 2f64.powi(divisor.log2().floor() as i32) } else { divisor };
        Ok(Self::new(divisor, side, Why::Requested))
    }

    fn new(divisor: f64, side: f64, why: Why) -> Self {
        let spacing = Spacing::new(divisor);
        Self { spacing, root: side / spacing.divisor(), why }
    }

    /// For the report.
    pub(in crate::outputs) fn describe(&self) -> Value {
        let reason = match self.why {
            Why::Requested => "requested".to_owned(),
            Why::Cells => "usual for cells of a grid".to_owned(),
            Why::Expected(points) => format!("the root was expected to hold about {points:.0} points with it"),
        };
        json!({ "root": self.root, "per_side": self.spacing.divisor(), "reason": reason })
    }
}

/// What of the cube is occupied.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Surface {
    /// Cells of [`CELL_LEVEL`].
    cells: f64,
    /// By what power of the number of cells along an axis their number grows: 1 of a line, 2 of a surface.
    dimension: f64,
}

impl Surface {
    /// From the occupied cells of one level.
    fn of(cells: &[CensusCell]) -> Self {
        let count = |level: u8| {
            let mut last = None;
            let mut is_new = |key: Option<NodeKey>| last.replace(key) != Some(key);
            cells.iter().map(|c| c.key.ancestor(level)).filter(|key| is_new(*key)).count() as f64
        };
        let level = cells.first().map_or(0, |c| c.key.level).min(COUNTED_LEVEL);
        let Some(above) = level.checked_sub(1) else { return Self { cells: 1.0, dimension: 0.0 } };
        let dimension = (count(level) / count(above)).log2().clamp(0.0, 3.0);
        Self { cells: count(level) * (dimension * f64::from(CELL_LEVEL - level)).exp2(), dimension }
    }

    /// Spacings along the side of the cube, and the points that the root then has, about.
    fn divisor(self) -> (f64, f64) {
        let (least, most) = USUAL.into_inner();
        let points = |divisor: f64| POINTS_PER_CELL * self.cells * (divisor / 128.0).powf(self.dimension);
        let with = |wanted: f64| 128.0 * (wanted / points(128.0).max(1.0)).powf(1.0 / self.dimension.max(0.1));
        let divisor = with(ROOT_POINTS).clamp(least, most).min(with(MOST_ROOT_POINTS));
        let divisor = divisor.max(*Spacing::DIVISORS.start()).round();
        (divisor, points(divisor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(level: u8, at: impl Iterator<Item = [u32; 3]>) -> Vec<CensusCell> {
        let mut keys: Vec<[u32; 3]> = at.collect();
        keys.sort_unstable_by(|a, b| crate::cloud::morton::compare(*a, *b));
        let cell = |[x, y, z]: [u32; 3]| CensusCell { key: NodeKey { level, x, y, z }, points: 9, repeats: 0 };
        keys.into_iter().map(cell).collect()
    }

    #[test]
    fn surfaces_and_lines_are_told_apart_and_get_a_spacing() {
        let plane = |n: u32| (0..n * n).map(move |i| [i / n, i % n, 0]);
        for level in [5, 6, 7, 8] {
            let surface = Surface::of(&cells(level, plane(1 << level)));
            assert_eq!(surface, Surface { cells: 16_384.0, dimension: 2.0 });
            let (divisor, expected) = surface.divisor();
            assert!(divisor > 205.0 - 6.0 && (18_000.0..20_500.0).contains(&expected), "{divisor} {expected}");
        }
        let line = Surface::of(&cells(6, (0..64).map(|x| [x, 0, 0])));
        assert_eq!(line, Surface { cells: 128.0, dimension: 1.0 });
        assert_eq!(line.divisor().0, 200.0);
        // two of the six sides of a box, and all
        let sides = |n: usize| {
            let six = |[u, v, _]: [u32; 3]| [[u, v, 0], [u, v, 63], [u, 0, v], [u, 63, v], [0, u, v], [63, u, v]];
            let cells_of: std::collections::HashSet<_> = plane(64).flat_map(|c| six(c).into_iter().take(n)).collect();
            Surface::of(&cells(6, cells_of.into_iter())).divisor().0
        };
        assert_eq!((sides(2), sides(6)), (148.0, 121.0));
        // a full cube
        let full = (0..64 * 64 * 64).map(|i| [i >> 12, i >> 6 & 63, i & 63]);
        let (divisor, expected) = Surface::of(&cells(6, full)).divisor();
        assert!(divisor == 44.0 && (37_000.0..41_000.0).contains(&expected), "{divisor} {expected}");
        assert_eq!(Surface::of(&[]).divisor().0, 200.0);
    }
}
