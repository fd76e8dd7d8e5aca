use pointmill_testkit::Random;

use super::*;

fn lattice(scale: [f64; 3]) -> Lattice {
    Lattice { scale, offset: [0.0; 3] }
}

/// The cube of a cloud along the x axis, `extent` steps long.
fn long(extent: i64) -> Cube {
    Cube::around(&JobBounds::new([0; 3], [extent, 0, 0]), &lattice([0.001; 3])).unwrap()
}

#[test]
fn the_side_is_the_extent_and_odd() {
    for (min, max) in [(0, 0), (-5, 1000), (123_456, 9_876_543), (-2_000_000_000, 40), (7, 7 + (1 << 30))] {
        let bounds = JobBounds::new([min, 0, min], [max, 1, max]);
        let cube = Cube::around(&bounds, &lattice([0.01; 3])).unwrap();
        let steps = cube.steps.unwrap();
        let needed = (max.abs_diff(min) + 1).max(129);
        assert!(steps % 2 == 1 && (needed..=needed + 1).contains(&steps), "{needed} {steps}");
        assert_eq!(cube.side, steps as f64 * 0.01);
        for a in 0..3 {
            assert!(cube.min[a] <= bounds.min[a] && bounds.max[a] < cube.min[a] + steps as i64);
        }
    }
}

#[test]
fn shorter_axes_are_near_the_middle_and_thin_ones_above_its_plane() {
    let place = |extent: i64, thin: i64| {
        let cube = Cube::around(&JobBounds::new([0; 3], [extent, thin, 0]), &lattice([0.01; 3])).unwrap();
        [-cube.min[0], -cube.min[1], -cube.min[2]]
    };
    assert_eq!(place(1000, 499), [0, 501, 501], "a side of 1001 steps has its middle plane at 500.5");
    assert_eq!(place(1000, 500), [0, 250, 501], "one more than the upper half holds");
    assert_eq!(place(1000, 700), [0, 150, 501]);
    assert_eq!(place(999, 1), [0, 501, 501], "the side of an even number of points is one step more");
    assert_eq!(place(3, 2), [65, 65, 65], "smaller than any cube");
    // No plane divides a thin cloud above the level whose nodes are thinner.
    let (extent, thin) = (100_000, 3000);
    let cube = Cube::around(&JobBounds::new([0; 3], [extent, thin, 0]), &lattice([0.01; 3])).unwrap();
    let cells = |level| [0, thin].map(|y| cube.tree(JobPoint([0, y, 0]))[1] >> (31 - level));
    let divided = (1..20).find(|l| cells(*l)[0] != cells(*l)[1]);
    assert_eq!(divided, Some(6), "100,001 / 2^5 is 3125");
}

#[test]
fn tree_coordinates_are_exact_floors() {
    let mut random = Random::new(3);
    let mut sides: Vec<u64> = (0..200).map(|_| (129 + random.below((1 << 31) - 129)) | 1).collect();
    sides.extend([129, 131, 255, 257, 65_535, 65_537, (1 << 30) - 1, (1 << 30) + 1, (1 << 31) - 3, (1 << 31) - 1]);
    for steps in sides {
        let cube = long(steps as i64 - 1);
        assert_eq!(cube.steps, Some(steps));
        let exact = |x: u64| (u128::from(x) << 31) / u128::from(steps);
        let ends = (0..60).chain(steps - 60..steps);
        // the coordinates beside planes are where rounding would show
        let beside = (1..31).flat_map(|l| {
            let i = 2 * random.below(1 << (l - 1)) + 1;
            let below = ((u128::from(i) * u128::from(steps)) >> l) as u64;
            [below, below + 1]
        });
        let xs: Vec<u64> = ends.chain(beside).filter(|x| *x < steps).collect();
        for x in xs {
            let t = cube.tree(JobPoint([x as i64, 0, 0]))[0];
            assert_eq!(u128::from(t), exact(x), "{x} of {steps}");
            for level in [1, 6, 8] {
                if let Some(factors) = cube.cell_factors(level) {
                    assert_eq!(high(x, factors[0]), u64::from(t >> (31 - level)), "{x} of {steps}, level {level}");
                } else {
                    assert!(steps < 1 << level, "{steps} {level}");
                }
            }
        }
    }
}

