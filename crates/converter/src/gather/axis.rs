//! From a source's coordinates to the job lattice, one axis at a time, and how far each coordinate moves by that.

use pointmill_format::{AxisGrid, Lattice};

/// How one axis of a source maps to the job lattice. Ties are rounded to even everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum AxisMap {
    /// `job = source · mul + add`: every source coordinate is a point of the job lattice.
    Exact {
        mul: i64,
        add: i64,
        /// What the job lattice adds to every coordinate, world units; below a millionth of a step.
        residue: f64,
    },
    /// `job = round((source · mul + add) / div)`, in integers: the job lattice is coarser, or lies between.
    Ratio {
        mul: i64,
        add: i64,
        div: i64,
        /// World units of one.
        unit: f64,
    },
    /// `job = round((source · scale + offset − job_offset) / job_scale)`, in doubles.
    Rounded { scale: f64, offset: f64, job_scale: f64, job_offset: f64 },
}

/// The three axes of a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SourceMap {
    pub(super) axes: [AxisMap; 3],
}

/// By how much coordinates move on an axis: job minus source, world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Moved {
    /// All by this.
    By(f64),
    /// Each by the value in the column.
    Each,
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
}

impl AxisMap {
    fn new(scale: f64, offset: f64, job_scale: f64, job_offset: f64) -> Self {
        let ratio = scale / job_scale;
        let shift = (offset - job_offset) / job_scale;
        let (mul, add) = (ratio.round(), shift.round());
        let near = (ratio - mul).abs() <= mul.abs() * 1e-15 && (shift - add).abs() <= 1e-6;
        if near && mul >= 1.0 && mul < 2f64.powi(31) && add.abs() < 2f64.powi(52) {
            let residue = (add - shift) * job_scale;
            return Self::Exact { mul: mul as i64, add: add as i64, residue };
        }
        let plain = Self::Rounded { scale, offset, job_scale, job_offset };
        Self::ratio(AxisGrid { step: scale, offset }, AxisGrid { step: job_scale, offset: job_offset }).unwrap_or(plain)
    }

    /// The map in integers, if both grids lie on one that is fine enough for both.
    fn ratio(source: AxisGrid, job: AxisGrid) -> Option<Self> {
        let unit = AxisGrid::common(&[source, job])?.step;
        let [mul, div, add] = [source.step, job.step, source.offset - job.offset].map(|length| (length / unit).round());
        let fits = mul < 2f64.powi(30) && div < 2f64.powi(30) && add.abs() < 2f64.powi(60);
        fits.then_some(Self::Ratio { mul: mul as i64, add: add as i64, div: div as i64, unit })
    }

    /// Maps lattice integers; appends to `out`, and to `change` if coordinates move by different amounts.
    pub(super) fn map_integers(&self, source: &[i32], out: &mut Vec<i64>, change: &mut Vec<f64>) -> Moved {
        match *self {
            Self::Exact { mul: 1, add, residue } => {
                out.extend(source.iter().map(|q| i64::from(*q) + add));
                Moved::By(residue)
            }
            Self::Exact { mul, add, residue } => {
                out.extend(source.iter().map(|q| i64::from(*q) * mul + add));
                Moved::By(residue)
            }
            Self::Ratio { mul, add, div, unit } => {
                change.reserve(source.len());
                out.extend(source.iter().map(|q| {
                    let units = i64::from(*q) * mul + add;
                    let job = divided(units, div);
                    change.push((job * div - units) as f64 * unit);
                    job
                }));
                Moved::Each
            }
            Self::Rounded { scale, offset, .. } => {
                self.round_all(source.iter().map(|q| f64::from(*q) * scale + offset), out, change)
            }
        }
    }

    /// Maps world coordinates; see [`Self::map_integers`].
    pub(super) fn map_world(&self, source: &[f64], out: &mut Vec<i64>, change: &mut Vec<f64>) -> Moved {
        self.round_all(source.iter().copied(), out, change)
    }

    fn round_all(&self, world: impl Iterator<Item = f64>, out: &mut Vec<i64>, change: &mut Vec<f64>) -> Moved {
        let Self::Rounded { job_scale, job_offset, .. } = *self else { return Moved::By(0.0) };
        change.reserve(world.size_hint().0);
        out.extend(world.map(|w| {
            let q = ((w - job_offset) / job_scale).round_ties_even();
            change.push(q * job_scale + job_offset - w);
            q as i64
        }));
        Moved::Each
    }
}

