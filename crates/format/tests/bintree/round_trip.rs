//! What is written reads back, and is the tree that the page describes, whatever the points are like.

use pointmill_format::bintree::{Bintree, Layout, NodeKind, SplitRule};
use pointmill_format::{Aabb, Lattice};
use pointmill_testkit::Random;

use crate::build::{Builder, Point, header};
use crate::util::{FAR, class_of, corridor, files_of, open, read_all};

/// Checks boxes, counts, axes and planes of a dataset whose integers are certain, from its bytes alone; returns the
/// integers of all points and their classes, sorted.
fn check(tree: &Bintree) -> Vec<([i64; 3], u32)> {
    let lattice = tree.header().lattice;
    let all = read_all(tree).unwrap();
    let quantize = |p: [f64; 3]| [0, 1, 2].map(|a| lattice.quantize(a, p[a]));
    for (index, node) in (0u32..).zip(tree.nodes()) {
        let end = tree.children(index).map_or(index + 1, |_| end_of(tree, index));
        let below: Vec<[f64; 3]> = all.iter().filter(|p| (index..end).contains(&p.2)).map(|p| p.0).collect();
        assert_eq!(node.count, below.len() as u64, "node {index}");
        let mut bounds = Aabb::EMPTY;
        below.iter().for_each(|p| bounds.grow(*p));
        assert_eq!(node.bounds, bounds, "node {index}");
        let qs: Vec<[i64; 3]> = below.iter().map(|p| quantize(*p)).collect();
        let extent = [0, 1, 2].map(|a| {
            let (min, max) = (qs.iter().map(|q| q[a]).min().unwrap(), qs.iter().map(|q| q[a]).max().unwrap());
            (max - min) as f64 * lattice.scale[a]
        });
        match node.kind {
            NodeKind::Leaf { .. } => assert!(node.count <= tree.header().capacity),
            NodeKind::Degenerate { .. } => assert_eq!(extent, [0.0; 3]),
            NodeKind::Inner { axis, split, high } => {
                let axis = axis as usize;
                assert!(node.count > tree.header().capacity);
                assert!(extent.iter().all(|e| *e <= extent[axis]) && extent[..axis].iter().all(|e| *e < extent[axis]));
                let m = lattice.quantize(axis, split);
                assert_eq!(m as f64 * lattice.scale[axis] + lattice.offset[axis], split);
                let side = |range: std::ops::Range<u32>, low: bool| {
                    let points = all.iter().filter(|p| range.contains(&p.2));
                    points.for_each(|p| assert_eq!(quantize(p.0)[axis] <= m, low));
                };
                side(index + 1..high, true);
                side(high..end, false);
                if tree.header().split == SplitRule::Mean && tree.path(index).len() < 64 {
                    let sum: i128 = qs.iter().map(|q| i128::from(q[axis])).sum();
                    assert_eq!(sum.div_euclid(qs.len() as i128), i128::from(m));
                }
            }
        }
    }
    let mut points: Vec<_> = all.iter().map(|p| (quantize(p.0), p.1 as u32)).collect();
    points.sort_unstable();
    points
}

/// The index behind the last node below `index`.
fn end_of(tree: &Bintree, mut index: u32) -> u32 {
    while let Some([_, high]) = tree.children(index) {
        index = high;
    }
    index + 1
}

fn sources(points: &[Point]) -> Vec<([i64; 3], u32)> {
    let mut sources: Vec<_> = points.iter().map(|p| (p.q.map(i64::from), class_of(p.id) as u32)).collect();
    sources.sort_unstable();
    sources
}

#[test]
fn a_corridor_comes_back_to_the_last_millimetre_under_every_rule_and_layout() {
    let mut points = corridor(4000, 300_000.0, 1);
    let expected = sources(&points);
    for split in [SplitRule::Mean, SplitRule::Median, SplitRule::Midpoint] {
        for layout in [Layout::Files, Layout::Packed] {
            let mut header = header(4000, 150, layout, FAR);
            header.split = split;
            let files = Builder { header, class: &class_of, extras: &|_, _| {} }.files(&mut points);
            let tree = open(&files).unwrap();
            assert_eq!(check(&tree), expected, "{split:?} {layout:?}");
            assert!(tree.leaves().count() > 25);
        }
    }
}

#[test]
fn a_folder_reads_as_memory_does() {
    let mut points = corridor(500, 100_000.0, 2);
    for layout in [Layout::Files, Layout::Packed] {
        let files = files_of(&mut points, 60, layout, FAR);
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, bytes)| std::fs::write(folder.path().join(name), bytes).unwrap());
        let tree = Bintree::open(folder.path()).unwrap();
        assert_eq!(read_all(&tree).unwrap(), read_all(&open(&files).unwrap()).unwrap());
    }
}

fn at(qs: impl IntoIterator<Item = [i32; 3]>) -> Vec<Point> {
    (0..).zip(qs).map(|(id, q)| Point { q, id }).collect()
}

fn opened(points: &mut [Point], capacity: u64) -> Bintree {
    open(&files_of(points, capacity, Layout::Packed, FAR)).unwrap()
}