#[test]
fn an_extent_beyond_31_bits_has_no_cube() {
    let bounds = JobBounds::new([i64::from(i32::MIN); 3], [i64::from(i32::MAX); 3]);
    assert_eq!(Cube::around(&bounds, &lattice([1.0; 3])), Err(TooFine));
    let most = MOST_STEPS as i64;
    for min in [0, 1, -7, 123_456_789, -1_987_654_321] {
        let cube = Cube::around(&JobBounds::new([min; 3], [min + most; 3]), &lattice([0.001; 3])).unwrap();
        assert_eq!((cube.steps, cube.min), (Some(LONGEST), JobPoint([min; 3])));
        let ends = [min, min + most].map(|v| i64::from(cube.tree(JobPoint([v; 3]))[0]));
        assert_eq!(ends, [0, most], "a unit of the tree is a step, nearly");
        assert!(Cube::around(&JobBounds::new([min; 3], [min + most + 1; 3]), &lattice([0.001; 3])).is_err());
    }
    let flat = JobBounds::new([-5, 3, 7], [-5 + most, most, 100]);
    let cube = Cube::around(&flat, &lattice([1e-8, 1e-8, 0.001])).unwrap();
    assert!(cube.side >= most as f64 * 1e-8);
}

#[test]
fn scales_that_are_powers_of_two_apart_are_exact_too() {
    let scale = [0.25, 2.0, 0.125];
    let bounds = JobBounds::new([-4000, 100, 7], [80_000, 20_000, 90_000]);
    let cube = Cube::around(&bounds, &lattice(scale)).unwrap();
    // 19,900 steps of 2.0 are the longest axis: 318,400 of 0.125
    assert_eq!((cube.steps, cube.side), (Some(318_401), 39_800.125));
    let mut random = Random::new(5);
    for _ in 0..5000 {
        let q: [i64; 3] = std::array::from_fn(|a| bounds.min[a] + random.below(bounds.extent(a) + 1) as i64);
        let t = cube.tree(JobPoint(q));
        for a in 0..3 {
            let finest = ((q[a] - cube.min[a]) as u128) << [1, 4, 0][a];
            assert_eq!(u128::from(t[a]), (finest << 31) / 318_401);
            if let Some(factors) = cube.cell_factors(8) {
                assert_eq!(high((q[a] - cube.min[a]) as u64, factors[a]), u64::from(t[a] >> 23));
            }
        }
    }
    assert!(cube.cell_factors(8).is_some());
}

#[test]
fn unequal_scales_give_one_cube_and_points_inside_it() {
    let bounds = JobBounds::new([-1_220_000_000, 450_000_000, 0], [-1_219_900_000, 450_100_000, 30_000]);
    let scale = [1e-7, 1e-7, 0.01];
    let cube = Cube::around(&bounds, &lattice(scale)).unwrap();
    assert_eq!((cube.steps, cube.min[2], cube.side), (None, 0, 30_001.0 * 0.01));
    // z fills the cube; x and y have room for no more than the integers of the format
    for (q, a) in [(bounds.min, 0), (bounds.max, 0), (bounds.max, 1), (bounds.max, 2)] {
        let fraction = f64::from(cube.tree(q)[a]) / 2f64.powi(31);
        let expected = (q[a] - cube.min[a]) as f64 * scale[a] / cube.side;
        assert!((fraction - expected).abs() < 1e-9, "{a}: {fraction} {expected}");
    }
    assert!(bounds.max[0] - cube.min[0] <= i64::from(i32::MAX));
    // the reference axis is as exact as equal scales, the last coordinate of others is inside
    let wide = JobBounds::new([0; 3], [1_000_000, 333_333, 9]);
    let cube = Cube::around(&wide, &lattice([0.01, 0.03, 0.7])).unwrap();
    assert_eq!(u128::from(cube.tree(wide.max)[0]), (1_000_000u128 << 31) / 1_000_001);
    assert!((0..3).all(|a| cube.tree(wide.max)[a] < 1 << 31 && cube.tree(wide.min)[a] <= cube.tree(wide.max)[a]));
    assert_eq!(cube.tree(wide.max)[2] >> 30, 1, "thin: above the middle plane");
    // more steps of y across the cube than 64 bits count
    let cube = Cube::around(&wide, &lattice([1e9, 1e-15, 1.0])).unwrap();
    assert_eq!((cube.min[1], cube.tree(wide.max)[1]), (0, 0));
}

