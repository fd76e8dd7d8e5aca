//! Potree 1 octrees hold what Potree 2.0 octrees do, in a file for each node.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use pointmill_converter::{
    Advice, AttributeChoice, Duplicates, Outliers, Plan, Potree1Settings, Potree1Version, Potree2Settings, Report,
    ScaleChoice, Silent, convert,
};
use pointmill_format::batches::eight_bit;
use pointmill_format::bytes::{Archive, ByteSource as _};
use pointmill_format::octree::OctreeNodes;
use pointmill_format::potree1::Dataset;
use pointmill_format::{NodeKey, NodePoints, open_octree};
use pointmill_testkit::Random;
use pointmill_testkit::files::{assert_same_dataset, dataset};
use pointmill_testkit::las::{Las, Point};

/// A scan in a folder of its own, and where it is converted to.
struct Bench {
    dir: tempfile::TempDir,
    plan: Plan,
}

impl Bench {
    fn new(las: &Las) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let scan = dir.path().join("scan.las");
        fs::write(&scan, las.bytes()).unwrap();
        let mut plan = Plan::new(vec![scan], dir.path().join("out"));
        (plan.overwrite, plan.threads, plan.outliers) = (true, 2, Outliers::Keep);
        Self { dir, plan }
    }

    fn out(&self) -> std::path::PathBuf {
        self.dir.path().join("out")
    }

    fn convert(&self, settings: Potree1Settings) -> Report {
        convert(&self.plan, &[settings.into()], &Silent).unwrap()
    }

    /// With a Potree 2.0 octree.
    fn convert_both(&self, settings: Potree1Settings) -> Report {
        let Potree1Settings { sampling, spacing, leaf_capacity, .. } = settings;
        let other = Potree2Settings { sampling, spacing, leaf_capacity, ..Potree2Settings::default() };
        convert(&self.plan, &[settings.into(), other.into()], &Silent).unwrap()
    }
}

fn leaves_of(points: u32) -> Potree1Settings {
    Potree1Settings { leaf_capacity: points, ..Potree1Settings::default() }
}

/// Ever more points towards a corner, so that few nodes have many levels; some share a place.
fn dense_corner(points: usize) -> Las {
    let mut random = Random::new(11);
    Las::numbered((0..points).map(|i| [0; 3].map(|_: i32| random.below(16 << (i % 11)) as i32)))
}

/// Steps of the lattice of a scan, and a colour of 8 bits.
type Coloured = ([i64; 3], [u8; 3]);

/// The points of all nodes, each in order.
fn points_of_nodes(folder: &Path, las: &Las) -> BTreeMap<NodeKey, Vec<Coloured>> {
    let octree = open_octree(folder).unwrap();
    let mut nodes = OctreeNodes::new(&*octree).unwrap();
    let (mut found, mut stack, mut points) = (BTreeMap::new(), vec![NodeKey::ROOT], NodePoints::default());
    while let Some(key) = stack.pop() {
        nodes.load(&*octree, key).unwrap();
        stack.extend(nodes.children(key).map(|child| child.key));
        octree.points(nodes.get(key).unwrap(), &mut points).unwrap();
        let colours = points.column::<u16>("rgb").unwrap().as_chunks::<3>().0;
        let quantized = |i: usize| {
            let world = points.world(i).unwrap();
            std::array::from_fn(|a| ((world[a] - las.offset[a]) / las.scale[a]).round() as i64)
        };
        let mut of_node: Vec<_> = (0..points.len()).map(|i| (quantized(i), colours[i].map(eight_bit))).collect();
        of_node.sort_unstable();
        found.insert(key, of_node);
    }
    found
}

