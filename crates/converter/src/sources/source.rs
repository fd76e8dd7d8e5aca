//! One scan, as far as it is kept while its file is closed: there may be very many.

use std::path::Path;
use std::sync::Arc;

use pointmill_format::{Aabb, Crs, Lattice, Resolution};

use super::survey::{Extent, Fineness, single_step};

/// Pieces of a scan that a thread takes together.
pub(super) const PIECES_TOGETHER: u64 = 2;

/// A scan: what of its header is needed while its file is closed. What scans have in common is kept once.
#[derive(Debug, Clone)]
pub(crate) struct Source {
    pub(crate) path: Arc<Path>,
    /// Its kind, for people.
    pub(crate) format: Arc<str>,
    /// As the file declares it.
    pub(crate) crs: Arc<Crs>,
    pub(crate) stored: Arc<Stored>,
    /// Index in [`super::Sources::layouts`].
    pub(crate) layout: u32,
    /// Claimed by the header.
    pub(crate) points_declared: u64,
    /// Claimed by the header.
    pub(crate) bounds_declared: Option<Aabb>,
    /// Where its points are, as far as is known before they are read; `None` if there is none.
    pub(crate) extent: Option<Extent>,
    /// Where its scanners stood; empty: the file does not say.
    pub(crate) origins: Box<[[f64; 3]]>,
    /// Colours have 16 bits because the file says so.
    pub(crate) rgb_is_16_bit: bool,
    pub(crate) file_bytes: u64,
    /// The most that decoding a piece takes, all columns.
    pub(super) decode_bytes: u64,
    /// Parts that decode alone.
    pub(crate) pieces: u32,
    /// Number of its first pair of pieces among those of all scans.
    pub(super) first_pair: u64,
    /// Tells whether the file is still the one that was opened first ([`super::same::mark`]).
    pub(super) mark: u64,
}

/// How a scan stores coordinates, as far as is known before they are read.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stored {
    /// Of integers; `None`: world coordinates.
    pub(crate) lattice: Option<Lattice>,
    /// What the file says of world coordinates.
    pub(crate) resolution: [Resolution; 3],
    pub(crate) fineness: [Fineness; 3],
}

/// Single precision that divides the longest side of a scan into fewer steps than this is worth a warning.
const FEW_STEPS: f64 = 16_384.0;

impl Stored {
    /// How finely the file stores the coordinates of points within `bounds`, by axis; `None`: as doubles.
    pub(crate) fn steps(&self, bounds: &Aabb) -> [Option<f64>; 3] {
        std::array::from_fn(|a| match self.fineness[a] {
            Fineness::Grid { grid, .. } => Some(grid.step),
            Fineness::Step(step) => Some(step),
            Fineness::Single => single_step(bounds.min[a].abs().max(bounds.max[a].abs())),
            Fineness::Double => None,
        })
    }

    /// The steps, where single precision makes them so coarse that the user should know.
    pub(crate) fn coarse_single(&self, bounds: &Aabb) -> Option<[f64; 3]> {
        if bounds.is_empty() || !self.fineness.contains(&Fineness::Single) {
            return None;
        }
        let longest = bounds.extent().into_iter().fold(0.0, f64::max);
        let steps = self.steps(bounds).map(Option::unwrap_or_default);
        let is_coarse =
            |(step, fineness): (&f64, &Fineness)| *fineness == Fineness::Single && longest < step * FEW_STEPS;
        (longest > 0.0 && steps.iter().zip(&self.fineness).any(is_coarse)).then_some(steps)
    }
}

impl Source {
    /// Differs where anything differs that a run relies on.
    pub(crate) fn mark(&self) -> u64 {
        self.mark
    }

    /// Number of the pair of pieces that follows its last.
    pub(super) fn end_of_pairs(&self) -> u64 {
        self.first_pair + u64::from(self.pieces).div_ceil(PIECES_TOGETHER)
    }
}

#[cfg(test)]
impl Source {
    /// A source of which pieces and points alone matter.
    pub(crate) fn of_pieces(points_declared: u64, pieces: u32) -> Self {
        let stored = Stored { lattice: None, resolution: Default::default(), fineness: [Fineness::Double; 3] };
        Self { points_declared, pieces, ..Self::of_header(stored, None, None) }
    }

    /// A source of which the header alone matters. `seen`: where its points are.
    pub(crate) fn of_header(stored: Stored, bounds_declared: Option<Aabb>, seen: Option<Aabb>) -> Self {
        Self {
            path: Path::new("x").into(),
            format: "".into(),
            crs: Arc::default(),
            stored: Arc::new(stored),
            layout: 0,
            points_declared: 0,
            bounds_declared,
            extent: seen.map(|bounds| Extent { bounds, is_sampled: false }),
            origins: Box::default(),
            rgb_is_16_bit: false,
            file_bytes: 0,
            decode_bytes: 0,
            pieces: 0,
            first_pair: 0,
            mark: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_single_precision_is_worth_a_warning_and_a_fine_one_is_not() {
        let stored = |fineness| Stored { lattice: None, resolution: Default::default(), fineness: [fineness; 3] };
        let single = stored(Fineness::Single);
        let far = Aabb { min: [500_000.0, 5_400_000.0, 100.0], max: [500_100.0, 5_400_100.0, 110.0] };
        assert_eq!(single.coarse_single(&far), Some([0.031_25, 0.5, 2f64.powi(-17)]));
        let near = Aabb { min: [-50.0; 3], max: [50.0; 3] };
        assert_eq!(single.coarse_single(&near), None);
        let doubles = stored(Fineness::Double);
        assert_eq!((doubles.coarse_single(&far), doubles.steps(&far)), (None, [None; 3]));
    }
}
