use std::collections::HashMap;

use pointmill_testkit::Random;

use super::*;

/// A node away from the corner of the cloud, its points in Morton order, and what neighbours have taken around it.
struct Scene {
    node: NodeKey,
    corner: [i64; 3],
    side: i64,
    points: Vec<TreePoint>,
    around: Vec<TreePoint>,
}

fn sorted(mut points: Vec<TreePoint>) -> Vec<TreePoint> {
    points.sort_unstable_by(|a, b| crate::cloud::morton::compare(a.0, b.0));
    points
}

/// `count` points of a node and as many up to two spacings around it; with `thin`, all within two spacings of its faces.
fn scene(spacing: Spacing, level: u8, count: usize, thin: bool) -> Scene {
    let node = NodeKey { level, x: 5, y: 9, z: 700 };
    let bits = TREE_BITS - u32::from(level);
    let (side, reach) = (1i64 << bits, i64::from(spacing.reach(level).unwrap()));
    let corner = [5i64, 9, 700].map(|c| c << bits);
    let mut random = Random::new(count as u64);
    let mut at = |offset: i64, length: i64| offset + random.below(length as u64) as i64;
    let point = |p: [i64; 3]| TreePoint(std::array::from_fn(|a| (corner[a] + p[a]) as u32));
    let inside = |p: &[i64; 3]| p.iter().all(|v| (0..side).contains(v));
    let (mut points, mut around) = (Vec::new(), Vec::new());
    while points.len() < count || around.len() < count {
        let mut p: [i64; 3] = std::array::from_fn(|_| at(-2 * reach, side + 4 * reach));
        if thin {
            let end = at(-2 * reach, 4 * reach);
            p[points.len() % 3] = if points.len() % 2 == 0 { end } else { side + end };
        }
        let list = if inside(&p) { &mut points } else { &mut around };
        if list.len() < count {
            list.push(point(p));
        }
    }
    points.extend_from_within(..count / 20); // places that repeat
    Scene { node, corner, side, points: sorted(points), around }
}

/// Offers the points in parts of at most `most` that end where they may be cut.
fn choose(sampler: &mut Sampler, scene: &Scene, most: usize) -> Vec<bool> {
    sampler.begin(scene.node, &scene.around);
    let (mut accepted, mut rest) = (Vec::new(), &scene.points[..]);
    while !rest.is_empty() {
        let may_end = |n: &usize| *n == rest.len() || sampler.may_be_cut(scene.node.level, rest[*n - 1], rest[*n]);
        let count = (1..=rest.len()).filter(may_end).take_while(|n| *n <= most).last();
        let count = count.or_else(|| (1..=rest.len()).find(may_end)).unwrap();
        sampler.offer(rest[..count].iter().copied());
        accepted.extend_from_slice(sampler.choose());
        rest = &rest[count..];
    }
    accepted
}

fn taken(scene: &Scene, accepted: &[bool]) -> Vec<TreePoint> {
    scene.points.iter().zip(accepted).filter(|(_, taken)| **taken).map(|(t, _)| *t).collect()
}

/// The points that neighbours must keep their distance from: closer than the reach to a face of the node.
fn assert_border(sampler: &Sampler, scene: &Scene, taken: &[TreePoint]) {
    let reach = i64::from(sampler.spacing.reach(scene.node.level).unwrap());
    let is_near = |t: &&TreePoint| {
        (0..3).any(|a| {
            let from = i64::from(t[a]) - scene.corner[a];
            from < reach || from >= scene.side - reach
        })
    };
    assert_eq!(sampler.border(), taken.iter().filter(is_near).copied().collect::<Vec<_>>());
}

const SCENES: [(f64, u8, usize, bool); 4] =
    [(16.0, 12, 5000, false), (23.0, 12, 5000, false), (128.0, 12, 5000, true), (16.0, 27, 2000, false)];

#[test]
fn disks_keep_their_distance_over_borders_and_leave_no_hole() {
    for (divisor, level, count, thin) in SCENES {
        let spacing = Spacing::new(divisor);
        let scene = scene(spacing, level, count, thin);
        let mut sampler = Sampler::new(Sampling::Poisson, spacing);
        let accepted = choose(&mut sampler, &scene, usize::MAX);
        let taken = taken(&scene, &accepted);
        let squared = spacing.squared(level);
        let nearest = |p: TreePoint, others: &[TreePoint]| {
            others.iter().map(|o| squared_distance(p, *o)).fold(f64::INFINITY, f64::min)
        };
        for (i, t) in taken.iter().enumerate() {
            assert!(nearest(*t, &taken[..i]) >= squared && nearest(*t, &scene.around) >= squared, "{divisor} {t:?}");
        }
        let hole = squared * 1.00002f64.powi(2);
        for p in &scene.points {
            assert!(nearest(*p, &taken).min(nearest(*p, &scene.around)) < hole, "{divisor} {p:?}");
        }
        assert!(taken.len() > 100 && taken.len() < scene.points.len() - 100);
        assert_border(&sampler, &scene, &taken);
        assert_eq!(choose(&mut sampler, &scene, 300), accepted, "in parts, by a sampler that has done a node before");
    }
}

