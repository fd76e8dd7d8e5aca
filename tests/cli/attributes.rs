//! One quantity is one attribute, values stay what they are, and what cannot stay is counted and told.

use pointmill_format::bintree::Bintree;
use pointmill_format::potree2::Dataset;
use pointmill_format::{Element, NodePoints};
use pointmill_testkit::las::{Las, Point};

use crate::support::Dir;

/// The values of an attribute of an octree, by the x of its points.
fn octree<T: Element>(dir: &Dir, name: &str) -> Vec<(f64, T)> {
    let dataset = Dataset::open(dir.path("out")).unwrap();
    let mut points = NodePoints::default();
    let mut all = Vec::new();
    for node in dataset.read_hierarchy().unwrap() {
        dataset.read_points(&node, &mut points).unwrap();
        append(&points, name, &mut all);
    }
    sorted(all)
}

/// The same of an attribute of several elements.
pub(crate) fn octree_chunks<T: Element>(dir: &Dir, name: &str) -> Vec<(f64, Vec<T>)> {
    let dataset = Dataset::open(dir.path("out")).unwrap();
    let mut points = NodePoints::default();
    let mut all = Vec::new();
    for node in dataset.read_hierarchy().unwrap() {
        dataset.read_points(&node, &mut points).unwrap();
        let values = points.column::<T>(name).unwrap();
        let of_point =
            |i: usize| values[i * values.len() / points.len()..(i + 1) * values.len() / points.len()].to_vec();
        all.extend((0..points.len()).map(|i| (points.world(i).unwrap()[0], of_point(i))));
    }
    sorted(all)
}

/// The same of a binary tree.
fn bintree<T: Element>(dir: &Dir, name: &str) -> Vec<(f64, T)> {
    let tree = Bintree::open(dir.path("out")).unwrap();
    let mut points = NodePoints::default();
    let mut all = Vec::new();
    for leaf in tree.leaves() {
        tree.read_leaf(leaf, &mut points).unwrap();
        append(&points, name, &mut all);
    }
    sorted(all)
}

fn append<T: Element>(points: &NodePoints, name: &str, all: &mut Vec<(f64, T)>) {
    let values = points.column::<T>(name).unwrap_or_else(|| panic!("no {name} of that type"));
    all.extend(values.iter().enumerate().map(|(i, v)| (points.world(i).unwrap()[0], *v)));
}

