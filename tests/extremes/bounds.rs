//! The bounds of `docs/design/numerics.md`, written down a second time: by the input, the step that the case expects, and the
//! extent of its points, never by what the dataset says of itself.

use crate::case::{Case, Kept};
use crate::input::{Input, rotation};
use crate::output::Rule;

/// Half of the distance between 1 and the next double: what one operation rounds by, relative to its result.
const U: f64 = f64::EPSILON / 2.0;

/// One axis of a case.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis {
    /// Least and greatest coordinate.
    pub(crate) min: f64,
    pub(crate) max: f64,
    /// Step and offset of the lattice of the run.
    pub(crate) step: f64,
    pub(crate) offset: f64,
    /// The finest step of all axes.
    pub(crate) finest: f64,
    /// Side of the root's cube.
    pub(crate) side: f64,
    /// Steps of the axes are equal, or powers of two apart.
    pub(crate) are_equal: bool,
}

impl Axis {
    /// F: no number that a reader or a writer meets is larger: a coordinate, a corner of the cube, the offset of the lattice.
    fn farthest(&self) -> f64 {
        self.min.abs().max(self.max.abs()) + self.side + self.offset.abs()
    }

    /// §2: what reading and the lattice do to point `i`.
    pub(crate) fn of_lattice(&self, case: &Case, i: usize, axis: usize) -> f64 {
        let far = self.farthest();
        let read = match &case.input {
            Input::Las { .. } | Input::Single(_) | Input::Double(_) => 0.0,
            Input::Text { .. } => U * far,
            Input::Posed { quaternion, step, points, .. } => {
                let (matrix, denominator) = rotation(*quaternion);
                let is_turned = matrix != [[denominator, 0.0, 0.0], [0.0, denominator, 0.0], [0.0, 0.0, denominator]];
                let sizes = points[i].map(|q| f64::from(q).abs() * step);
                let turned = if is_turned { 24.0 * U * sizes.iter().sum::<f64>() } else { U * sizes[axis] };
                turned + U * far
            }
        };
        match (case.kept[axis], &case.input) {
            (Kept::Same, _) => read,
            (Kept::Decimals, _) => read + U * far,
            (Kept::Rounded, Input::Las { .. }) => read + self.step / 2.0 + 32.0 * U * far,
            (Kept::Rounded, _) => read + self.step / 2.0 + 2.0 * U * far,
        }
    }

    /// §3: what the format does to a point in a node of that level.
    pub(crate) fn of_format(&self, rule: Rule, level: u8) -> f64 {
        let far = self.farthest();
        match rule {
            Rule::Integers => 3.0 * U * far,
            Rule::FromCorners => self.of_corners(level) + (f64::from(level) + 7.0) * U * far,
            Rule::Singles => self.of_singles() + 3.0 * U * far,
            Rule::Cells(bits) => self.of_cells(bits) + 5.0 * U * (far + 1.0), // counted from a whole number
        }
    }

    /// §3.2: whole steps down to a level, below it half of a part of a step; in other cubes half of a part of the side.
    fn of_corners(&self, level: u8) -> f64 {
        let steps = (self.side / self.finest).round();
        let bits = steps.log2().floor() as i32 + 1;
        match (31 - bits).min(bits) {
            halvings if !self.are_equal || halvings <= 0 => self.side / 2f64.powi(32) * (1.0 + 4.0 * U),
            halvings if i32::from(level) <= halvings => 0.0,
            halvings => self.finest / 2f64.powi(halvings + 1),
        }
    }

    /// §3.3: half the distance of singles at the offset from the center; a leaf is no longer than the cloud.
    fn of_singles(&self) -> f64 {
        // the ends are rounded to the lattice, and the center to doubles
        let half = (self.max - self.min) / 2.0 + self.step / 2.0 + 2.0 * U * self.farthest();
        if self.max == self.min { 0.0 } else { 2f64.powi(half.log2().floor() as i32 - 24) }
    }

    /// §3.4: half a cell. The ends of the box are singles, on or outside of the ends of the batch, counted from a whole number.
    fn of_cells(&self, bits: u32) -> f64 {
        let reach = self.max - self.min + 1.0 + self.step;
        let ends = 2.0 * f64::from(f32::EPSILON) * reach;
        let side = if self.max == self.min { ends } else { self.max - self.min + self.step + ends };
        side / 2f64.powi(bits as i32 + 1)
    }
}