#[test]
fn both_octrees_have_the_same_points_in_the_same_nodes() {
    let las = dense_corner(6000);
    for duplicates in [Duplicates::Keep, Duplicates::Drop] {
        let mut bench = Bench::new(&las);
        bench.plan.duplicates = duplicates;
        // with other attributes in each, the duplicates would not be the same
        bench.plan.attributes = AttributeChoice::List(vec!["rgb".into()]);
        let report = bench.convert_both(leaves_of(30));
        let [one, two] = ["potree1", "potree2"].map(|format| points_of_nodes(&bench.out().join(format), &las));
        assert!(one.keys().any(|key| key.level > 5), "no nested folder");
        assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>());
        assert!(one == two);
        assert_eq!(report.outputs[0].checksum, report.outputs[1].checksum);
        assert_eq!(report.outputs[0].tree.nodes, one.len() as u64);
        let all: usize = one.values().map(Vec::len).sum();
        assert_eq!(report.outputs[0].points, all as u64);
    }
}

#[test]
fn every_node_has_its_file_and_every_count_is_true() {
    let bench = Bench::new(&dense_corner(6000));
    bench.convert(leaves_of(30));
    let octree = Dataset::open(bench.out()).unwrap();
    let nodes = octree.read_hierarchy().unwrap();
    let mut expected: BTreeSet<String> = ["cloud.js".to_owned()].into();
    for node in &nodes {
        assert_eq!(octree.count(node.key).unwrap(), node.declared, "{}", node.key);
        assert!(node.declared > 0);
        expected.insert(octree.metadata().node_file(node.key));
        if node.key == NodeKey::ROOT || node.key.level.is_multiple_of(5) && node.child_mask != 0 {
            expected.insert(octree.metadata().index_file(node.key));
        }
    }
    assert_eq!(nodes.iter().map(|node| node.declared).sum::<u64>(), 6000);
    assert_eq!(octree.metadata().points, Some(6000));
    let there: BTreeSet<String> = dataset(&bench.out()).into_keys().collect();
    assert_eq!(there, expected);
    assert!(expected.iter().filter(|name| name.ends_with(".hrc")).count() > 1);
}

#[test]
fn no_node_has_more_points_than_were_asked_for_whatever_the_memory() {
    // a cube that is full, so that inner nodes have very many points, and more than one thread builds alone
    let las = box_of([400; 3], [0.01; 3], 500_000);
    let bench = Bench::new(&las);
    let settings = Potree1Settings { max_node_points: Some(3000), ..Potree1Settings::default() };
    let without = bench.convert(Potree1Settings::default());
    assert!(without.outputs[0].tree.points_per_level[0] > 20_000);
    let [plenty, scarce] = [(2, 4 << 30), (1, 100 << 20)].map(|(threads, memory_bytes)| {
        let plan = Plan { threads, memory_bytes, ..bench.plan.clone() };
        let report = convert(&plan, &[settings.into()], &Silent).unwrap();
        assert!(!report.warnings.iter().any(|w| w.kind() == "crowded_nodes"), "{:?}", report.warnings);
        dataset(&plan.output)
    });
    assert_same_dataset(&scarce, &plenty, "with other memory and threads");
    let found = points_of_nodes(&bench.out(), &las);
    assert!(found.values().all(|points| (1..=3000).contains(&points.len())));
    assert!(found[&NodeKey::ROOT].len() == 3000);
    let mut all: Vec<_> = found.into_values().flatten().collect();
    let mut meant: Vec<_> = las.points.iter().map(|p| (p.xyz.map(i64::from), p.rgb.map(eight_bit))).collect();
    all.sort_unstable();
    meant.sort_unstable();
    assert!(all == meant);
}

#[test]
fn threads_and_memory_do_not_show() {
    let bench = Bench::new(&Las::terrain(400_000, 3));
    let [plenty, scarce] = [(2, 4 << 30), (1, 100 << 20)].map(|(threads, memory_bytes)| {
        let plan = Plan { threads, memory_bytes, ..bench.plan.clone() };
        convert(&plan, &[leaves_of(2000).into()], &Silent).unwrap();
        dataset(&plan.output)
    });
    assert_same_dataset(&scarce, &plenty, "with other memory and threads");
}