fn sorted<T>(mut all: Vec<(f64, T)>) -> Vec<(f64, T)> {
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

fn values<T>(all: Vec<(f64, T)>) -> Vec<T> {
    all.into_iter().map(|(_, v)| v).collect()
}

/// "name type" of every attribute of an octree beside the position.
fn attributes(dir: &Dir) -> String {
    let dataset = Dataset::open(dir.path("out")).unwrap();
    let shown = dataset.metadata().attributes.iter().map(|a| format!("{} {}", a.attribute.name, a.attribute.ty));
    shown.skip(1).collect::<Vec<_>>().join(", ")
}

/// An ascii PLY of these properties and rows.
pub(crate) fn ply(properties: &[&str], rows: &[&str]) -> Vec<u8> {
    let properties: Vec<String> = properties.iter().map(|p| format!("property {p}\n")).collect();
    let (count, properties, rows) = (rows.len(), properties.concat(), rows.join("\n"));
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n{rows}\n").into_bytes()
}

/// Points of format 2 on a line from x 0, with extra bytes: name, type, scale, and the bytes of each point.
pub(crate) fn las(points: i32, extras: &[(&str, u8, Option<f64>)], bytes: impl Fn(i32) -> Vec<u8>) -> Vec<u8> {
    let line = Las { offset: [0.0; 3], ..Las::new((0..points).map(|i| Point::at([i * 100, 0, 0])).collect()) };
    let plain = line.bytes();
    let u32_at = |at: usize| u32::from_le_bytes(plain[at..at + 4].try_into().unwrap()) as usize;
    let (start, stride) = (u32_at(96), usize::from(u16::from_le_bytes([plain[105], plain[106]])));
    let mut out = plain[..start].to_vec();
    let mut record = vec![0u8; 54];
    record[2..11].copy_from_slice(b"LASF_Spec");
    record[18] = 4;
    record[20..22].copy_from_slice(&(192 * extras.len() as u16).to_le_bytes());
    for (name, ty, scale) in extras {
        let mut descriptor = [0u8; 192];
        descriptor[2] = *ty;
        descriptor[3] = if scale.is_some() { 8 } else { 0 };
        descriptor[4..4 + name.len()].copy_from_slice(name.as_bytes());
        for element in 0..3 {
            descriptor[112 + 8 * element..120 + 8 * element].copy_from_slice(&scale.unwrap_or(1.0).to_le_bytes());
        }
        record.extend(descriptor);
    }
    out.extend(&record);
    out[96..100].copy_from_slice(&((start + record.len()) as u32).to_le_bytes());
    out[100..104].copy_from_slice(&(u32_at(100) as u32 + 1).to_le_bytes());
    out[105..107].copy_from_slice(&((stride + bytes(0).len()) as u16).to_le_bytes());
    for i in 0..points {
        out.extend(&plain[start + i as usize * stride..][..stride]);
        out.extend(bytes(i));
    }
    out
}

const UNIT: [[i8; 3]; 5] = [[127, 0, 0], [0, 127, 0], [0, 0, 127], [-127, 0, 0], [0, 0, -127]];

#[test]
fn normals_of_any_name_type_and_kind_of_file_are_one_set() {
    let dir = Dir::new();
    let scale = Some(1.0 / 127.0);
    let names = [("confidence", 1, None), ("normal x", 2, scale), ("normal y", 2, scale), ("normal z", 2, scale)];
    dir.write("1.las", &las(5, &names, |i| [&[9u8][..], &UNIT[i as usize].map(|v| v as u8)].concat()));
    let triple = |i: i32| UNIT[i as usize].iter().flat_map(|v| (f64::from(*v) / 127.0).to_le_bytes()).collect();
    dir.write("2.las", &las(1, &[("Normals", 30, None)], triple));
    dir.write(
        "3.ply",
        &ply(&["float x", "float y", "float z", "double nx", "double ny", "double nz"], &["9 0 0 0 1 0"]),
    );
    dir.write("4.csv", b"x,y,z,Normal_X,Normal_Y,Normal_Z\n10.5,0,0,0,-1,0\n11.5,0,0,0,0,1\n");
    let pcd = "VERSION .7\nFIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\nTYPE F F F F F F\nCOUNT 1 1 1 1 1 1\n\
               WIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n12 0 0 -1 0 0\n";
    dir.write("5.pcd", pcd.as_bytes());
    let inputs = ["1.las", "2.las", "3.ply", "4.csv", "5.pcd"];
    for some in [&inputs[..1], &inputs[..]] {
        dir.succeed(["convert", "-o", "out", "--overwrite"].iter().chain(some));
        let normals = ["NormalX", "NormalY", "NormalZ"].map(|name| values(octree::<f32>(&dir, name)));
        let seen: Vec<[f32; 3]> = (0..normals[0].len()).map(|i| [0, 1, 2].map(|axis| normals[axis][i])).collect();
        if some.len() == 1 {
            assert_eq!(seen, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]);
        } else {
            assert_eq!(seen[seen.len() - 4..], [[0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [-1., 0., 0.]]);
            assert_eq!(seen.iter().filter(|n| **n == [1.0, 0.0, 0.0]).count(), 2);
        }
        assert_eq!(attributes(&dir).matches("ormal").count(), 3, "{}", attributes(&dir));
        dir.validate("out", some);
    }
}

#[test]
fn wide_integers_are_exact_but_for_octrees_which_count_what_they_round() {
    let dir = Dir::new();
    let nanoseconds = |i: i32| 1_700_000_000_000_000_001 + i as u64;
    dir.write("a.las", &las(3, &[("t_ns", 7, None)], |i| nanoseconds(i).to_le_bytes().to_vec()));
    dir.succeed(["convert", "a.las", "-o", "out", "--to", "bintree", "--attributes", "t_ns"]);
    assert_eq!(values(bintree::<u64>(&dir, "t_ns")), [nanoseconds(0), nanoseconds(1), nanoseconds(2)]);
    dir.validate("out", &["a.las"]);
    dir.succeed(["convert", "a.las", "-o", "out", "--overwrite", "--to", "batches", "--attributes", "t_ns"]);
    dir.validate("out", &["a.las"]);
    let ended = dir.succeed(["convert", "a.las", "-o", "out", "--overwrite"]);
    assert_eq!(values(octree::<f64>(&dir, "t_ns")), [nanoseconds(0) as f64; 3]);
    dir.validate("out", &["a.las"]);
    let line = "potree2: t_ns, stored as double: 3 values are rounded (1700000000000000000)";
    assert!(ended.stderr().contains(line), "{}", ended.stderr());
    let report = dir.report("out");
    assert_eq!(report["outputs"][0]["attributes_changed"][0]["changed"]["rounded"], 3, "{report}");
    let read = report["attributes"].as_array().unwrap().iter().find(|a| a["name"] == "t_ns").unwrap();
    assert_eq!((&read["type"], &read["changed"]), (&"uint64".into(), &serde_json::Value::Null));
}

#[test]
fn classes_of_any_value_survive_and_are_chosen_by_number() {
    let dir = Dir::new();
    dir.write("a.ply", &ply(&["float x", "float y", "float z", "int class"], &["0 0 0 2", "1 0 0 -1", "2 0 0 70000"]));
    dir.write("b.las", &las(1, &[], |_| Vec::new()));
    dir.succeed(["convert", "a.ply", "b.las", "-o", "out"]);
    assert_eq!(values(octree::<i32>(&dir, "classification")).len(), 4);
    assert!(values(octree::<i32>(&dir, "classification")).contains(&70_000));
    dir.validate("out", &["a.ply", "b.las"]);
    dir.succeed(["convert", "a.ply", "-o", "out", "--overwrite", "--to", "bintree"]);
    assert_eq!(values(bintree::<f32>(&dir, "classification")), [2.0, -1.0, 70_000.0]);
    dir.validate("out", &["a.ply"]);
    dir.succeed(["convert", "a.ply", "-o", "out", "--overwrite", "--class=-1,70000"]);
    assert_eq!(values(octree::<i32>(&dir, "classification")), [-1, 70_000]);
    dir.validate("out", &["a.ply"]);

    dir.write("c.csv", b"x,y,z,classification\n0,0,0,300\n1,0,0,-4\n");
    dir.succeed(["convert", "c.csv", "-o", "out", "--overwrite"]);
    assert_eq!(values(octree::<i16>(&dir, "classification")), [300, -4]);
}

#[test]
fn classes_that_a_binary_tree_cannot_hold_are_counted() {
    let dir = Dir::new();
    let rows = ["0 0 0 2.5", "1 0 0 nan", "2 0 0 16777218", "3 0 0 6"];
    dir.write("a.ply", &ply(&["float x", "float y", "float z", "double scalar_Classification"], &rows));
    let ended = dir.succeed(["convert", "a.ply", "-o", "out", "--to", "bintree"]);
    let line = "bintree: classification, stored as float: 1 value is rounded, 1 is not finite and becomes 0, 1 is too \
                large to be held and becomes 0 (2.5 to 16777218)";
    assert!(ended.stderr().contains(line), "{}", ended.stderr());
    assert_eq!(values(bintree::<f32>(&dir, "classification")), [3.0, 0.0, 0.0, 6.0]);
    dir.validate("out", &["a.ply"]);
    dir.succeed(["convert", "a.ply", "-o", "out", "--overwrite"]);
    assert!(values(octree::<f64>(&dir, "classification"))[1].is_nan());
    dir.validate("out", &["a.ply"]);
}

#[test]
fn angles_of_both_kinds_of_las_are_degrees() {
    let dir = Dir::new();
    let point = |x, scan_angle| Point { scan_angle, ..Point::at([x, 0, 0]) };
    let old = Las::new(vec![point(0, -12), point(100, 90)]);
    let new = Las { point_format: 6, ..Las::new(vec![point(200, 15), point(300, -7)]) };
    let fine = values(octree_of::<i16>(&dir, "new.las", &new.bytes()));
    dir.write("old.las", &old.bytes());
    dir.succeed(["convert", "old.las", "new.las", "-o", "out", "--overwrite"]);
    let seen = values(octree::<f64>(&dir, "scan angle"));
    assert_eq!(seen[..2], [-12.0, 90.0]);
    assert_eq!(seen[2..], [f64::from(fine[0]) * 0.006, f64::from(fine[1]) * 0.006]);
    assert!(!attributes(&dir).contains("rank"), "{}", attributes(&dir));
    dir.validate("out", &["old.las", "new.las"]);
}

/// The scan angles of a file alone.
fn octree_of<T: Element>(dir: &Dir, name: &str, bytes: &[u8]) -> Vec<(f64, T)> {
    dir.write(name, bytes);
    dir.succeed(["convert", name, "-o", "out"]);
    octree(dir, "scan angle")
}

#[test]
fn what_a_file_lacks_is_told_and_types_hold_the_values_of_all() {
    let dir = Dir::new();
    dir.write("a.las", &las(2, &[("quality", 4, Some(0.5))], |i| (-3i16 - i as i16).to_le_bytes().to_vec()));
    let properties = ["float x", "float y", "float z", "float intensity", "float quality"];
    dir.write("b.ply", &ply(&properties, &["7 0 0 0.25 1.5", "8 0 0 nan 2.5"]));
    let ended = dir.succeed(["convert", "a.las", "b.ply", "-o", "out"]);
    assert_eq!(values(octree::<f64>(&dir, "quality")), [-1.5, -2.0, 1.5, 2.5]);
    assert_eq!(values(octree::<f32>(&dir, "intensity"))[..3], [0.0, 0.0, 0.25]);
    let line = "classification";
    let told = ended.stderr();
    let told = told.lines().find(|l| l.contains(line)).unwrap_or_else(|| panic!("{told}"));
    assert!(told.contains(": 2 points of 1 file have none; 0 is written"), "{told}");
    let report = dir.report("out");
    let class = report["attributes"].as_array().unwrap().iter().find(|a| a["name"] == "classification").unwrap();
    assert_eq!(class["missing"], serde_json::json!({ "points": 2, "files": 1, "value": 0 }));
    dir.validate("out", &["a.las", "b.ply"]);
}

#[test]
fn colours_that_are_no_numbers_are_counted() {
    let dir = Dir::new();
    let properties = ["float x", "float y", "float z", "float red", "float green", "float blue"];
    dir.write("a.ply", &ply(&properties, &["0 0 0 0.5 nan 1", "1 0 0 0 0.25 1.0005"]));
    let ended = dir.succeed(["convert", "a.ply", "-o", "out"]);
    let line = "rgb: 1 value is outside the range and takes its nearest end, 1 is not finite and becomes 0 (1.0005)";
    assert!(ended.stderr().contains(line), "{}", ended.stderr());
    dir.validate("out", &["a.ply"]);
}

#[test]
fn an_intensity_of_any_type_makes_grey() {
    let dir = Dir::new();
    for (ty, rows) in [
        ("double", ["0 0 0 0", "1 0 0 0.5", "2 0 0 1"]),
        ("int", ["0 0 0 -100", "1 0 0 0", "2 0 0 100"]),
        ("float", ["0 0 0 nan", "1 0 0 nan", "2 0 0 nan"]),
    ] {
        let intensity = format!("{ty} intensity");
        dir.write("a.ply", &ply(&["float x", "float y", "float z", &intensity], &rows));
        dir.succeed(["convert", "a.ply", "-o", "out", "--overwrite", "--to", "batches"]);
        let batches = pointmill_format::batches::Batches::open(dir.path("out/points.qbatch")).unwrap();
        let mut greys: Vec<u32> =
            (0..3).map(|i| batches.original_colour(i).map_or(999, |[r, _, _]| u32::from(r))).collect();
        greys.sort_unstable();
        assert_eq!(greys, if ty == "float" { [0, 0, 0] } else { [0, 128, 255] }, "{ty}");
        dir.validate("out", &["a.ply"]);
    }
}

#[test]
fn a_narrowed_or_altered_value_is_found() {
    let dir = Dir::new();
    dir.write("a.ply", &ply(&["float x", "float y", "float z", "int class"], &["0 0 0 2", "1 0 0 -1"]));
    dir.write("b.ply", &ply(&["float x", "float y", "float z", "uchar class"], &["0 0 0 2", "1 0 0 255"]));
    dir.succeed(["convert", "b.ply", "-o", "out"]);
    let found = dir.run(["validate", "out", "--against", "a.ply"]);
    assert_eq!(found.code(), 7, "{}", found.stdout());
    assert!(found.stdout().contains("classification"), "{}", found.stdout());
}
