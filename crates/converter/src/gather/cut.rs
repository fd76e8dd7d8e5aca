//! The filter's box in the coordinates of a source, so that its borders are where the user wrote them: 3 steps of 0.1 are
//! 0.30000000000000004 in doubles, and not outside of a box that ends at 0.3.

use pointmill_format::{Aabb, Lattice, Positions, Resolution, ScanInfo};

/// A border that is this part of a step away from a coordinate of the source is meant to be on it.
const SAME_PLACE: f64 = 1e-6;

/// The box, closed.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cut {
    /// First and last integer on the source's lattice; first > last if no coordinate is inside.
    Lattice { first: [i64; 3], last: [i64; 3] },
    /// World coordinates.
    World { min: [f64; 3], max: [f64; 3] },
}

impl Cut {
    pub(super) fn new(bounds: &Aabb, info: &ScanInfo) -> Self {
        if let Some(lattice) = &info.lattice {
            let first = std::array::from_fn(|a| border(lattice, a, bounds.min[a], f64::ceil));
            let last = std::array::from_fn(|a| border(lattice, a, bounds.max[a], f64::floor));
            return Self::Lattice { first, last };
        }
        // Coordinates that were rounded to single precision are compared with borders that are.
        let moved = |axis: usize, border: f64, outwards: f64| match info.resolution[axis] {
            Resolution::Single => f64::from(border as f32),
            resolution => border + outwards * slack(border, resolution),
        };
        let min = std::array::from_fn(|a| moved(a, bounds.min[a], -1.0));
        let max = std::array::from_fn(|a| moved(a, bounds.max[a], 1.0));
        Self::World { min, max }
    }

    /// True if every position is inside.
    pub(super) fn holds_all(&self, positions: &Positions) -> bool {
        (0..3).all(|a| match (self, positions) {
            (Self::Lattice { first, last }, Positions::Quantized(p)) => all_within(&p[a], first[a], last[a]),
            (Self::World { min, max }, Positions::World(p)) => p[a].iter().all(|v| min[a] <= *v && *v <= max[a]),
            _ => false,
        })
    }

    /// True if a position is inside.
    pub(super) fn holds(&self, positions: &Positions, i: usize) -> bool {
        (0..3).all(|a| match (self, positions) {
            (Self::Lattice { first, last }, Positions::Quantized(p)) => {
                (first[a]..=last[a]).contains(&i64::from(p[a][i]))
            }
            (Self::World { min, max }, Positions::World(p)) => min[a] <= p[a][i] && p[a][i] <= max[a],
            _ => false,
        })
    }
}

/// How far from a border of the box a coordinate of that resolution is still on it.
fn slack(border: f64, resolution: Resolution) -> f64 {
    let (step, offset) = match resolution {
        Resolution::Grid(grid) => (grid.step, grid.offset),
        Resolution::Step(step) => (step, 0.0),
        Resolution::Single | Resolution::Double => (0.0, 0.0),
    };
    (4.0 * f64::EPSILON * (border.abs() + offset.abs())).max(SAME_PLACE * step)
}

fn all_within(column: &[i32], first: i64, last: i64) -> bool {
    column.iter().all(|q| first <= i64::from(*q) && i64::from(*q) <= last)
}

/// The border on the lattice: the point that it is meant to be on, else the next one inside the box (`inwards`).
fn border(lattice: &Lattice, axis: usize, world: f64, inwards: impl Fn(f64) -> f64) -> i64 {
    let (scale, offset) = (lattice.scale[axis], lattice.offset[axis]);
    let steps = (world - offset) / scale;
    // What the rounding of the border, the scale and the offset can come to, in steps.
    let rounding = 4.0 * f64::EPSILON * (world.abs() + offset.abs()) / scale;
    let nearest = steps.round();
    let is_on_it = (steps - nearest).abs() <= rounding.max(SAME_PLACE);
    (if is_on_it { nearest } else { inwards(steps) }) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(lattice: Option<Lattice>, resolution: Resolution) -> ScanInfo {
        let mut info = ScanInfo::new("x", "", 0);
        (info.lattice, info.resolution) = (lattice, [resolution; 3]);
        info
    }

    fn inside(info: &ScanInfo, min: f64, max: f64, positions: &Positions) -> Vec<usize> {
        let cut = Cut::new(&Aabb { min: [min; 3], max: [max; 3] }, info);
        let inside: Vec<usize> = (0..positions.len()).filter(|i| cut.holds(positions, *i)).collect();
        assert_eq!(cut.holds_all(positions), inside.len() == positions.len());
        inside
    }

    #[test]
    fn borders_in_decimals_are_points_of_a_decimal_lattice() {
        let steps = |range: std::ops::Range<i32>| Positions::Quantized([(); 3].map(|()| range.clone().collect()));
        for (scale, offset, first) in
            [(0.1, 0.0, 0), (0.001, 0.0, 0), (0.01, 477_000.0, 47_700_000), (1e-7, -0.5, -5_000_000)]
        {
            let info = info(Some(Lattice { scale: [scale; 3], offset: [offset; 3] }), Resolution::Double);
            for k in 1..1000 {
                // as somebody would type it: the nearest double of a decimal
                let typed = |k: i64| format!("{}e{}", first + k, f64::log10(scale).round()).parse::<f64>().unwrap();
                let (min, max) = (typed(k), typed(2 * k));
                let found = inside(&info, min, max, &steps(0..2_100));
                assert_eq!((found[0] as i64, found[found.len() - 1] as i64), (k, 2 * k), "{scale} {offset}");
            }
        }
        let info = info(Some(Lattice { scale: [0.1; 3], offset: [0.0; 3] }), Resolution::Double);
        assert_eq!(inside(&info, 0.05, 0.34, &steps(0..9)), [1, 2, 3], "between the steps");
        assert_eq!(inside(&info, 0.31, 0.34, &steps(0..9)), Vec::<usize>::new(), "no step at all");
        assert_eq!(inside(&info, -1.0, 9.0, &steps(0..9)).len(), 9);
    }

    #[test]
    fn other_coordinates_are_compared_as_precisely_as_they_are_stored() {
        let world = |values: &[f64]| Positions::World([(); 3].map(|()| values.to_vec()));
        let single = world(&[f64::from(0.3f32), f64::from(0.3f32.next_up())]);
        assert_eq!(inside(&info(None, Resolution::Single), 0.0, 0.3, &single), [0]);
        let double = world(&[3.0 * 0.1, 0.3, 0.300_000_1]);
        assert_eq!(inside(&info(None, Resolution::Double), 0.3, 0.3, &double), [0, 1]);
        let scaled = world(&[300_000.0 * 0.001 - 299.7, 0.301]);
        assert_eq!(inside(&info(None, Resolution::Step(0.001)), 0.0, 0.3, &scaled), [0]);
    }
}