#[test]
fn the_box_of_a_node_holds_its_points_and_no_others() {
    let bounds = JobBounds::new([-1_220_000_000, 450_000_000, 0], [-1_219_900_000, 450_100_000, 30_000]);
    for scale in [[1e-7, 1e-7, 0.01], [0.01; 3], [0.3, 0.001, 7.0], [0.5, 0.25, 1.0]] {
        let cube = Cube::around(&bounds, &lattice(scale)).unwrap();
        let mut random = Random::new(1);
        for _ in 0..2000 {
            let q = JobPoint(std::array::from_fn(|a| bounds.min[a] + random.below(bounds.extent(a) + 1) as i64));
            for level in [0u8, 4, 9, 17] {
                let shift = TREE_BITS - u32::from(level);
                let cell = cube.tree(q).cell(shift);
                let [x, y, z] = cell;
                let b = cube.bounds_of(NodeKey { level, x, y, z });
                assert!((0..3).all(|a| b.min[a] <= q[a] && q[a] <= b.max[a]), "{scale:?} {level} {q:?} {b:?}");
                for a in 0..3 {
                    let others = [b.min[a] - 1, b.max[a] + 1].map(|v| {
                        let mut other = q;
                        other[a] = v;
                        (v >= cube.min[a]).then(|| cube.tree(other).cell(shift)[a])
                    });
                    assert!(!others.contains(&Some(cell[a])), "{scale:?} {level} {q:?} {b:?}");
                }
            }
        }
    }
}

/// Ways in which clients compute the planes of nodes from the corners of the root and decide on which side a coordinate
/// `x · scale + offset` is.
mod clients {
    /// The lower and upper plane of a node's child.
    type Halve = fn([f64; 2], bool) -> [f64; 2];

    pub(super) const HALVES: [(&str, Halve); 3] = [
        ("min + (max - min) / 2", |[min, max], upper| {
            let middle = min + (max - min) / 2.0;
            if upper { [middle, max] } else { [min, middle] }
        }),
        ("(min + max) / 2", |[min, max], upper| {
            let middle = (min + max) / 2.0;
            if upper { [middle, max] } else { [min, middle] }
        }),
        // Potree's createChildAABB
        ("min += size / 2, max -= size / 2", |[min, max], upper| {
            let size = max - min;
            if upper { [min + size / 2.0, max] } else { [min, max - size / 2.0] }
        }),
    ];

    /// Both planes of all nodes of a level.
    pub(super) fn walk(
        halve: Halve,
        root: [f64; 2],
        level: u32,
        node: u64,
        at: u32,
        see: &mut impl FnMut(u64, [f64; 2]),
    ) {
        if at == level {
            return see(node, root);
        }
        for upper in [false, true] {
            walk(halve, halve(root, upper), level, 2 * node + u64::from(upper), at + 1, see);
        }
    }
}