#[test]
fn cells_give_one_free_point_each() {
    for (divisor, level, count, thin) in SCENES {
        let spacing = Spacing::new(divisor);
        let scene = scene(spacing, level, count, thin);
        let (shift, squared) = (spacing.unit_bits(level).unwrap(), spacing.squared(level));
        let is_free = |p: &TreePoint| scene.around.iter().all(|o| squared_distance(*p, *o) >= squared);
        let mut cells: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
        for (i, p) in scene.points.iter().enumerate().filter(|(_, p)| is_free(p)) {
            cells.entry(p.cell(shift)).or_default().push(i);
        }
        let off_center = |i: usize| {
            let p = scene.points[i];
            let cell = p.cell(shift);
            let twice = |a: usize| 2 * (i64::from(p[a]) - (i64::from(cell[a]) << shift)) - ((1 << shift) - 1);
            (0..3).map(|a| i128::from(twice(a)).pow(2)).sum::<i128>()
        };
        let mut by_method = Vec::new();
        for sampling in [Sampling::Grid, Sampling::Random { seed: 7 }] {
            let mut sampler = Sampler::new(sampling, spacing);
            let accepted = choose(&mut sampler, &scene, usize::MAX);
            let taken = taken(&scene, &accepted);
            assert_eq!(taken.len(), cells.len());
            for indices in cells.values() {
                let chosen: Vec<usize> = indices.iter().copied().filter(|i| accepted[*i]).collect();
                assert_eq!(chosen.len(), 1, "{divisor}");
                if sampling == Sampling::Grid {
                    assert_eq!(Some(chosen[0]), indices.iter().copied().min_by_key(|i| off_center(*i)));
                }
            }
            assert_border(&sampler, &scene, &taken);
            assert_eq!(choose(&mut sampler, &scene, 300), accepted, "in parts");
            by_method.push(accepted);
        }
        // where cells have several free points in different places
        if !thin && shift > 0 {
            assert_ne!(by_method[0], by_method[1], "{divisor}");
        }
    }
}

#[test]
fn below_a_unit_each_place_is_taken_once() {
    let node = NodeKey { level: 25, x: 1, y: 2, z: 3 };
    let at = |z: u32| TreePoint([64, 128, 192 + z]);
    let points = [0, 0, 1, 2, 2, 2, 63].map(at);
    for sampling in [Sampling::Poisson, Sampling::Grid, Sampling::Random { seed: 1 }] {
        let mut sampler = Sampler::new(sampling, Spacing::default());
        sampler.begin(node, &[at(1), at(64)]);
        sampler.offer(points.into_iter());
        assert_eq!(sampler.choose(), [true, false, true, true, false, false, true]);
        assert_eq!(sampler.border(), []);
        let same = |a, b| [sampler.may_be_cut(25, a, b), sampler.takes_one_only(25, a, b)];
        assert_eq!((same(at(2), at(2)), same(at(2), at(3))), ([false, true], [true, false]));
    }
}

#[test]
fn the_root_has_no_neighbours() {
    for sampling in [Sampling::Poisson, Sampling::Grid] {
        let mut sampler = Sampler::new(sampling, Spacing::default());
        sampler.begin(NodeKey::ROOT, &[]);
        sampler.offer([TreePoint([0; 3]), TreePoint([1 << 30; 3]), TreePoint([(1 << 31) - 1; 3])].into_iter());
        assert_eq!(sampler.choose(), [true; 3]);
        assert_eq!(sampler.border(), []);
    }
}

#[test]
fn what_may_be_cut_and_what_takes_one_only() {
    let (level, unit) = (12, 1u32 << 12);
    let [a, near, tile] = [0, unit - 1, 4 * unit].map(|x| TreePoint([x, 0, 0]));
    let spacing = Spacing::default(); // a unit
    for (sampling, pairs) in [
        (
            Sampling::Poisson,
            [(a, near, true), (a, TreePoint([unit, 0, 0]), false), (near, TreePoint([unit, 0, 0]), true)],
        ),
        (
            Sampling::Grid,
            [(a, near, true), (a, TreePoint([unit, 0, 0]), false), (near, TreePoint([unit, 0, 0]), false)],
        ),
    ] {
        let sampler = Sampler::new(sampling, spacing);
        for (a, b, one) in pairs {
            assert_eq!(sampler.takes_one_only(level, a, b), one, "{sampling:?} {a:?} {b:?}");
            assert!(!sampler.may_be_cut(level, a, b));
        }
        assert!(sampler.may_be_cut(level, TreePoint([4 * unit - 1, 0, 0]), tile));
    }
}

#[test]
fn memory_is_that_of_the_points_taken() {
    let point = size_of::<TreePoint>() as u64;
    let spacing = Spacing::new(16.0);
    let mut sampler = Sampler::new(Sampling::Poisson, spacing);
    // √2 · 18³ spheres at most
    assert_eq!((sampler.expected_bytes(100), sampler.expected_bytes(1 << 40)), (100 * point, 8247 * point));
    let scene = scene(spacing, 12, 500, false);
    sampler.expect(500);
    let taken = choose(&mut sampler, &scene, usize::MAX).iter().filter(|t| **t).count() as u64;
    let noted = sampler.border().len() as u64 * point;
    let over = sampler.over_border.bytes();
    assert!(over >= 100 * 16, "a point and the number of its tile for each tile that it is near");
    assert_eq!(sampler.bytes(), taken * point + noted + over);
    sampler.release();
    assert_eq!((sampler.bytes(), sampler.border().len()), (0, 0));
    let mut cells = Sampler::new(Sampling::Grid, spacing);
    assert_eq!((cells.expected_bytes(100), cells.bytes()), (0, 0));
    choose(&mut cells, &scene, usize::MAX);
    assert_eq!(cells.bytes(), cells.border().len() as u64 * point + over);
}
