//! Files of plyfile, Open3D and numpy against what these read from them (`fixtures/rows/expected.tsv`).

use std::collections::BTreeMap;

use pointmill_format::Wanted;

use crate::common::{self, Cloud};

/// Column → points, sum, least, greatest, first, last.
type Table = BTreeMap<String, [f64; 6]>;

fn expected() -> BTreeMap<String, Table> {
    let text = std::fs::read_to_string(common::fixtures().join("expected.tsv")).unwrap();
    let mut files = BTreeMap::<String, Table>::new();
    for line in text.lines().filter(|l| !l.starts_with('#')) {
        let mut fields = line.split('\t');
        let (file, column) = (fields.next().unwrap(), fields.next().unwrap());
        let numbers: Vec<f64> = fields.map(|f| f.parse().unwrap()).collect();
        files.entry(file.to_owned()).or_default().insert(column.to_owned(), numbers.try_into().unwrap());
    }
    files
}

fn summary(values: impl Iterator<Item = f64>) -> [f64; 6] {
    let values: Vec<f64> = values.collect();
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (least, greatest) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    [values.len() as f64, finite().sum(), least, greatest, values[0], values[values.len() - 1]]
}

fn table(cloud: &Cloud) -> Table {
    let mut table = Table::new();
    for (name, axis) in ["x", "y", "z"].iter().zip(&cloud.xyz) {
        table.insert((*name).to_owned(), summary(axis.iter().copied()));
    }
    for (attribute, values) in cloud.info.attributes.iter().zip(&cloud.columns) {
        let elements = attribute.elements;
        for e in 0..elements {
            let name = if elements == 1 { attribute.name.clone() } else { format!("{}[{e}]", attribute.name) };
            table.insert(name, summary(values.iter().skip(e).step_by(elements).copied()));
        }
    }
    table
}

#[test]
fn every_fixture_gives_the_columns_that_other_readers_give() {
    let expected = expected();
    assert_eq!(expected.len(), common::all_fixtures().len());
    for (file, expected) in &expected {
        let cloud = common::read(&common::fixtures().join(file)).unwrap();
        assert!(cloud.errors.is_empty(), "{file}: {:?}", cloud.errors);
        let found = table(&cloud);
        let names = |t: &Table| t.keys().cloned().collect::<Vec<_>>();
        assert_eq!(names(&found), names(expected), "{file}");
        for (column, expected) in expected {
            for (k, (found, expected)) in found[column].iter().zip(expected).enumerate() {
                // numpy adds in another order
                let tolerance = if k == 1 { expected.abs() * 1e-12 + 1e-6 } else { 0.0 };
                let same = (found - expected).abs() <= tolerance || found.to_bits() == expected.to_bits();
                assert!(same || (found.is_nan() && expected.is_nan()), "{file} {column} [{k}]: {found} {expected}");
            }
        }
    }
}

#[test]
fn sound_files_give_no_warning_but_that_a_viewpoint_is_not_applied() {
    for path in common::all_fixtures() {
        let cloud = common::read(&path).unwrap();
        let viewpoint = path.ends_with("padding_and_counts.pcd");
        assert_eq!(cloud.warned("viewpoint (1 2 3 1 0 0 0) is not applied"), viewpoint);
        assert_eq!(cloud.info.warnings.len(), usize::from(viewpoint), "{path:?}: {:?}", cloud.info.warnings);
        assert_eq!(cloud.info.points_declared, cloud.len() as u64, "{path:?}");
    }
}

#[test]
fn the_encodings_of_one_cloud_give_the_same_points() {
    let pair = |a: &str, b: &str| {
        let [a, b] = [a, b].map(|name| common::read(&common::fixtures().join(name)).unwrap());
        assert_eq!((a.xyz, a.columns, a.info.attributes), (b.xyz, b.columns, b.info.attributes));
    };
    pair("all_little.ply", "all_big.ply");
    pair("all_little.ply", "all_ascii.ply");
    pair("all_little.ply", "crlf.ply");
    pair("lists_little.ply", "lists_big.ply");
    pair("lists_little.ply", "lists_ascii.ply");
    for tag in ["f4", "f8"] {
        pair(&format!("open3d_{tag}_binary.pcd"), &format!("open3d_{tag}_compressed.pcd"));
    }
}

#[test]
fn a_selection_of_columns_leaves_the_others_empty_and_changes_no_value() {
    for path in common::all_fixtures() {
        let scan = common::open(&path).unwrap();
        let all = common::read_scan(scan.as_ref(), &Wanted::all(scan.info()));
        for i in 0..all.columns.len() {
            let mut wanted = Wanted::positions(scan.info());
            wanted.set(i, true);
            let one = common::read_scan(scan.as_ref(), &wanted);
            let bits = |c: &Cloud| c.xyz.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&one), bits(&all), "{path:?}");
            for (j, column) in one.columns.iter().enumerate() {
                assert!(if j == i { *column == all.columns[j] } else { column.is_empty() }, "{path:?}");
            }
        }
    }
}

#[test]
fn attributes_have_the_names_and_types_of_the_field() {
    let attributes = |file: &str| common::read(&common::fixtures().join(file)).unwrap().attributes();
    assert_eq!(
        attributes("all_big.ply"),
        "rgb uint16x3, intensity uint16x1, classification uint8x1, NormalX floatx1, NormalY floatx1, NormalZ floatx1, \
         scalar_Quality floatx1, id int32x1, time doublex1"
    );
    assert_eq!(attributes("padding_and_counts.pcd"), "rgb uint16x3, alpha uint8x1, hist uint16x3, label int64x1");
    assert_eq!(attributes("two_scans.ptx"), "rgb uint16x3, intensity floatx1, point source id uint16x1");
    assert_eq!(attributes("two_counts.pts"), "intensity uint16x1");
}