/// Random points of that extent in steps.
fn box_of(extent: [u32; 3], scale: [f64; 3], points: usize) -> Las {
    let mut random = Random::new(7);
    let random = (0..points).map(|_| extent.map(|e| random.below(u64::from(e) + 1) as i32));
    let corners = [[0; 3], extent.map(|e| e as i32)];
    Las { scale, offset: [0.0; 3], ..Las::numbered(corners.into_iter().chain(random)) }
}

#[test]
fn integers_come_back_from_every_lattice_and_extent_and_errors_are_those_of_the_report() {
    let largest = i32::MAX as u32 - 2;
    for (extent, scale) in [
        ([0; 3], [0.001; 3]),
        ([900; 3], [0.01; 3]),
        ([100_000, 70_000, 3_000], [0.001; 3]),
        ([1 << 29; 3], [0.001; 3]),
        ([1 << 30, 1 << 29, 5], [0.001; 3]),
        ([largest, 9, 1 << 30], [0.001; 3]),
        ([50_000, 6000, 1_000], [0.001, 0.002, 0.0005]),
        ([50_000, 6000, 1_000], [0.001, 0.003, 0.0007]),
    ] {
        let las = box_of(extent, scale, 3000);
        let bench = Bench::new(&las);
        let report = bench.convert(leaves_of(100));
        let mut found: Vec<[i64; 3]> =
            points_of_nodes(&bench.out(), &las).into_values().flatten().map(|(q, _)| q).collect();
        let mut meant: Vec<[i64; 3]> = las.points.iter().map(|p| p.xyz.map(i64::from)).collect();
        let accuracy = &report.outputs[0].accuracy;
        // a cube of 2^31 steps leaves no room for what doubles are rounded by
        let lost = accuracy.integers.points - accuracy.integers.same;
        assert!(lost == 0 || extent[0] == largest);
        found.sort_unstable();
        meant.retain(|q| found.binary_search(q).is_err());
        assert!(meant.len() as u64 <= lost, "{extent:?} {scale:?}: {} lost, not {lost}", meant.len());
        let octree = Dataset::open(bench.out()).unwrap();
        let metadata = octree.metadata();
        let side = metadata.cube.max[0] - metadata.cube.min[0];
        assert!(side / metadata.scale < 2f64.powi(31));
        let mut points = NodePoints::default();
        for node in octree.read_hierarchy().unwrap() {
            octree.read_points(node.key, &mut points).unwrap();
            for world in (0..points.len()).map(|i| points.world(i).unwrap()) {
                for a in 0..3 {
                    let lattice = (world[a] / scale[a]).round() * scale[a];
                    let error = (world[a] - lattice).abs();
                    assert!(error <= accuracy.format.max[a], "{extent:?} {scale:?}: {error:e} {accuracy:?}");
                }
            }
        }
    }
}

#[test]
fn an_axis_finer_than_the_step_of_all_is_refused() {
    let bench = Bench::new(&box_of([2_000_000_000, 2000, 1_000_000], [1.0, 1.0, 1e-9], 50));
    let error = convert(&bench.plan, &[Potree1Settings::default().into()], &Silent).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("one step for all axes") && text.contains("that of z is 0.000000001"), "{text}");
    assert!(matches!(error.advice(), Some(Advice::CoarserStep { least }) if (0.9..1.0).contains(&least)));
    assert!(!bench.out().exists());
    let equal = Plan { scale: ScaleChoice::Fixed(1.0), ..bench.plan };
    assert!(convert(&equal, &[Potree1Settings::default().into()], &Silent).is_ok());
}

#[test]
fn a_tree_of_many_levels_has_many_folders() {
    let mut random = Random::new(1);
    let mut positions: Vec<[i32; 3]> = (0..900).map(|_| [0; 3].map(|_: i32| random.below(64) as i32)).collect();
    positions.push([(1 << 30) - 9; 3]);
    let las = Las { scale: [0.001; 3], offset: [0.0; 3], ..Las::numbered(positions) };
    let bench = Bench::new(&las);
    let report = bench.convert_both(leaves_of(20));
    assert!(report.outputs[0].tree.depth >= 25, "{}", report.outputs[0].tree.depth);
    assert!(bench.out().join("potree1/data/r/00000/00000/00000/00000").is_dir());
    let [one, two] = ["potree1", "potree2"].map(|format| points_of_nodes(&bench.out().join(format), &las));
    assert!(one == two);
}

