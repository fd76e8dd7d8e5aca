//! COPC files as other programs see them: plain LAZ that says what it holds.

use std::fs;
use std::path::Path;

use las::Reader;
use pointmill_converter::{CopcSettings, Outliers, Plan, Report, Silent, convert};
use pointmill_format::octree::OctreeNodes;
use pointmill_format::{NodeKey, NodePoints, open_octree};
use pointmill_testkit::files::fixture;
use pointmill_testkit::las::{Las, Point};

fn written(scan: &Path, folder: &Path) -> Report {
    let mut plan = Plan::new(vec![scan.to_path_buf()], folder.join("out"));
    (plan.overwrite, plan.threads, plan.outliers) = (true, 2, Outliers::Keep);
    convert(&plan, &[CopcSettings { leaf_capacity: 60, ..CopcSettings::default() }.into()], &Silent).unwrap()
}

/// All of a point that the crate `las` decodes but for z, in an order: heights of the fixtures have all of 32 bits, which takes
/// a coarser step.
fn points(path: &Path) -> Vec<String> {
    let mut reader = Reader::from_path(path).unwrap();
    let flat = |mut point: las::Point| {
        point.z = 0.0;
        format!("{point:?}")
    };
    let mut points: Vec<String> = reader.read_all().unwrap().points().map(|point| flat(point.unwrap())).collect();
    points.sort_unstable();
    points
}

#[test]
fn another_reader_finds_every_point_with_all_it_has() {
    for name in ["format6.las", "format7.laz", "format8.las"] {
        let scan = fixture(&format!("las/{name}"));
        let dir = tempfile::tempdir().unwrap();
        let report = written(&scan, dir.path());
        let file = dir.path().join("out/points.copc.laz");
        let (found, expected) = (points(&file), points(&scan));
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!(found, expected, "{name}");
        }
        assert_eq!(report.outputs[0].bytes, fs::metadata(&file).unwrap().len());
    }
}

#[test]
fn points_of_a_node_are_in_the_order_of_time() {
    let dir = tempfile::tempdir().unwrap();
    let mut las = Las::terrain(3_000, 3);
    for (i, point) in las.points.iter_mut().enumerate() {
        point.gps_time = [5.0, -3.5, 0.25, -0.0, 1e9][i % 5] * (i % 700) as f64;
    }
    fs::write(dir.path().join("a.las"), las.bytes()).unwrap();
    written(&dir.path().join("a.las"), dir.path());
    let octree = open_octree(dir.path().join("out")).unwrap();
    let mut nodes = OctreeNodes::new(&*octree).unwrap();
    let (mut stack, mut points, mut count) = (vec![NodeKey::ROOT], NodePoints::default(), 0);
    while let Some(key) = stack.pop() {
        nodes.load(&*octree, key).unwrap();
        stack.extend(nodes.children(key).map(|child| child.key));
        octree.points(nodes.get(key).unwrap(), &mut points).unwrap();
        assert!(points.column::<f64>("gps-time").unwrap().is_sorted(), "{key}");
        count += points.len();
    }
    assert_eq!((count, nodes.len() > 10), (3_000, true));
}

#[test]
fn the_header_says_what_is_there() {
    let dir = tempfile::tempdir().unwrap();
    let las = Las::terrain(3_000, 3);
    fs::write(dir.path().join("a.las"), las.bytes()).unwrap();
    written(&dir.path().join("a.las"), dir.path());
    let reader = Reader::from_path(dir.path().join("out/points.copc.laz")).unwrap();
    let header = reader.header();
    assert_eq!(header.number_of_points(), 3_000);
    assert_eq!(header.number_of_points_by_return(1), Some(3_000));
    let [min, max] = las.bounds();
    let bounds = header.bounds();
    assert_eq!([bounds.min.x, bounds.min.y, bounds.min.z], min);
    assert_eq!([bounds.max.x, bounds.max.y, bounds.max.z], max);
    assert_eq!(header.point_format().to_u8().unwrap(), 7);
    let info = &header.vlrs()[0];
    assert_eq!((info.user_id.as_str(), info.record_id), ("copc", 1));
}

#[test]
fn integers_beyond_32_bits_get_another_zero_and_come_back() {
    let dir = tempfile::tempdir().unwrap();
    let scan = |name: &str, offset: f64| {
        let mut las = Las::new((0..100).map(|i| Point::numbered(i, [i as i32 * 7, i as i32, 5])).collect());
        (las.scale, las.offset) = ([0.001; 3], [offset, 0.0, 0.0]);
        fs::write(dir.path().join(name), las.bytes()).unwrap();
        dir.path().join(name)
    };
    // the lattice of the run begins where the first scan does
    let inputs = vec![scan("a.las", 5_000_000.0), scan("b.las", 5_000_100.0)];
    let mut plan = Plan::new(inputs, dir.path().join("out"));
    plan.threads = 1;
    let report = convert(&plan, &[CopcSettings::default().into()], &Silent).unwrap();
    let mut reader = Reader::from_path(dir.path().join("out/points.copc.laz")).unwrap();
    let mut x: Vec<i64> = reader.read_all().unwrap().points().map(|p| (p.unwrap().x * 1000.0).round() as i64).collect();
    x.sort_unstable();
    let mut expected: Vec<i64> = (0..100).flat_map(|i| [5_000_000_000 + i * 7, 5_000_100_000 + i * 7]).collect();
    expected.sort_unstable();
    assert_eq!(x, expected);
    assert_eq!(report.outputs[0].points, 200);
}

#[test]
fn a_cloud_without_points_and_one_of_a_single_point_are_files() {
    let dir = tempfile::tempdir().unwrap();
    let las = Las::numbered([[4, 5, 6]]);
    fs::write(dir.path().join("a.las"), las.bytes()).unwrap();
    let report = written(&dir.path().join("a.las"), dir.path());
    assert_eq!(report.outputs[0].tree.nodes, 1);
    assert_eq!(points(&dir.path().join("out/points.copc.laz")).len(), 1);
}
