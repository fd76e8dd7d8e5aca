//! From a source's coordinates to the job lattice, one axis at a time.

use pointmill_format::Lattice;

/// How one axis of a source maps to the job lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum AxisMap {
    /// `job = source · mul + add`: every source coordinate is a point of the job lattice.
    Exact {
        mul: i64,
        add: i64,
        /// What is left of the difference of the offsets, world units; below a millionth of a step.
        residue: f64,
    },
    /// `job = round((source · scale + offset − job_offset) / job_scale)`: coordinates may move by half a step.
    Rounded { scale: f64, offset: f64, job_scale: f64, job_offset: f64 },
}

/// The three axes of a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SourceMap {
    pub(super) axes: [AxisMap; 3],
}

impl SourceMap {
    /// The map from `source` (`None`: world coordinates) to `job`.
    pub(super) fn new(source: Option<&Lattice>, job: &Lattice) -> Self {
        let axes = std::array::from_fn(|a| match source {
            Some(s) => AxisMap::new(s.scale[a], s.offset[a], job.scale[a], job.offset[a]),
            None => AxisMap::Rounded { scale: 1.0, offset: 0.0, job_scale: job.scale[a], job_offset: job.offset[a] },
        });
        Self { axes }
    }

    /// True if no position moves.
    pub(super) fn is_exact(&self) -> bool {
        self.axes.iter().all(|axis| matches!(axis, AxisMap::Exact { .. }))
    }
}

impl AxisMap {
    fn new(scale: f64, offset: f64, job_scale: f64, job_offset: f64) -> Self {
        let ratio = scale / job_scale;
        let shift = (offset - job_offset) / job_scale;
        let (mul, add) = (ratio.round(), shift.round());
        let near = (ratio - mul).abs() <= mul.abs() * 1e-15 && (shift - add).abs() <= 1e-6;
        if near && mul >= 1.0 && mul < 2f64.powi(31) && add.abs() < 2f64.powi(52) {
            let residue = ((shift - add) * job_scale).abs();
            return Self::Exact { mul: mul as i64, add: add as i64, residue };
        }
        Self::Rounded { scale, offset, job_scale, job_offset }
    }

    /// Maps lattice integers; appends to `out` and returns the largest change and the sum of squared changes.
    pub(super) fn map_integers(&self, source: &[i32], out: &mut Vec<i64>) -> (f64, f64) {
        match *self {
            Self::Exact { mul: 1, add, residue } => {
                out.extend(source.iter().map(|q| i64::from(*q) + add));
                (residue, residue * residue * source.len() as f64)
            }
            Self::Exact { mul, add, residue } => {
                out.extend(source.iter().map(|q| i64::from(*q) * mul + add));
                (residue, residue * residue * source.len() as f64)
            }
            Self::Rounded { scale, offset, .. } => {
                self.round_all(source.iter().map(|q| f64::from(*q) * scale + offset), out)
            }
        }
    }

    /// Maps world coordinates; appends to `out`; see [`Self::map_integers`].
    pub(super) fn map_world(&self, source: &[f64], out: &mut Vec<i64>) -> (f64, f64) {
        self.round_all(source.iter().copied(), out)
    }

    fn round_all(&self, world: impl Iterator<Item = f64>, out: &mut Vec<i64>) -> (f64, f64) {
        let Self::Rounded { job_scale, job_offset, .. } = *self else { return (0.0, 0.0) };
        let (mut max, mut squares) = (0.0f64, 0.0);
        out.extend(world.map(|w| {
            let q = ((w - job_offset) / job_scale).round();
            let change = (q * job_scale + job_offset - w).abs();
            max = max.max(change);
            squares += change * change;
            q as i64
        }));
        (max, squares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattices_that_share_points_map_exactly() {
        let job = Lattice { scale: [0.001; 3], offset: [476_000.0, 0.0, 0.0] };
        let same = SourceMap::new(Some(&job), &job);
        assert!(same.axes.iter().all(|m| matches!(m, AxisMap::Exact { mul: 1, add: 0, .. })));
        let coarse = Lattice { scale: [0.01; 3], offset: [477_000.0, 0.0, 0.0] };
        let map = SourceMap::new(Some(&coarse), &job);
        assert!(matches!(map.axes[0], AxisMap::Exact { mul: 10, add: 1_000_000, .. }), "{map:?}");
        let mut out = Vec::new();
        map.axes[0].map_integers(&[-3, 5], &mut out);
        assert_eq!(out, [999_970, 1_000_050]);
    }

    #[test]
    fn other_lattices_round_to_the_nearest_and_measure_the_change() {
        let job = Lattice { scale: [0.01; 3], offset: [0.0; 3] };
        let odd = Lattice { scale: [0.003; 3], offset: [0.0; 3] };
        let mut out = Vec::new();
        let (max, squares) = SourceMap::new(Some(&odd), &job).axes[0].map_integers(&[0, 1, 2, 5], &mut out);
        assert_eq!(out, [0, 0, 1, 2]);
        assert!((max - 0.005).abs() < 1e-12);
        assert!((squares - (0.003f64.powi(2) + 0.004f64.powi(2) + 0.005f64.powi(2))).abs() < 1e-12);
    }
}
