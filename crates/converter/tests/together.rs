//! Octrees of several formats that are built of one tree have the bytes of those that are built alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use pointmill_converter::{
    AttributeChoice, CopcSettings, Encoding, Outliers, Plan, Potree1Settings, Potree1Version, Potree2Settings, Report,
    Silent, Target, convert,
};
use pointmill_format::octree::OctreeNodes;
use pointmill_format::{NodeKey, NodePoints, open_octree};
use pointmill_testkit::Random;
use pointmill_testkit::files::{assert_same_dataset, dataset};
use pointmill_testkit::las::Las;

fn plan(folder: &Path, las: &Las) -> Plan {
    let scan = folder.join("scan.las");
    fs::write(&scan, las.bytes()).unwrap();
    let mut plan = Plan::new(vec![scan], folder.join("out"));
    (plan.overwrite, plan.threads, plan.outliers) = (true, 2, Outliers::Keep);
    plan.attributes = AttributeChoice::All; // records are the same, whatever is made of them
    plan
}

fn potree1(leaf_capacity: u32) -> Potree1Settings {
    Potree1Settings { leaf_capacity, version: Potree1Version::V1_8, ..Potree1Settings::default() }
}

fn potree2(leaf_capacity: u32) -> Potree2Settings {
    Potree2Settings { leaf_capacity, ..Potree2Settings::default() }
}

fn copc(leaf_capacity: u32) -> CopcSettings {
    CopcSettings { leaf_capacity, ..CopcSettings::default() }
}

fn packed(leaf_capacity: u32) -> Potree2Settings {
    Potree2Settings { encoding: Encoding::Brotli { quality: 3 }, ..potree2(leaf_capacity) }
}

/// Ever more points towards a corner, so that few nodes have many levels; some share a place.
fn dense_corner(points: usize) -> Las {
    let mut random = Random::new(11);
    Las::numbered((0..points).map(|i| [0; 3].map(|_: i32| random.below(16 << (i % 11)) as i32)))
}

/// A scan most of whose points share one place: too many for one node in memory.
fn crowded() -> Las {
    let mut random = Random::new(5);
    let other = |random: &mut Random| [0; 3].map(|_: i32| random.below(1 << 20) as i32);
    Las::numbered((0..250_000).map(|i| if i % 5 > 0 { [777; 3] } else { other(&mut random) }))
}

fn built_with(report: &Report) -> Vec<&[String]> {
    report.outputs.iter().map(|output| &output.built_with[..]).collect()
}

#[test]
fn formats_built_together_have_the_bytes_of_each_alone() {
    for (las, capacity) in [(dense_corner(40_000), 300), (crowded(), 20_000), (Las::numbered([[1, 2, 3]]), 10)] {
        let dir = tempfile::tempdir().unwrap();
        let mut plan = plan(dir.path(), &las);
        for other in [potree2(capacity), packed(capacity)] {
            let targets: [Target; 3] = [other.into(), potree1(capacity).into(), copc(capacity).into()];
            let mut alone = Vec::new();
            for target in &targets {
                convert(&plan, std::slice::from_ref(target), &Silent).unwrap();
                alone.push(dataset(&plan.output));
            }
            for (threads, mib) in [(1, 1024), (2, 1024), (2, 400)] {
                (plan.threads, plan.memory_bytes) = (threads, mib << 20);
                let report = convert(&plan, &targets, &Silent).unwrap();
                assert_eq!(built_with(&report)[0], ["potree1", "copc"]);
                for (folder, alone) in ["potree2", "potree1", "copc"].iter().zip(&alone) {
                    assert_same_dataset(&dataset(&plan.output.join(folder)), alone, folder);
                }
                assert!(report.outputs.iter().all(|o| o.checksum == report.outputs[0].checksum));
            }
        }
    }
}

#[test]
fn formats_whose_trees_differ_are_built_apart() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan(dir.path(), &dense_corner(5_000));
    let spaced = Potree1Settings { spacing: Some(5.0), ..potree1(300) };
    let limited = Potree1Settings { max_node_points: Some(200), ..potree1(300) };
    for other in [potree1(400), spaced, limited] {
        let report = convert(&plan, &[potree2(300).into(), other.into()], &Silent).unwrap();
        assert_eq!(built_with(&report), [&[][..] as &[String], &[]]);
    }
}

/// Steps of the lattice of the scan, intensity, point source, GPS time.
type Row = ([i64; 3], u16, u16, u64);

/// The points of all nodes, each in order.
fn points_of_nodes(folder: &Path, las: &Las) -> BTreeMap<NodeKey, Vec<Row>> {
    let octree = open_octree(folder).unwrap();
    let mut nodes = OctreeNodes::new(&*octree).unwrap();
    let (mut found, mut stack, mut points) = (BTreeMap::new(), vec![NodeKey::ROOT], NodePoints::default());
    while let Some(key) = stack.pop() {
        nodes.load(&*octree, key).unwrap();
        stack.extend(nodes.children(key).map(|child| child.key));
        octree.points(nodes.get(key).unwrap(), &mut points).unwrap();
        let (intensity, source) = (points.column::<u16>("intensity").unwrap(), points.column::<u16>("point source id"));
        let (source, time) = (source.unwrap(), points.column::<f64>("gps-time").unwrap());
        let row = |i: usize| {
            let world = points.world(i).unwrap();
            let q = std::array::from_fn(|a| ((world[a] - las.offset[a]) / las.scale[a]).round() as i64);
            (q, intensity[i], source[i], time[i].to_bits())
        };
        let mut rows: Vec<Row> = (0..points.len()).map(row).collect();
        rows.sort_unstable();
        found.insert(key, rows);
    }
    found
}

#[test]
fn three_formats_have_the_same_points_in_the_same_nodes_those_of_the_scan() {
    let las = dense_corner(8_000);
    let dir = tempfile::tempdir().unwrap();
    let plan = plan(dir.path(), &las);
    let report = convert(&plan, &[potree2(50).into(), potree1(50).into(), copc(50).into()], &Silent).unwrap();
    let each = ["potree2", "potree1", "copc"].map(|format| points_of_nodes(&plan.output.join(format), &las));
    assert!(each[0].keys().any(|key| key.level > 5) && each[0].values().all(|rows| !rows.is_empty()));
    assert!(each[1] == each[0] && each[2] == each[0]);
    assert!(report.outputs.iter().all(|o| o.tree.nodes == each[0].len() as u64));
    let mut all: Vec<Row> = each[2].values().flatten().copied().collect();
    let row = |p: &pointmill_testkit::las::Point| (p.xyz.map(i64::from), p.intensity, p.source, p.gps_time.to_bits());
    let mut expected: Vec<Row> = las.points.iter().map(row).collect();
    all.sort_unstable();
    expected.sort_unstable();
    assert!(all == expected);
}
