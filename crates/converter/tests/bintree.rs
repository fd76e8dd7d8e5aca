//! Binary trees against a plain builder that holds everything in memory, and against themselves with other means.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use pointmill_converter::{
    AttributeChoice, BintreeSettings, ConvertError, Plan, Potree2Settings, Report, ScaleChoice, Silent, convert,
};
use pointmill_format::bintree::{Bintree, Layout, NodeKind, SplitRule};
use pointmill_format::{NodePoints, OpenOptions};
use pointmill_testkit::Random;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

/// Lattice integers (steps of 0.01) and classes.
type Points = Vec<([i64; 3], u8)>;

fn random(count: usize, seed: u64, shape: impl Fn([f64; 3]) -> [f64; 3]) -> Points {
    let mut random = Random::new(seed);
    let mut place = || shape([random.unit(), random.unit(), random.unit()]).map(|v| (v * 100.0).round() as i64);
    (0..count).map(|i| (place(), (i % 7) as u8)).collect()
}

fn write_text(path: &Path, points: &Points) {
    let line = |(q, c): &([i64; 3], u8)| {
        let [x, y, z] = q.map(|v| v as f64 / 100.0);
        format!("{x:.2} {y:.2} {z:.2} {c}\n")
    };
    fs::write(path, points.iter().map(line).collect::<String>()).unwrap();
}

fn plan(inputs: Vec<PathBuf>, out: PathBuf) -> Plan {
    let mut plan = Plan::new(inputs, out);
    plan.scale = ScaleChoice::Fixed(0.01);
    plan.name = "cloud".into();
    let columns = ["x", "y", "z", "c"].map(str::to_owned).to_vec();
    plan.open = OpenOptions::default().columns(columns);
    plan
}

fn make(dir: &Path, points: &Points, settings: BintreeSettings, task_points: Option<u64>) -> (PathBuf, Report) {
    let (scan, out) = (dir.join("scan.xyz"), dir.join("out"));
    write_text(&scan, points);
    let _ = fs::remove_dir_all(&out);
    let mut plan = plan(vec![scan], out.clone());
    plan.task_points = task_points;
    let report = convert(&plan, &[settings.into()], &Silent).unwrap();
    (out, report)
}

/// A node as the page says it must be: depth, count, axis and plane of an inner node, or the sorted points of a leaf.
#[derive(Debug, PartialEq)]
enum Expected {
    Inner { count: usize, axis: usize, m: i64 },
    Degenerate { count: usize },
    Leaf(Points),
}

/// The rules of docs/formats/bintree.md, section 6, with vectors and recursion.
fn reference(mut points: Points, capacity: usize, rule: SplitRule, depth: usize, out: &mut Vec<Expected>) {
    if points.len() <= capacity {
        points.sort_unstable();
        out.push(Expected::Leaf(points));
        return;
    }
    let span = |a: usize| {
        let (min, max) = (points.iter().map(|p| p.0[a]).min().unwrap(), points.iter().map(|p| p.0[a]).max().unwrap());
        (max - min, min, max)
    };
    let axis = (0..3).rev().max_by_key(|a| span(*a).0).unwrap();
    let (extent, min, max) = span(axis);
    if extent == 0 {
        points.sort_unstable_by_key(|p| f32::from(p.1).to_le_bytes()); // by the bytes of the record
        cut(&points, points.len().div_ceil(capacity), out);
        return;
    }
    let m = match if depth >= 64 { SplitRule::Median } else { rule } {
        SplitRule::Mean => {
            points.iter().map(|p| i128::from(p.0[axis])).sum::<i128>().div_euclid(points.len() as i128) as i64
        }
        SplitRule::Midpoint => (min + max).div_euclid(2),
        SplitRule::Median => {
            let mut values: Vec<i64> = points.iter().map(|p| p.0[axis]).collect();
            values.sort_unstable();
            let v = values[(values.len() - 1) / 2];
            if v == max { values.into_iter().rfind(|v| *v < max).unwrap() } else { v }
        }
    };
    out.push(Expected::Inner { count: points.len(), axis, m });
    let (low, high): (Points, Points) = points.into_iter().partition(|p| p.0[axis] <= m);
    reference(low, capacity, rule, depth + 1, out);
    reference(high, capacity, rule, depth + 1, out);
}

fn cut(points: &[([i64; 3], u8)], leaves: usize, out: &mut Vec<Expected>) {
    if leaves == 1 {
        let mut points = points.to_vec();
        points.sort_unstable();
        return out.push(Expected::Leaf(points));
    }
    out.push(Expected::Degenerate { count: points.len() });
    let low = leaves.div_ceil(2);
    let sizes = (0..leaves).map(|i| points.len() / leaves + usize::from(i < points.len() % leaves));
    let at = sizes.take(low).sum();
    cut(&points[..at], low, out);
    cut(&points[at..], leaves - low, out);
}

