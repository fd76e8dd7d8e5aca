//! Which points of the scans are the same point: "Duplicates" of docs/inputs.md, in code of our own.

use pointmill_format::Lattice;

use super::block::mix;
use super::rules::Rules;

/// What the dataset's lattice takes away of a point's position, added axis by axis; 0: nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Residue([u64; 2]);

impl Residue {
    /// Takes in a coordinate and what became of it on the dataset's lattice. `own`: the lattice of the scan.
    pub(super) fn add(&mut self, rules: &Rules, own: Option<&Lattice>, axis: usize, world: f64, stored: i64) {
        let (found, offset) = rules.job_point(axis, stored);
        // sums and products of doubles are off by that much; integers of a lattice are a millionth of a step apart at least
        let rounding = 4.0 * f64::EPSILON * (world.abs() + offset.abs());
        let step = own.map_or(0.0, |lattice| lattice.scale[axis].min(rules.lattice.scale[axis]));
        if (found - world).abs() > rounding.max(1e-6 * step) {
            // adding 0 makes −0 the 0 that it means
            self.0 = mix(self.0, (world + 0.0).to_bits() ^ axis as u64);
        }
    }

    /// Equal exactly if positions are, of points with the same integers.
    pub(super) fn word(self) -> u64 {
        self.0[0]
    }
}