#[test]
fn clients_decide_the_same_at_every_plane() {
    let level = 16;
    let scenes = [
        (0.001, 5_000_000.0, 1_048_575),
        (0.001, 5_000_000.123, 999_999),
        (0.001, -5_400_123.457, 87_654_320),
        (0.01, 4_999_999.99, 123_456_788),
        (0.1, 5e6, 70_000),
        (0.000_3, 477_000.1, 2_000_000_000),
        (1e-7, -122.4, 1_234_567),
        (0.0625, 5e6, 65_537),
    ];
    for (scale, far, extent) in scenes {
        let (scale, far): (f64, f64) = (scale, far);
        let min = (far / scale).round() as i64;
        let bounds = JobBounds::new([min, min, min], [min + extent, min + extent / 3, min + 7]);
        for lattice_offset in [0.0, far] {
            let lattice = Lattice { scale: [scale; 3], offset: [lattice_offset; 3] };
            let shifted = |v: i64| if lattice_offset == 0.0 { v } else { v - min };
            let [lo, hi] = [bounds.min, bounds.max].map(|q| q.0.map(shifted));
            let cube = Cube::around(&JobBounds::new(lo, hi), &lattice).unwrap();
            let (steps, offset) = (cube.steps.unwrap(), cube.offset(&lattice));
            for min in offset {
                let max = min + cube.side;
                let ulp = min.abs().max(max.abs()).next_up() - min.abs().max(max.abs());
                assert!(4.0 * ulp < scale / 2f64.powi(level as i32), "what the page demands");
                // first and last integer of each node by the integers
                let ends = |node: u64| {
                    let first = |i: u64| (u128::from(i) * u128::from(steps)).div_ceil(1 << level) as u64;
                    (first(node), first(node + 1) - 1)
                };
                let world = |x: u64| x as f64 * scale + min;
                for (name, halve) in clients::HALVES {
                    clients::walk(halve, [min, max], level, 0, 0, &mut |node, [low, high]| {
                        let (first, last) = ends(node);
                        let inside = low <= world(first) && world(last) < high;
                        let others =
                            (first == 0 || world(first - 1) < low) && (last + 1 == steps || world(last + 1) >= high);
                        assert!(inside && others, "{name}: node {node} of scale {scale}, {far}");
                    });
                    // the same relative to the corner
                    clients::walk(halve, [0.0, max - min], level, 0, 0, &mut |node, [low, high]| {
                        let (first, last) = ends(node);
                        let at = |x: u64| world(x) - min;
                        let others = (first == 0 || at(first - 1) < low) && (last + 1 == steps || at(last + 1) >= high);
                        assert!(
                            low <= at(first) && at(last) < high && others,
                            "{name}, relative: node {node} of {scale}, {far}"
                        );
                    });
                }
                for i in 1..1u64 << level {
                    let (first, _) = ends(i);
                    let fraction = i as f64 / (1u64 << level) as f64;
                    for plane in [min + (max - min) * fraction, min * (1.0 - fraction) + max * fraction] {
                        assert!(world(first - 1) < plane && plane <= world(first), "plane {i} of scale {scale}, {far}");
                    }
                }
            }
        }
    }
}

#[test]
fn whole_decimals_stay_whole() {
    assert_eq!(tidy_world(123, 0.01, 476_000.0), 476_001.23);
    assert_eq!(tidy_world(-7, 0.001, 0.0), -0.007);
    assert_eq!(tidy_world(3, 0.3, 1.0), 3.0 * 0.3 + 1.0);
}

#[test]
fn a_coarse_axis_makes_the_side_longer_and_has_its_own_place() {
    let at = |extent| Cube::around(&JobBounds::new([0; 3], [0, extent, 0]), &lattice([1.0, 4.0, 1.0])).unwrap();
    let thin = at(0);
    // 129 steps of the coarse axis are 516 of the others, the next odd number is 517
    assert_eq!((thin.whole_steps(), thin.side, thin.resolved_level()), (Some((517, [0, 2, 0])), 517.0, 10));
    assert_eq!(thin.min, JobPoint([-259, -65, -259]), "the first above the middle planes, 258.5 and 64.625");
    assert_eq!(at(100).min, JobPoint([-259, -14, -259]), "of 129 coarse coordinates 28 are left over");
    assert_eq!(at(64).min, JobPoint([-259, -65, -259]), "up to the last coordinate");
    assert_eq!(at(65).min, JobPoint([-259, -32, -259]));
}