fn read(folder: &Path) -> Vec<Expected> {
    let tree = Bintree::open(folder).unwrap();
    let lattice = tree.header().lattice;
    let mut leaf = NodePoints::default();
    let mut nodes = Vec::new();
    for (i, node) in tree.nodes().iter().enumerate() {
        let count = node.count as usize;
        nodes.push(match node.kind {
            NodeKind::Inner { axis, split, .. } => {
                let m = lattice.quantize(usize::from(axis), split);
                assert_eq!(split, m as f64 * lattice.scale[0] + lattice.offset[0]);
                Expected::Inner { count, axis: usize::from(axis), m }
            }
            NodeKind::Degenerate { .. } => Expected::Degenerate { count },
            NodeKind::Leaf { .. } => {
                tree.read_leaf(i as u32, &mut leaf).unwrap();
                let at = |k: usize| [0, 1, 2].map(|a| lattice.quantize(a, leaf.world(k).unwrap()[a]));
                let mut points: Points =
                    (0..leaf.len()).map(|k| (at(k), leaf.column::<f32>("classification").unwrap()[k] as u8)).collect();
                points.sort_unstable();
                Expected::Leaf(points)
            }
        });
    }
    nodes
}

#[test]
fn the_tree_is_that_of_the_page_for_every_rule_and_shape() {
    let dir = tempfile::tempdir().unwrap();
    let clustered =
        |p: [f64; 3]| if p[0] < 0.5 { [p[0], p[1] * 3.0, 1.0] } else { [900.0 * p[0], -40.0 * p[1], p[2].powi(9)] };
    let clouds: [(&str, Points); 8] = [
        ("box", random(9000, 1, |p| [400.0 * p[0] - 200.0, 300.0 * p[1], 20.0 * p[2] * p[2]])),
        ("clusters", random(9000, 2, clustered)),
        ("outliers", random(3000, 3, |p| [2f64.powf(20.0 * p[0]) / 2f64.powi(4), p[1], p[2]])),
        ("one place", random(1234, 4, |_| [7.0, -5.0, 0.12])),
        ("two places", random(1500, 5, |p| [if p[0] < 0.1 { 1.0 } else { -3.0 }, 0.0, 0.0])),
        ("two places, most at the higher", random(1500, 8, |p| [0.0, if p[0] < 0.1 { -3.0 } else { 1.0 }, 0.0])),
        ("a line", random(2000, 6, |p| [0.0, 5.0, p[2] * 1e4])),
        ("one point", random(1, 7, |p| p)),
    ];
    for (name, points) in clouds {
        for split in [SplitRule::Mean, SplitRule::Median, SplitRule::Midpoint] {
            let settings = BintreeSettings { capacity: 100, split, ..BintreeSettings::default() };
            let mut expected = Vec::new();
            reference(points.clone(), 100, split, 0, &mut expected);
            // in memory, and divided on the disk down to 250 points before that
            for task_points in [None, Some(250)] {
                let (out, report) = make(dir.path(), &points, settings, task_points);
                assert_same_nodes(&read(&out), &expected, &format!("{name}, {}, {task_points:?}", split.name()));
                assert_eq!(
                    (report.outputs[0].points, report.checksum_in),
                    (points.len() as u64, report.outputs[0].checksum.clone()),
                    "{name}"
                );
            }
        }
    }
}

fn assert_same_nodes(found: &[Expected], expected: &[Expected], what: &str) {
    let differs = found.iter().zip(expected).position(|(f, e)| f != e);
    assert_eq!((differs, found.len()), (None, expected.len()), "{what}");
}

#[test]
fn planes_are_in_the_world_whatever_is_stored_and_whatever_the_offset() {
    let dir = tempfile::tempdir().unwrap();
    let settings = BintreeSettings { capacity: 100, ..BintreeSettings::default() };
    let near = random(2000, 31, |p| [90.0 * p[0], 50.0 * p[1], 20.0 * p[2]]);
    let expected = |points: Points| {
        let mut expected = Vec::new();
        reference(points, 100, SplitRule::Mean, 0, &mut expected);
        expected
    };
    // steps from 0 that 32 bits do not hold: records keep those from the middle
    let far: Points = near.iter().map(|([x, y, z], c)| ([x + 5_000_000_000, y - 7_000_000_000, *z], *c)).collect();
    // the lattice of a scan, whose corner is not a whole number of steps from 0
    let mut las = Las::numbered(near.iter().map(|(q, _)| q.map(|v| v as i32)));
    las.offset = [1234.005; 3];
    let scan = dir.path().join("scan.las");
    for task_points in [None, Some(250)] {
        let (out, _) = make(dir.path(), &far, settings, task_points);
        assert_same_nodes(&read(&out), &expected(far.clone()), "far");
        fs::write(&scan, las.bytes()).unwrap();
        let out = dir.path().join("las");
        let _ = fs::remove_dir_all(&out);
        let mut plan = Plan::new(vec![scan.clone()], out.clone());
        plan.task_points = task_points;
        convert(&plan, &[settings.into()], &Silent).unwrap();
        let numbered = las.points.iter().zip(&near).map(|(p, (q, _))| (*q, p.class)).collect();
        assert_same_nodes(&read(&out), &expected(numbered), "offset");
    }
}

