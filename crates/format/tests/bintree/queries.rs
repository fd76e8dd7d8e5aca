//! Queries against a look at every leaf and every point.

use std::sync::Arc;

use pointmill_format::bintree::{
    Bintree, Frustum, Hit, Layout, Material, Picker, Ray, distance_range, switch_distance,
};
use pointmill_format::{Aabb, NodePoints};
use pointmill_testkit::Random;

use crate::util::{FAR, Found, corridor, files_of, open, read_all};

fn cloud(n: usize, capacity: u64, seed: u64) -> Bintree {
    open(&files_of(&mut corridor(n, 400_000.0, seed), capacity, Layout::Packed, FAR)).unwrap()
}

/// A place in and around the cloud.
fn somewhere(tree: &Bintree, random: &mut Random) -> [f64; 3] {
    let Aabb { min, max } = tree.nodes()[0].bounds;
    [0, 1, 2].map(|a| random.between(min[a] - 30.0, max[a] + 30.0))
}

fn direction(random: &mut Random) -> [f64; 3] {
    match random.index(6) {
        axis @ 0..3 => [0, 1, 2].map(|a| if a == axis { -1.0 } else { 0.0 }),
        _ => [0; 3].map(|_| random.between(-1.0, 1.0)),
    }
}

#[test]
fn boxes_tell_the_leaves_that_a_look_at_every_leaf_tells() {
    let (tree, random) = (cloud(5000, 60, 1), &mut Random::new(1));
    let all = read_all(&tree).unwrap();
    let (mut some, mut scratch) = (0, NodePoints::default());
    for _ in 0..200 {
        let mut wanted = Aabb::EMPTY;
        wanted.grow(somewhere(&tree, random));
        wanted.grow(somewhere(&tree, random));
        wanted.max[0] = wanted.max[0].min(wanted.min[0] + 40.0);
        let touches = |b: &Aabb| (0..3).all(|a| b.min[a] <= wanted.max[a] && wanted.min[a] <= b.max[a]);
        let expected: Vec<u32> = tree.leaves().filter(|l| touches(&tree.nodes()[*l as usize].bounds)).collect();
        assert_eq!(tree.leaves_in_box(&wanted), expected);
        let mut found = Vec::new();
        tree.points_in_box(&wanted, &mut scratch, |leaf, points, i| {
            found.push((leaf, i, points.column::<f32>("classification").unwrap()[i]));
        })
        .unwrap();
        let inside = all.iter().filter(|p| wanted.contains(p.0)).map(|p| (p.2, p.3 as usize, p.1));
        assert_eq!(found, inside.collect::<Vec<_>>());
        some += usize::from(!found.is_empty());
    }
    assert!(some > 50, "{some}");
    for leaf in tree.leaves() {
        let Aabb { min, max } = tree.nodes()[leaf as usize].bounds;
        for touching in [Aabb { min: max, max: max.map(|v| v + 1.0) }, Aabb { min: min.map(|v| v - 1.0), max: min }] {
            assert!(tree.leaves_in_box(&touching).contains(&leaf), "boxes are closed");
        }
    }
    let point = all[77].0;
    let mut found = 0;
    tree.points_in_box(&Aabb { min: point, max: point }, &mut scratch, |_, _, _| found += 1).unwrap();
    assert!(found >= 1, "a closed box without extent has the point at its corners");
}

fn frustum(tree: &Bintree, random: &mut Random) -> Frustum {
    let (at, forward) = (somewhere(tree, random), [0; 3].map(|_| random.between(-1.0, 1.0)));
    Frustum::perspective(at, forward, [0.0, 0.0, 1.0], random.between(0.2, 1.6), 1.6, [0.5, random.between(5.0, 300.0)])
}