#[test]
fn a_node_too_large_for_memory_is_written_in_parts() {
    let mut las = Las::numbered([[5, 6, 7]].into_iter().cycle().take(400_000));
    las.points.push(Point::at([900, 0, 0]));
    let mut bench = Bench::new(&las);
    (bench.plan.threads, bench.plan.memory_bytes) = (1, 100 << 20);
    bench.convert(Potree1Settings::default());
    let found = points_of_nodes(&bench.out(), &las);
    let files = dataset(&bench.out());
    let archived = Potree1Settings { archive: true, ..Potree1Settings::default() };
    let [scarce, plenty] = [100 << 20, 4 << 30].map(|memory_bytes| {
        bench.plan.memory_bytes = memory_bytes;
        bench.convert(archived);
        (unpacked(&bench.out().join("potree1.zip")), dataset(&bench.out()))
    });
    assert_same_dataset(&scarce.0, &files, "unpacked");
    assert_same_dataset(&scarce.1, &plenty.1, "an archive with other memory");
    let mut all: Vec<_> = found.into_values().flatten().collect();
    all.sort_unstable();
    let mut meant: Vec<_> = las.points.iter().map(|p| (p.xyz.map(i64::from), p.rgb.map(eight_bit))).collect();
    meant.sort_unstable();
    assert!(all == meant);
}

/// The files of an archive.
fn unpacked(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let archive = Archive::open(path, "cloud.js").unwrap();
    let read = |(name, bytes): (&str, u64)| {
        let mut buffer = vec![0; bytes as usize];
        archive.read_at(name, 0, &mut buffer).unwrap();
        (name.to_owned(), buffer)
    };
    archive.files().map(read).collect()
}

#[test]
fn an_archive_holds_the_files_of_the_folder_byte_for_byte_whatever_the_memory() {
    let bench = Bench::new(&Las::terrain(200_000, 3));
    bench.convert(leaves_of(500));
    let folder = dataset(&bench.out());
    let settings = Potree1Settings { archive: true, ..leaves_of(500) };
    let [plenty, scarce] = [(2, 4 << 30), (1, 100 << 20)].map(|(threads, memory_bytes)| {
        let plan = Plan { threads, memory_bytes, ..bench.plan.clone() };
        let report = convert(&plan, &[settings.into()], &Silent).unwrap();
        let files = dataset(&plan.output);
        assert_eq!(files.keys().collect::<Vec<_>>(), ["potree1.zip"]);
        assert_eq!(report.outputs[0].bytes, files["potree1.zip"].len() as u64);
        files
    });
    assert_same_dataset(&scarce, &plenty, "with other memory and threads");
    let path = bench.out().join("potree1.zip");
    assert_same_dataset(&unpacked(&path), &folder, "unpacked");
    assert!(plenty["potree1.zip"].starts_with(b"PK") && plenty["potree1.zip"][30..38] == *b"cloud.js");
    let (octree, mut points) = (Dataset::open(&path).unwrap(), NodePoints::default());
    let nodes = octree.read_hierarchy().unwrap();
    assert!(nodes.iter().all(|node| octree.read_points(node.key, &mut points).is_ok()));
}