#[test]
fn threads_memory_tasks_and_the_order_of_inputs_do_not_show_in_the_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let points = random(40_000, 11, |p| [500.0 * p[0] * p[0], 80.0 * p[1], (9.0 * p[2]).floor()]);
    let halves = points.split_at(17_000);
    let names = ["a.xyz", "b.xyz"].map(|n| dir.path().join(n));
    for layout in [Layout::Files, Layout::Packed] {
        for split in [SplitRule::Mean, SplitRule::Median] {
            let mut first: Option<BTreeMap<String, Vec<u8>>> = None;
            for (threads, task, swapped) in
                [(1, None, false), (3, Some(900), false), (2, Some(5000), true), (2, Some(1), false)]
            {
                let (a, b) = if swapped { (halves.1, halves.0) } else { halves };
                write_text(&names[0], &a.to_vec());
                write_text(&names[1], &b.to_vec());
                let out = dir.path().join("out");
                let _ = fs::remove_dir_all(&out);
                let settings = BintreeSettings { capacity: 700, layout, split };
                let mut plan = plan(names.to_vec(), out.clone());
                (plan.threads, plan.task_points) = (threads, task);
                if task == Some(1) {
                    plan.memory_bytes = 160 << 20;
                }
                convert(&plan, &[settings.into()], &Silent).unwrap();
                let files = dataset(&out);
                let count = if layout == Layout::Packed { 2 } else { 50 };
                assert!(files.len() >= count, "{}", files.len());
                match &first {
                    Some(first) => assert!(*first == files, "{threads} threads, tasks of {task:?} points"),
                    None => first = Some(files),
                }
            }
        }
    }
}

#[test]
fn beside_an_octree_from_one_read_it_is_the_same_tree() {
    let dir = tempfile::tempdir().unwrap();
    let points = random(30_000, 21, |p| [100.0 * p[0], 100.0 * p[1], p[2]]);
    let settings = BintreeSettings { capacity: 1000, ..BintreeSettings::default() };
    let (alone, _) = make(dir.path(), &points, settings, None);
    let both = dir.path().join("both");
    let mut plan = plan(vec![dir.path().join("scan.xyz")], both.clone());
    plan.task_points = Some(2000);
    let report = convert(&plan, &[Potree2Settings::default().into(), settings.into()], &Silent).unwrap();
    assert_eq!(dataset(&both.join("bintree")), dataset(&alone));
    assert_eq!(report.outputs.iter().map(|o| o.format.as_str()).collect::<Vec<_>>(), ["potree2", "bintree"]);
    assert!(both.join("potree2/metadata.json").is_file() && both.join("report.json").is_file());
}

#[test]
fn optional_columns_come_as_asked_and_duplicates_cannot_be_dropped_yet() {
    let dir = tempfile::tempdir().unwrap();
    let scan = dir.path().join("scan.csv");
    fs::write(&scan, "x,y,z,r,g,b,i\n1,2,3,10,20,30,500\n4,5,6,255,0,1,7\n").unwrap();
    let out = dir.path().join("out");
    let mut plan = Plan::new(vec![scan], out.clone());
    let tree = [BintreeSettings::default().into()];
    plan.attributes = AttributeChoice::List(vec!["rgba".into(), "intensity".into()]);
    let report = convert(&plan, &tree, &Silent).unwrap();
    assert_eq!(report.outputs[0].attributes, ["position", "rgba", "intensity"]);
    let leaf = fs::read(out.join("n.bin")).unwrap();
    assert_eq!((leaf.len(), &leaf[16..20], &leaf[20..22]), (48, &[10, 20, 30, 255][..], &500u16.to_le_bytes()[..]));
    plan.overwrite = true;
    plan.duplicates = pointmill_converter::Duplicates::Drop;
    assert!(matches!(convert(&plan, &tree, &Silent), Err(ConvertError::Unsupported(_))));
}
