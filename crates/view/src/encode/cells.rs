//! Positions as small integers within a unit.

use pointmill_format::{Lattice, NodePoints, Positions};

/// The largest integer of 16 bits, and of the 31 that differences of signed integers in a shader leave.
const NARROW: u32 = u16::MAX as u32;
const WIDE: u32 = i32::MAX as u32;

/// How positions of a unit become integers: `world = origin + integer · step`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cells {
    pub(super) is_wide: bool,
    pub(super) origin: [f64; 3],
    pub(super) step: [f64; 3],
    rule: Rule,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Rule {
    /// Lattice integers, less the least.
    Exact { least: [i32; 3] },
    /// Lattice integers over the box, rounded: `(q − least) · factor`.
    Lattice { least: [i32; 3], factor: [f64; 3], most: u32 },
    /// World coordinates over the box, rounded: `(p − origin) · factor`.
    World { factor: [f64; 3], most: u32 },
}

impl Cells {
    /// Integers for every `every`th point. `may_round`: an inner node of an octree, of whose points a picture needs no more
    /// than 16 bits.
    pub(super) fn new(points: &NodePoints, every: usize, may_round: bool) -> Self {
        match points.positions() {
            Positions::Quantized(axes) => Self::of_lattice(axes, points.lattice(), every, may_round),
            Positions::World(axes) => Self::of_world(axes, every, if may_round { NARROW } else { WIDE }),
        }
    }

    fn of_lattice(axes: &[Vec<i32>; 3], lattice: &Lattice, every: usize, may_round: bool) -> Self {
        let least = axes.each_ref().map(|axis| axis.iter().step_by(every).copied().min().unwrap_or(0));
        let greatest = axes.each_ref().map(|axis| axis.iter().step_by(every).copied().max().unwrap_or(0));
        let extent: [u32; 3] = std::array::from_fn(|a| greatest[a].abs_diff(least[a]));
        let origin = lattice.world(least.map(i64::from));
        let fits = |most: u32| extent.iter().all(|e| *e <= most);
        if fits(NARROW) || (!may_round && fits(WIDE)) {
            return Self { is_wide: !fits(NARROW), origin, step: lattice.scale, rule: Rule::Exact { least } };
        }
        let most = if may_round { NARROW } else { WIDE };
        let cells = f64::from(most);
        let step = std::array::from_fn(|a| f64::from(extent[a]) * lattice.scale[a] / cells);
        let factor = extent.map(|e| if e == 0 { 0.0 } else { cells / f64::from(e) });
        Self { is_wide: most == WIDE, origin, step, rule: Rule::Lattice { least, factor, most } }
    }

