//! Octrees of several formats that are built of one tree have the bytes of those that are built alone.

use std::fs;
use std::path::Path;

use pointmill_converter::{
    AttributeChoice, Encoding, Outliers, Plan, Potree1Settings, Potree1Version, Potree2Settings, Report, Silent,
    Target, convert,
};
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
            let targets: [Target; 2] = [other.into(), potree1(capacity).into()];
            let mut alone = Vec::new();
            for target in &targets {
                convert(&plan, std::slice::from_ref(target), &Silent).unwrap();
                alone.push(dataset(&plan.output));
            }
            for (threads, mib) in [(1, 1024), (2, 1024), (2, 200)] {
                (plan.threads, plan.memory_bytes) = (threads, mib << 20);
                let report = convert(&plan, &targets, &Silent).unwrap();
                assert_eq!(built_with(&report), [&["potree1".to_owned()][..], &["potree2".to_owned()]]);
                for (folder, alone) in ["potree2", "potree1"].iter().zip(&alone) {
                    assert_same_dataset(&dataset(&plan.output.join(folder)), alone, folder);
                }
                assert_eq!(report.outputs[0].checksum, report.outputs[1].checksum);
            }
        }
    }
}

#[test]
fn formats_whose_trees_differ_are_built_apart() {
    let dir = tempfile::tempdir().unwrap();
    let plan = plan(dir.path(), &dense_corner(5_000));
    let spaced = Potree1Settings { spacing: Some(90.0), ..potree1(300) };
    let limited = Potree1Settings { max_node_points: Some(200), ..potree1(300) };
    for other in [potree1(400), spaced, limited] {
        let report = convert(&plan, &[potree2(300).into(), other.into()], &Silent).unwrap();
        assert_eq!(built_with(&report), [&[][..], &[]]);
    }
}
