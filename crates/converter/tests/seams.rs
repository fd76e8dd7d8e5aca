//! Samples keep their distance over the borders of nodes, whatever plane a surface lies on, and do not depend on memory or
//! threads.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use pointmill_converter::{Duplicates, Plan, Potree2Settings, Sampling, Silent, convert};
use pointmill_format::NodePoints;
use pointmill_format::potree2::{Dataset, Node};
use pointmill_testkit::Random;
use pointmill_testkit::files::{assert_same_dataset, dataset};
use pointmill_testkit::las::Las;

/// Two planes of ± 2 cm through the middle of a cube of 20 m: half of their points lie on either side of borders of nodes
/// of every level.
fn planes_on_borders(points: usize) -> Las {
    let mut random = Random::new(5);
    let corners = [[0, 0, 0], [2000, 2000, 2000]];
    Las::numbered(corners.into_iter().chain((2..points).map(|i| {
        let (u, v) = (random.below(2001) as i32, random.below(2001) as i32);
        let w = 998 + random.below(5) as i32;
        if i % 2 == 0 { [u, v, w] } else { [w, u, v] }
    })))
}

/// What nodes of a level draw: their number, and positions, each with that of its node.
#[derive(Default)]
struct Level {
    nodes: usize,
    points: Vec<([f64; 3], usize)>,
}

/// The inner nodes, by level; the spacing of the root.
fn drawn(folder: &Path) -> (Vec<Level>, f64) {
    let dataset = Dataset::open(folder).unwrap();
    let nodes: Vec<Node> = dataset.read_hierarchy().unwrap();
    let mut levels: Vec<Level> = Vec::new();
    for node in nodes.iter().filter(|n| nodes.iter().any(|c| c.key.parent() == Some(n.key))) {
        let mut points = NodePoints::default();
        dataset.read_points(node, &mut points).unwrap();
        let level = usize::from(node.key.level);
        levels.resize_with(levels.len().max(level + 1), Level::default);
        let Level { nodes, points: all } = &mut levels[level];
        all.extend((0..points.len()).map(|i| (points.world(i).unwrap(), *nodes)));
        *nodes += 1;
    }
    (levels, dataset.metadata().spacing)
}

/// Points that have another closer than `spacing`: in their node, and in others.
fn crowded(level: &Level, spacing: f64) -> [usize; 2] {
    let cell = |p: &[f64; 3]| p.map(|v| (v / spacing).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<&([f64; 3], usize)>> = HashMap::new();
    level.points.iter().for_each(|p| cells.entry(cell(&p.0)).or_default().push(p));
    let squared = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>();
    let mut found = [0, 0];
    for point in &level.points {
        let [x, y, z] = cell(&point.0);
        let around = (0..27).filter_map(|i| cells.get(&[x + i / 9 - 1, y + i / 3 % 3 - 1, z + i % 3 - 1]));
        let near =
            around.flatten().filter(|p| !std::ptr::eq(**p, point) && squared(&p.0, &point.0).sqrt() < spacing - 1e-6);
        let (mut own, mut others) = (false, false);
        near.for_each(|p| if p.1 == point.1 { own = true } else { others = true });
        found[0] += usize::from(own);
        found[1] += usize::from(others);
    }
    found
}

/// Converts with so many threads, and under so much memory.
fn converted(scan: &Path, out: &Path, sampling: Sampling, threads: usize, memory_bytes: u64) {
    let mut plan = Plan::new(vec![scan.to_path_buf()], out.to_path_buf());
    (plan.threads, plan.memory_bytes) = (threads, memory_bytes);
    let mut settings = Potree2Settings::default();
    (settings.sampling, settings.leaf_capacity) = (sampling, 2000);
    let report = convert(&plan, &[settings.into()], &Silent).unwrap();
    assert_eq!(report.outputs[0].points, 400_000);
    fs::remove_file(out.join("report.json")).unwrap();
}

#[test]
fn points_of_a_level_keep_their_distance_over_borders() {
    let dir = tempfile::tempdir().unwrap();
    let scan = dir.path().join("scan.las");
    fs::write(&scan, planes_on_borders(400_000).bytes()).unwrap();
    for sampling in [Sampling::Poisson, Sampling::Grid, Sampling::Random { seed: 7 }] {
        let (plenty, scarce) = (dir.path().join("plenty/out"), dir.path().join("scarce/out"));
        converted(&scan, &plenty, sampling, 2, 4 << 30);
        converted(&scan, &scarce, sampling, 1, 100 << 20);
        assert_same_dataset(&dataset(&scarce), &dataset(&plenty), "with other memory and threads");
        let (levels, spacing) = drawn(&plenty);
        assert!(levels.len() >= 4);
        for (number, level) in levels.iter().enumerate() {
            let [own, others] = crowded(level, spacing / 2f64.powi(number as i32));
            assert!(sampling != Sampling::Poisson || own == 0, "level {number}: {own}");
            // of an inner node that would have no point else
            assert!(
                others <= level.points.len() / 1000,
                "{sampling:?}, level {number}: {others} of {}",
                level.points.len()
            );
        }
        [plenty, scarce].iter().for_each(|out| fs::remove_dir_all(out).unwrap());
    }
}

#[test]
fn nodes_are_leaves_by_what_is_left_when_duplicates_are_dropped() {
    let dir = tempfile::tempdir().unwrap();
    let scan = dir.path().join("scan.las");
    let mut four_times = planes_on_borders(100_000);
    four_times.points = four_times.points.repeat(4);
    fs::write(&scan, four_times.bytes()).unwrap();
    let outs = [("plenty", 2, 4u64 << 30), ("scarce", 1, 100 << 20)].map(|(name, threads, memory_bytes)| {
        let out = dir.path().join(name).join("out");
        let mut plan = Plan::new(vec![scan.clone()], out.clone());
        (plan.threads, plan.memory_bytes, plan.duplicates) = (threads, memory_bytes, Duplicates::Drop);
        let report = convert(&plan, &[Potree2Settings::default().into()], &Silent).unwrap();
        assert!(report.outputs[0].points <= 100_000);
        let nodes = Dataset::open(&out).unwrap().read_hierarchy().unwrap();
        let points: Vec<(pointmill_format::NodeKey, u64)> =
            nodes.iter().map(|n| (n.key, u64::from(n.record.points))).collect();
        for (key, _) in points.iter().filter(|(key, _)| nodes.iter().any(|n| n.key.parent() == Some(*key))) {
            let below = points.iter().filter(|(k, _)| k.ancestor(key.level) == Some(*key)).map(|(_, n)| n);
            assert!(below.sum::<u64>() > 20_000 - 2000, "{key:?} is divided");
        }
        fs::remove_file(out.join("report.json")).unwrap();
        out
    });
    assert_same_dataset(&dataset(&outs[1]), &dataset(&outs[0]), "with other memory and threads");
}