#[test]
fn frustums_tell_the_leaves_that_a_look_at_every_leaf_tells() {
    let (tree, random) = (cloud(5000, 60, 2), &mut Random::new(2));
    let points = read_all(&tree).unwrap();
    let mut seen = 0;
    for _ in 0..200 {
        let frustum = frustum(&tree, random);
        let leaves = tree.leaves_in_frustum(&frustum);
        let expected: Vec<u32> = tree.leaves().filter(|l| frustum.may_see(&tree.nodes()[*l as usize].bounds)).collect();
        assert_eq!(leaves, expected);
        for p in points.iter().filter(|p| frustum.contains(p.0)) {
            assert!(leaves.binary_search(&p.2).is_ok(), "a point in sight is in no leaf in sight");
            seen += 1;
        }
    }
    assert!(seen > 1000, "{seen}");
}

#[test]
fn draw_lists_tell_what_every_leaf_by_itself_tells() {
    let (tree, random) = (cloud(5000, 60, 3), &mut Random::new(3));
    let points = read_all(&tree).unwrap();
    let mut drawn = [0; 3];
    for i in 0..200 {
        let (camera, frustum) = (somewhere(&tree, random), frustum(&tree, random));
        let frustum = (i % 2 == 0).then_some(&frustum);
        let distance = switch_distance(random.between(0.001, 0.1), 1.0, 1080.0);
        let list = tree.draw_list(camera, distance, frustum);
        let choose = |leaf: u32| {
            let bounds = &tree.nodes()[leaf as usize].bounds;
            (leaf, Material::choose(distance_range(bounds, camera), distance))
        };
        let expected =
            tree.leaves().filter(|l| frustum.is_none_or(|f| f.may_see(&tree.nodes()[*l as usize].bounds))).map(choose);
        assert_eq!(list, expected.collect::<Vec<_>>());
        list.iter().for_each(|(_, material)| drawn[*material as usize] += 1);
        for p in points.iter().step_by(37) {
            let Ok(at) = list.binary_search_by_key(&p.2, |(leaf, _)| *leaf) else { continue };
            let d = [0, 1, 2].map(|a| p.0[a] - camera[a]).iter().map(|v| v * v).sum::<f64>().sqrt();
            match list[at].1 {
                Material::Far => assert!(d > distance - 1e-6),
                Material::Near => assert!(d < distance + 1e-6),
                Material::Both => {}
            }
        }
    }
    assert!(drawn.iter().all(|n| *n > 500), "{drawn:?}");
}

/// The first point that the ray meets, found by a look at all: distance along the ray, leaf and index.
fn first_met(points: &[Found], o: [f64; 3], d: [f64; 3], r: f64, spread: f64) -> Option<f64> {
    let length = d.iter().map(|v| v * v).sum::<f64>().sqrt();
    let d = d.map(|v| v / length);
    let along = |p: &[f64; 3]| (0..3).map(|a| (p[a] - o[a]) * d[a]).sum::<f64>();
    let off = |p: &[f64; 3], t: f64| (0..3).map(|a| (p[a] - o[a] - t * d[a]).powi(2)).sum::<f64>().sqrt();
    let met = points.iter().map(|p| (along(&p.0), p.0)).filter(|(t, p)| *t >= 0.0 && off(p, *t) <= r + spread * t);
    met.map(|(t, _)| t).min_by(f64::total_cmp)
}

#[test]
fn picking_finds_the_point_that_a_look_at_every_point_finds() {
    let random = &mut Random::new(4);
    let (mut hits, mut misses) = (0, 0);
    for (n, capacity) in [(1, 5), (300, 7), (6000, 900)] {
        let tree = Arc::new(cloud(n, capacity, n as u64));
        let points = read_all(&tree).unwrap();
        // One keeps everything, the other one leaf.
        let mut pickers = [Picker::new(Arc::clone(&tree), 64 << 20), Picker::new(Arc::clone(&tree), 0)];
        for _ in 0..700 {
            // Half of the rays aim at a point.
            let target = points[random.index(points.len())].0;
            let (origin, way) = match random.index(2) {
                0 => (somewhere(&tree, random), direction(random)),
                _ => {
                    let (from, error) = (somewhere(&tree, random), random.between(0.0, 0.3));
                    (from, [0, 1, 2].map(|a| target[a] - from[a] + error))
                }
            };
            let (radius, spread) = ([0.0, 0.05, 0.5, 5.0][random.index(4)], [0.0, 0.01][random.index(2)]);
            let ray = Ray::new(origin, way, radius).unwrap().with_spread(spread);
            let expected = first_met(&points, origin, way, radius, spread);
            let found = pickers.each_mut().map(|picker| picker.pick(&ray).unwrap());
            assert_eq!(found[0], found[1]);
            match (found[0], expected) {
                (Some(hit), Some(t)) => {
                    assert!((hit.distance - t).abs() < 1e-6, "{hit:?}, expected {t}");
                    check_hit(&points, &hit);
                    hits += 1;
                }
                (None, None) => misses += 1,
                // Rounding may decide on the very border, as it does when a ray without width aims at a point.
                (hit, t) => assert!(radius == 0.0 && spread == 0.0, "{hit:?}, expected {t:?}"),
            }
        }
    }
    assert!(hits > 700 && misses > 300, "{hits} {misses}");
}