/// The values of all points of a dataset, by place and the values themselves.
fn values(folder: &Path, las: &Las, columns: &[&str]) -> Vec<([i64; 3], Vec<u64>)> {
    let octree = open_octree(folder).unwrap();
    let mut nodes = OctreeNodes::new(&*octree).unwrap();
    let (mut found, mut stack, mut points) = (Vec::new(), vec![NodeKey::ROOT], NodePoints::default());
    while let Some(key) = stack.pop() {
        nodes.load(&*octree, key).unwrap();
        stack.extend(nodes.children(key).map(|child| child.key));
        octree.points(nodes.get(key).unwrap(), &mut points).unwrap();
        for i in 0..points.len() {
            let world = points.world(i).unwrap();
            let value = |name: &&str| {
                let of = |column: Option<u64>| column.unwrap_or_else(|| panic!("no {name}"));
                of(points
                    .column::<u8>(name)
                    .map(|c| u64::from(c[i]))
                    .or_else(|| points.column::<u16>(name).map(|c| u64::from(c[i])))
                    .or_else(|| points.column::<i8>(name).map(|c| c[i] as u64))
                    .or_else(|| points.column::<f64>(name).map(|c| c[i].to_bits())))
            };
            let place = std::array::from_fn(|a| ((world[a] - las.offset[a]) / las.scale[a]).round() as i64);
            found.push((place, columns.iter().map(value).collect()));
        }
    }
    found.sort_unstable();
    found
}

#[test]
fn version_1_8_holds_all_attributes_and_1_7_those_that_clients_read() {
    let las = Las::terrain(3000, 4);
    let mut bench = Bench::new(&las);
    bench.plan.attributes = AttributeChoice::All;
    let objects = Potree1Settings { version: Potree1Version::V1_8, ..leaves_of(100) };
    let report = bench.convert_both(objects);
    assert_eq!(report.outputs[0].attributes_dropped, []);
    let columns =
        ["intensity", "classification", "gps-time", "point source id", "return number", "user data", "scan angle rank"];
    let [one, two] = ["potree1", "potree2"].map(|format| values(&bench.out().join(format), &las, &columns));
    assert!(one == two);
    let json = fs::read_to_string(bench.out().join("potree1/cloud.js")).unwrap();
    assert!(json.contains("\"version\": \"1.8\"") && json.contains("\"name\": \"source id\""), "{json}");

    let report = bench.convert_both(leaves_of(100));
    assert_eq!(report.outputs[0].attributes, ["position", "rgb", "intensity", "classification"]);
    let columns = ["intensity", "classification"];
    let [one, two] = ["potree1", "potree2"].map(|format| values(&bench.out().join(format), &las, &columns));
    assert!(one == two);
    let dropped: Vec<String> = report.outputs[0].attributes_dropped.iter().map(|d| d.why.to_string()).collect();
    assert!(!dropped.is_empty() && dropped.iter().all(|why| why == "version 1.7 has no place for it"), "{dropped:?}");
}

#[test]
fn without_colour_points_are_grey_by_intensity() {
    let mut las = Las::terrain(500, 5);
    las.point_format = 6;
    let bench = Bench::new(&las);
    let report = bench.convert(Potree1Settings::default());
    assert!(report.warnings.iter().any(|w| w.to_string().contains("grey shows the intensity, 0 to 499")));
    let own = |out: &Path| Dataset::open(out).unwrap().metadata().extra["pointmill"]["colours"].clone();
    assert_eq!(own(&bench.out()), serde_json::json!({ "intensity": [0.0, 499.0] }));
    let [least, greatest] = [0, 499].map(|i| las.points[i].xyz.map(i64::from));
    let all: BTreeMap<[i64; 3], [u8; 3]> = points_of_nodes(&bench.out(), &las).into_values().flatten().collect();
    assert_eq!((all[&least], all[&greatest]), ([0; 3], [255; 3]));

    let xyz = bench.dir.path().join("scan.xyz");
    fs::write(&xyz, "1 2 3\n4 5 6\n").unwrap();
    let plan = Plan { inputs: vec![xyz], ..bench.plan };
    let report = convert(&plan, &[Potree1Settings::default().into()], &Silent).unwrap();
    assert!(report.warnings.iter().any(|w| w.to_string().contains("all points are white")));
    assert_eq!(own(&plan.output), "white");
    let mut points = NodePoints::default();
    Dataset::open(&plan.output).unwrap().read_points(NodeKey::ROOT, &mut points).unwrap();
    assert_eq!(points.column::<u16>("rgb").unwrap(), [u16::MAX; 6]);
}