/// `units / div` to the nearest whole number, ties to even; `div` > 0.
fn divided(units: i64, div: i64) -> i64 {
    let (floor, rest) = (units.div_euclid(div), units.rem_euclid(div));
    let up = match (2 * rest).cmp(&div) {
        std::cmp::Ordering::Less => 0,
        std::cmp::Ordering::Equal => floor & 1,
        std::cmp::Ordering::Greater => 1,
    };
    floor + up
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapped(map: &AxisMap, source: &[i32]) -> (Vec<i64>, Vec<f64>) {
        let (mut out, mut change) = (Vec::new(), Vec::new());
        map.map_integers(source, &mut out, &mut change);
        (out, change)
    }

    #[test]
    fn lattices_that_share_points_map_exactly() {
        let job = Lattice { scale: [0.001; 3], offset: [476_000.0, 0.0, 0.0] };
        let same = SourceMap::new(Some(&job), &job);
        assert!(same.axes.iter().all(|m| matches!(m, AxisMap::Exact { mul: 1, add: 0, .. })));
        let coarse = Lattice { scale: [0.01; 3], offset: [477_000.0, 0.0, 0.0] };
        let map = SourceMap::new(Some(&coarse), &job);
        assert!(matches!(map.axes[0], AxisMap::Exact { mul: 10, add: 1_000_000, .. }), "{map:?}");
        assert_eq!(mapped(&map.axes[0], &[-3, 5]), (vec![999_970, 1_000_050], vec![]));
    }

    #[test]
    fn other_lattices_round_to_the_nearest_in_integers_and_measure_the_change() {
        let job = Lattice { scale: [0.01; 3], offset: [0.0; 3] };
        let odd = Lattice { scale: [0.003; 3], offset: [0.0; 3] };
        let (out, change) = mapped(&SourceMap::new(Some(&odd), &job).axes[0], &[0, 1, 2, 5]);
        assert_eq!(out, [0, 0, 1, 2], "0.015 is a tie");
        assert_eq!(change.map_in_steps(0.001), [0, -3, 4, 5]);
    }

    #[test]
    fn ties_go_to_even_so_that_a_doubled_step_has_no_bias() {
        let job = Lattice { scale: [0.002; 3], offset: [0.0; 3] };
        let source = Lattice { scale: [0.001; 3], offset: [0.0; 3] };
        let all: Vec<i32> = (-1000..1000).collect();
        let (out, change) = mapped(&SourceMap::new(Some(&source), &job).axes[0], &all);
        assert_eq!(out[..5], [-500, -500, -499, -498, -498]);
        assert_eq!(change.map_in_steps(0.001).iter().sum::<i64>(), 0);
        let worlds: Vec<f64> = all.iter().map(|q| f64::from(*q) * 0.5).collect();
        let (mut q, mut change) = (Vec::new(), Vec::new());
        let halves = SourceMap::new(None, &Lattice { scale: [1.0; 3], offset: [0.0; 3] });
        halves.axes[0].map_world(&worlds, &mut q, &mut change);
        assert_eq!(change.iter().sum::<f64>(), 0.0);
    }

    #[test]
    fn offsets_count_in_every_way_to_map() {
        let exact = AxisMap::new(0.5, 10.0, 0.5, 2.0);
        assert!(matches!(exact, AxisMap::Exact { mul: 1, add: 16, .. }), "{exact:?}");
        assert_eq!(mapped(&exact, &[-3, 5]).0, [13, 21]);
        let ratio = AxisMap::new(0.3, 1.2, 0.5, 0.2);
        assert!(matches!(ratio, AxisMap::Ratio { mul: 3, add: 10, div: 5, .. }), "{ratio:?}");
        assert_eq!(mapped(&ratio, &[0, 1, 5, -4]).0, [2, 3, 5, 0], "2, 2.6, 5 and -0.4");
        let rounded = AxisMap::new(1.0 / 3.0, 10.0, 1.0, 0.0);
        assert!(matches!(rounded, AxisMap::Rounded { .. }), "{rounded:?}");
        assert_eq!(mapped(&rounded, &[0, 2, -4]).0, [10, 11, 9], "10, 10.67 and 8.67");
    }

    #[test]
    fn ratios_are_of_integers_below_2_to_the_30() {
        let grid = |step: f64| AxisGrid { step, offset: 0.0 };
        let most = 2f64.powi(30);
        assert!(
            AxisMap::ratio(grid(most - 1.0), grid(2.0)).is_some() && AxisMap::ratio(grid(most), grid(3.0)).is_none()
        );
        assert!(
            AxisMap::ratio(grid(2.0), grid(most - 1.0)).is_some() && AxisMap::ratio(grid(3.0), grid(most)).is_none()
        );
    }

    trait InSteps {
        fn map_in_steps(&self, step: f64) -> Vec<i64>;
    }
    impl InSteps for Vec<f64> {
        fn map_in_steps(&self, step: f64) -> Vec<i64> {
            self.iter().map(|v| (v / step).round() as i64).collect()
        }
    }

    #[test]
    fn doubles_round_to_the_nearest_with_ties_to_even_far_from_0() {
        let map = SourceMap::new(None, &Lattice { scale: [0.5, 2f64.powi(-10), 1.0], offset: [4e6, 4e6, -4e6] });
        let mapped = |axis: usize, from: f64, plus: &[f64]| {
            let (mut q, mut change) = (Vec::new(), Vec::new());
            let worlds: Vec<f64> = plus.iter().map(|v| from + v).collect();
            assert_eq!(map.axes[axis].map_world(&worlds, &mut q, &mut change), Moved::Each);
            (q, change)
        };
        let (q, change) = mapped(0, 4e6, &[0.25, 0.75, -0.25, 0.375, 1e6 + 0.375, -0.125]);
        assert_eq!(q, [0, 2, 0, 1, 2_000_001, 0]);
        assert_eq!(change, [-0.25, 0.25, 0.25, 0.125, 0.125, 0.125]);
        // finer than what single precision has at the coordinate, and at the integer
        assert_eq!(mapped(1, 4e6, &[5.0 / 1024.0, 2e6 + 3.0 / 1024.0]).0, [5, 2_048_000_003]);
        assert_eq!(mapped(2, -4e6, &[-0.5, -0.75, 1.5]).0, [0, -1, 2]);
    }

    #[test]
    fn integers_that_share_no_grid_round_as_doubles_do() {
        let third = AxisMap::new(1.0 / 3.0, 0.0, 1.0, 0.0);
        assert!(matches!(third, AxisMap::Rounded { .. }), "{third:?}");
        assert_eq!(mapped(&third, &[-5, -1, 0, 1, 2, 3, 2_000_000_000]).0, [-2, 0, 0, 0, 1, 1, 666_666_667]);
    }
}