fn check_hit(points: &[Found], hit: &Hit) {
    let found = points.iter().find(|p| (p.2, p.3) == (hit.leaf, hit.point)).unwrap();
    assert_eq!((found.0, found.1), (hit.position, hit.class));
}

#[test]
fn of_points_met_at_once_the_first_in_order_is_told() {
    let mut points: Vec<_> = corridor(50, 1000.0, 5);
    points.iter_mut().for_each(|p| p.q = [500, 500, 500]);
    let tree = Arc::new(open(&files_of(&mut points, 8, Layout::Files, FAR)).unwrap());
    let at = tree.nodes()[0].bounds.min;
    let ray = Ray::new([at[0], at[1], at[2] + 10.0], [0.0, 0.0, -3.0], 0.01).unwrap();
    let hit = Picker::new(Arc::clone(&tree), 1 << 20).pick(&ray).unwrap().unwrap();
    assert_eq!((Some(hit.leaf), hit.point, hit.distance), (tree.leaves().next(), 0, 10.0));
}

#[test]
fn what_lies_behind_the_origin_is_not_met() {
    let tree = Arc::new(open(&files_of(&mut corridor(1, 10.0, 6), 8, Layout::Files, FAR)).unwrap());
    let [x, y, z] = tree.nodes()[0].bounds.min;
    let mut picker = Picker::new(tree, 1 << 20);
    let mut pick =
        |from: f64, way: f64| picker.pick(&Ray::new([x, y, z + from], [0.0, 0.0, way], 0.1).unwrap()).unwrap();
    assert!(pick(1.0, -1.0).is_some() && pick(0.0, 1.0).is_some());
    assert!(pick(1.0, 1.0).is_none() && pick(-0.001, -1.0).is_none());
}

#[test]
fn rays_that_are_none_are_refused() {
    assert!(Ray::new([0.0; 3], [0.0; 3], 1.0).is_none());
    assert!(Ray::new([f64::NAN; 3], [1.0; 3], 1.0).is_none());
    assert!(Ray::new([0.0; 3], [1.0, f64::INFINITY, 0.0], 1.0).is_none());
    assert!(Ray::new([0.0; 3], [1.0; 3], -1.0).is_none() && Ray::new([0.0; 3], [1.0; 3], f64::NAN).is_none());
    assert!(Ray::new([0.0; 3], [1e-300, 0.0, 1e-300], 1.0).is_some() && Ray::new([0.0; 3], [1e300; 3], 1.0).is_some());
}

#[test]
fn a_picker_keeps_within_its_memory() {
    let tree = Arc::new(cloud(6000, 300, 7));
    let (random, limit) = (&mut Random::new(7), 30_000);
    let mut picker = Picker::new(Arc::clone(&tree), limit);
    for _ in 0..300 {
        let ray = Ray::new(somewhere(&tree, random), direction(random), 0.5).unwrap();
        picker.pick(&ray).unwrap();
        assert!(picker.cached_bytes() <= limit, "{}", picker.cached_bytes());
    }
    assert!(picker.cached_bytes() > limit / 2);
}