    fn of_world(axes: &[Vec<f64>; 3], every: usize, most: u32) -> Self {
        let finite = |axis: &Vec<f64>| -> (f64, f64) {
            let values = axis.iter().step_by(every).filter(|v| v.is_finite());
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), v| (least.min(*v), greatest.max(*v)))
        };
        let ranges = axes.each_ref().map(finite);
        let origin = ranges.map(|(least, _)| if least.is_finite() { least } else { 0.0 });
        let extent =
            ranges.map(|(least, greatest)| if least < greatest { (greatest - least).min(f64::MAX) } else { 0.0 });
        let cells = f64::from(most);
        let factor = extent.map(|e| if e > 0.0 { cells / e } else { 0.0 });
        let step = extent.map(|e| e / cells);
        Self { is_wide: most == WIDE, origin, step, rule: Rule::World { factor, most } }
    }

    /// The integers of point `index`, which exists.
    #[inline]
    pub(super) fn of(&self, positions: &Positions, index: usize) -> [u32; 3] {
        match (positions, self.rule) {
            (Positions::Quantized(axes), Rule::Exact { least }) => {
                std::array::from_fn(|a| axes[a].get(index).map_or(0, |q| q.abs_diff(least[a])))
            }
            (Positions::Quantized(axes), Rule::Lattice { least, factor, most }) => std::array::from_fn(|a| {
                let above = axes[a].get(index).map_or(0, |q| q.abs_diff(least[a]));
                ((f64::from(above) * factor[a]).round() as u32).min(most)
            }),
            // `as` makes 0 of what is no number
            (Positions::World(axes), Rule::World { factor, most }) => std::array::from_fn(|a| {
                let above = axes[a].get(index).map_or(0.0, |p| p - self.origin[a]);
                ((above * factor[a]).round() as u32).min(most)
            }),
            _ => [0; 3],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: Lattice = Lattice { scale: [0.01; 3], offset: [500_000.0, 0.0, 0.0] };

    fn of(extent: i32, may_round: bool) -> Cells {
        let axis = vec![i32::MIN, i32::MIN + extent];
        Cells::of_lattice(&[axis.clone(), axis.clone(), axis], &LATTICE, 1, may_round)
    }

    #[test]
    fn what_fits_16_bits_is_exact_and_what_does_not_is_wide_or_rounded() {
        for may_round in [false, true] {
            let exact = of(65_535, may_round);
            assert_eq!((exact.is_wide, exact.step), (false, LATTICE.scale));
        }
        let wide = of(65_536, false);
        assert_eq!((wide.is_wide, wide.step, wide.origin), (true, LATTICE.scale, LATTICE.world([i32::MIN.into(); 3])));
        let rounded = of(131_070, true);
        assert_eq!((rounded.is_wide, rounded.step), (false, [0.02; 3]));
        let all = Cells::of_lattice(&[vec![i32::MIN, i32::MAX], vec![0, 0], vec![0, 0]], &LATTICE, 1, false);
        assert!(all.is_wide);
        let ends = Positions::Quantized([vec![i32::MIN, i32::MAX], vec![0, 0], vec![0, 0]]);
        assert_eq!([all.of(&ends, 0), all.of(&ends, 1)], [[0; 3], [WIDE, 0, 0]], "no integer has 32 bits");
    }

    /// Half a step of the box, which is more than one of the lattice.
    #[test]
    fn integers_are_below_2_to_the_31() {
        let axes = [vec![i32::MIN, i32::MAX, 1], vec![i32::MIN + 1, 0, -7], vec![0, 0, 9]];
        let lattice = Cells::of_lattice(&axes, &LATTICE, 1, false);
        assert_eq!(
            (lattice.is_wide, lattice.rule == Rule::Exact { least: [i32::MIN, i32::MIN + 1, 0] }),
            (true, false)
        );
        let world: [Vec<f64>; 3] = axes.each_ref().map(|axis| axis.iter().map(|q| f64::from(*q)).collect());
        let cells = Cells::of_world(&world, 1, WIDE);
        for (cells, positions, scale) in
            [(lattice, Positions::Quantized(axes), LATTICE.scale[0]), (cells, Positions::World(world.clone()), 1.0)]
        {
            for (i, a) in (0..3).flat_map(|i| (0..3).map(move |a| (i, a))) {
                let integer = cells.of(&positions, i)[a];
                assert!(integer <= i32::MAX as u32, "{integer}");
                let found = f64::from(integer) * cells.step[a];
                let meant = (world[a][i] - world[a].iter().copied().fold(f64::INFINITY, f64::min)) * scale;
                assert!((found - meant).abs() <= 0.5 * cells.step[a] * (1.0 + 1e-6), "{found}, not {meant}");
            }
        }
    }

    /// Half a step, and the rounding of sums and products in double precision.
    #[test]
    fn rounded_integers_are_the_nearest() {
        let spread = |factor: i64| (0..500i64).map(|i| (i * i * factor % 3_000_001 - 1_000_000) as i32).collect();
        let axes: [Vec<i32>; 3] = [spread(7919), spread(104_729), vec![5; 500]];
        let world: [Vec<f64>; 3] =
            std::array::from_fn(|a| axes[a].iter().map(|q| LATTICE.world([i64::from(*q); 3])[a]).collect());
        let cases = [
            (Cells::of_lattice(&axes, &LATTICE, 1, true), Positions::Quantized(axes.clone())),
            (Cells::of_lattice(&axes, &LATTICE, 1, false), Positions::Quantized(axes)),
            (Cells::of_world(&world, 1, NARROW), Positions::World(world.clone())),
            (Cells::of_world(&world, 1, WIDE), Positions::World(world.clone())),
        ];
        for (cells, positions) in cases {
            for (i, a) in (0..500).flat_map(|i| (0..3).map(move |a| (i, a))) {
                let found = cells.origin[a] + f64::from(cells.of(&positions, i)[a]) * cells.step[a];
                let bound = 0.5 * cells.step[a] * (1.0 + 1e-9) + 4.0 * f64::EPSILON * 600_000.0;
                assert!((found - world[a][i]).abs() <= bound, "{cells:?}: {found}, not {}", world[a][i]);
            }
        }
    }

    #[test]
    fn points_that_are_not_taken_do_not_count() {
        let axis = vec![0, 1_000_000, 10];
        let cells = Cells::of_lattice(&[axis.clone(), axis.clone(), axis], &LATTICE, 2, false);
        assert!(!cells.is_wide);
    }

    #[test]
    fn world_coordinates_without_extent_or_number_do_no_harm() {
        let axes = [vec![f64::NAN, f64::INFINITY], vec![7.0, 7.0], vec![-1e308, 1e308]];
        let cells = Cells::of_world(&axes, 1, WIDE);
        assert_eq!(cells.origin, [0.0, 7.0, -1e308]);
        assert_eq!((cells.step[0], cells.step[1]), (0.0, 0.0));
        assert!(cells.step.iter().all(|s| s.is_finite()));
        assert_eq!(cells.of(&Positions::World(axes), 1)[2], i32::MAX as u32, "what a shader takes for positive");
    }
}