#[test]
fn extreme_clouds_come_back_too() {
    let clouds = [
        ("one point", at([[7, -7, 0]])),
        ("all equal", at(std::iter::repeat_n([5, -6, 7], 100))),
        ("two values", at((0..90).map(|i| [i32::from(i % 3 == 0), 4, 4]))),
        ("two values far apart", at((0..90).map(|i| [if i < 89 { -8_000_000 } else { 8_000_000 }, 4, 4]))),
        ("no extent in y", at((0..80).map(|i| [i * 13 % 80, 9, i * 7 % 80]))),
        ("a diagonal: equal extents", at((0..80).map(|i| [i, i, i]))),
        ("negative", at((0..80).map(|i| [-i * 1000, -i * i, -5]))),
        ("many of one, few of others", at((0..300).map(|i| [i32::max(i - 290, 0), 0, 0]))),
    ];
    for (name, mut points) in clouds {
        for capacity in [1, 2, 7, 1000] {
            let tree = opened(&mut points, capacity);
            assert_eq!(check(&tree), sources(&points), "{name}, {capacity}");
        }
    }
}

#[test]
fn an_empty_cloud_has_no_nodes_and_no_hits() {
    for layout in [Layout::Files, Layout::Packed] {
        let tree = open(&files_of(&mut [], 10, layout, FAR)).unwrap();
        assert_eq!((tree.nodes().len(), tree.leaves().count(), tree.header().points), (0, 0, 0));
        assert_eq!(tree.draw_list([0.0; 3], 1.0, None), []);
    }
}

#[test]
fn points_at_one_place_are_cut_into_runs_of_equal_length() {
    let tree = opened(&mut at(std::iter::repeat_n([5, 5, 5], 23)), 5);
    let counts: Vec<u64> = tree.leaves().map(|l| tree.nodes()[l as usize].count).collect();
    assert_eq!(counts, [5, 5, 5, 4, 4]);
    let paths: Vec<String> = tree.leaves().map(|l| tree.leaf_name(l)).collect();
    assert_eq!(paths, ["n000.bin", "n001.bin", "n01.bin", "n10.bin", "n11.bin"]);
}

/// Doubling distances: each mean leaves all but the last few on its low side.
#[test]
fn geometric_outliers_end_in_medians_below_depth_64() {
    let mut points = at((0..2000).map(|i| [1 << (i % 31), i % 31, 0]));
    let tree = opened(&mut points, 1);
    let deepest = tree.leaves().map(|leaf| tree.path(leaf).len()).max().unwrap();
    assert!(deepest < 128, "{deepest}");
    // The integers of leaves beyond 32 km are not certain, so only the rest is checked.
    assert_eq!(read_all(&tree).unwrap().len(), 2000);
}

#[test]
fn leaves_of_10_and_16_km_keep_every_millimetre() {
    for length in [10_000_000, 16_000_000, 32_000_000] {
        let random = &mut Random::new(length as u64);
        let mut points = at((0..3000).map(|_| [random.index(length + 1) as i32, random.index(9000) as i32, 0]));
        points.extend([Point { q: [0; 3], id: 3000 }, Point { q: [length as i32, 0, 0], id: 3001 }]);
        let tree = opened(&mut points, 65_000);
        assert_eq!(tree.nodes().len(), 1);
        assert_eq!(check(&tree), sources(&points), "{length} mm");
    }
}

#[test]
fn a_leaf_of_the_greatest_extent_keeps_its_bound() {
    let random = &mut Random::new(3);
    let lattice = Lattice { scale: [0.001; 3], offset: [-1.0e6; 3] };
    let mut points = at((0..3000).map(|_| [0; 3].map(|_| random.next_u64() as i32)));
    let tree = open(&files_of(&mut points, 65_000, Layout::Files, lattice)).unwrap();
    let mut found: Vec<[f64; 3]> = read_all(&tree).unwrap().into_iter().map(|p| p.0).collect();
    let mut expected: Vec<[f64; 3]> = points.iter().map(|p| lattice.world(p.q.map(i64::from))).collect();
    for all in [&mut found, &mut expected] {
        all.sort_by(|a, b| a[0].total_cmp(&b[0])); // x hardly ever comes twice
    }
    // Half extent 2^31 mm = 2,147,484 m: floor(log2) is 21.
    let (bound, mut worst) = (2f64.powi(21 - 24), 0.0_f64);
    for (f, e) in found.iter().zip(&expected) {
        worst = [0, 1, 2].iter().fold(worst, |w, &a| w.max((f[a] - e[a]).abs()));
    }
    assert!(worst <= bound + 1e-9 && worst > bound / 2.0, "{worst} of {bound}");
}

#[test]
fn classes_that_are_not_numbers_are_never_classified() {
    let class = |id: u32| [f64::NAN, f64::INFINITY, 6.0, 1e300][id as usize % 4];
    let mut points = at((0..40).map(|i| [i, 0, 0]));
    let header = header(40, 10, Layout::Packed, FAR);
    let tree = open(&Builder { header, class: &class, extras: &|_, _| {} }.files(&mut points)).unwrap();
    let classes: Vec<f32> = read_all(&tree).unwrap().into_iter().map(|p| p.1).collect();
    assert_eq!(classes.iter().filter(|c| **c == 6.0).count(), 10);
    assert_eq!(classes.iter().filter(|c| c.to_bits() == 0).count(), 30);
}