#[test]
fn the_axis_that_is_longest_in_the_world_gives_the_side_of_unequal_scales() {
    let around = |scale, extent| Cube::around(&JobBounds::new([0; 3], extent), &lattice(scale)).unwrap();
    let scale = [0.75, 0.5, 0.25];
    let cube = around(scale, [4000, 6000, 0]);
    assert_eq!((cube.side, cube.steps, cube.resolved_level()), (4001.0 * 0.75, None, 31), "of equals the first");
    assert_eq!(around(scale, [4000, 6001, 0]).side, 6003.0 * 0.5, "the next odd number");
    // a step of the coarsest axis fits twice: 2 · 384 / 0.5 = 1536
    let coarse = |extent| around([0.5, 0.75, 384.0], [extent, 0, 0]);
    assert_eq!((coarse(0).side, coarse(0).min[0]), (1537.0 * 0.5, -769));
    assert_eq!((coarse(767).min[0], coarse(768).min[0]), (-769, -384), "768 coordinates are above the middle");
    // the side is 12,003 steps of z: the last coordinate is 12,002, the first above the middle plane 6002
    let place = |thin| around(scale, [4000, 0, thin]).min[2];
    assert_eq!((place(6000), place(6001), place(12_000)), (-6002, -3000, -1));
}

#[test]
fn nearest_tree_coordinates_are_the_nearest() {
    let mut random = Random::new(11);
    for steps in [129u64, 517, 65_537, (1 << 30) + 1, (1 << 31) - 1] {
        let cube = long(steps as i64 - 1);
        for x in (0..40).chain(steps - 40..steps).chain((0..200).map(|_| random.below(steps))) {
            let exact = ((u128::from(x) << 32) + u128::from(steps)) / (2 * u128::from(steps));
            assert_eq!(u128::from(cube.nearest_tree(JobPoint([x as i64, 0, 0]))[0]), exact, "{x} of {steps}");
        }
    }
    let coarse = Cube::around(&JobBounds::new([0; 3], [0, 100, 0]), &lattice([1.0, 4.0, 1.0])).unwrap();
    let [_, y, _] = coarse.nearest_tree(JobPoint([0, 50, 0]));
    assert_eq!(y, ((256 << 32) + 517) / (2 * 517), "64 coarse steps above the corner");
}

#[test]
fn cells_of_unequal_scales_have_factors_where_no_bit_is_lost() {
    let bounds = JobBounds::new([0; 3], [3000, 100, 700]);
    let cube = Cube::around(&bounds, &lattice([0.75, 0.5, 0.25])).unwrap();
    // the factor of 3001 is odd and its shift is 20: the cells of level 11 are the upper bits, those of level 10 would lose one
    assert_eq!((cube.factor[0] % 2, cube.shift[0]), (1, 20));
    assert_eq!([9, 10, 32].map(|level| cube.cell_factors(level)), [None; 3]);
    let factors = cube.cell_factors(11).unwrap();
    for q in [[0; 3], [1, 1, 1], [1500, 50, 350], [3000, 100, 700]].map(JobPoint) {
        let t = cube.tree(q);
        let cells: [u64; 3] = std::array::from_fn(|a| high((q[a] - cube.min[a]) as u64, factors[a]));
        assert_eq!(cells, t.0.map(|t| u64::from(t >> 20)), "{q:?}");
    }
}

#[test]
fn the_corner_in_the_world_is_a_point_of_the_lattice() {
    let cube = Cube::around(&JobBounds::new([-40; 3], [960, -40, 960]), &lattice([0.01; 3])).unwrap();
    let lattice = Lattice { scale: [0.01; 3], offset: [476_000.0, 0.0, -2.5] };
    // y: 501 steps below its only coordinate
    assert_eq!(cube.offset(&lattice), [475_999.6, -5.41, -2.9]);
}

#[test]
fn decimals_are_tidied_only_where_the_offset_is_whole_steps() {
    for (q, scale, offset, plain, tidy) in [
        (3, 0.1, 0.0, 0.300_000_000_000_000_04, 0.3),
        (56, 0.01, 4.0, 4.560_000_000_000_000_5, 4.56),
        (-56, 0.01, -4.0, -4.560_000_000_000_000_5, -4.56),
    ] {
        assert_eq!((q as f64 * scale + offset, tidy_world(q, scale, offset)), (plain, tidy));
    }
    // half a step: 0.035 would be nearer, but is not what readers compute
    assert_eq!(tidy_world(3, 0.01, 0.005), 3.0 * 0.01 + 0.005);
    assert_ne!(3.0 * 0.01 + 0.005, 0.035);
}
