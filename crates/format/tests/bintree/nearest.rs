//! Nearest points across leaves against a look at every point.

use std::sync::Arc;

use pointmill_format::bintree::{Layout, NearestPoints};
use pointmill_testkit::Random;

use crate::util::{FAR, corridor, files_of, open, read_all};

#[test]
fn the_nearest_points_are_those_that_a_look_at_every_point_finds() {
    let random = &mut Random::new(11);
    for (n, capacity) in [(1, 4), (200, 7), (4000, 700)] {
        let files = files_of(&mut corridor(n, 200_000.0, n as u64), capacity, Layout::Packed, FAR);
        let tree = Arc::new(open(&files).unwrap());
        let points = read_all(&tree).unwrap();
        let mut nearest = [1 << 30, 0].map(|cache| NearestPoints::new(Arc::clone(&tree), cache));
        assert_eq!(nearest[0].leaf_boxes().size(), tree.leaves().count());
        for _ in 0..200 {
            let near = points[random.index(points.len())].0;
            let place = near.map(|v| v + random.between(-20.0, 20.0));
            let (count, limit) = ([1, 5, 40, 300][random.index(4)], [3.0, 30.0, f64::INFINITY][random.index(3)]);
            let squared = |p: [f64; 3]| (0..3).map(|a| (p[a] - place[a]).powi(2)).sum::<f64>();
            let mut expected: Vec<_> = points.iter().map(|p| (squared(p.0), p.2, p.3, p.1)).collect();
            expected.retain(|p| p.0 <= limit * limit);
            expected.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            expected.truncate(count);
            for nearest in &mut nearest {
                let found = nearest.nearest(place, count, limit).unwrap();
                let found: Vec<_> = found.iter().map(|p| (p.distance2, p.leaf, p.point, p.class)).collect();
                assert_eq!(found, expected);
            }
        }
    }
}

#[test]
fn an_empty_cloud_and_a_place_that_is_none_have_no_neighbours() {
    let tree = |n| Arc::new(open(&files_of(&mut corridor(n, 10.0, 1), 4, Layout::Files, FAR)).unwrap());
    assert_eq!(NearestPoints::new(tree(0), 1 << 20).nearest([0.0; 3], 3, f64::INFINITY).unwrap(), []);
    assert_eq!(NearestPoints::new(tree(9), 1 << 20).nearest([f64::NAN; 3], 3, f64::INFINITY).unwrap(), []);
    assert_eq!(NearestPoints::new(tree(9), 1 << 20).nearest([0.0; 3], 0, f64::INFINITY).unwrap(), []);
}
