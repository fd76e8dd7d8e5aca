//! Files of libE57Format against what it reads from them (`fixtures/e57/expected.tsv`).

use pointmill_format::AttributeType;
use pointmill_format::scan::e57;
use pointmill_testkit::reader::{Cloud, columns_are_independent};
use pointmill_testkit::{files, golden};

use crate::common::{self, read};

/// Points, of these not NaN; of the latter sum, minimum, maximum, first, last. Exact but for integers beyond 2^53.
type Row = [f64; 7];

fn row(values: &[f64]) -> Row {
    let ok: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    let (min, max) = ok.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    [values.len() as f64, ok.len() as f64, ok.iter().sum(), min, max, ok[0], ok[ok.len() - 1]]
}

/// Sums and rotations round differently: 1e-9 of the largest value.
fn same(seen: &Row, expected: &Row) -> bool {
    let size = expected[3].abs().max(expected[4].abs()).max(1e-3);
    let exact = seen[..2] == expected[..2];
    exact
        && (seen[2] - expected[2]).abs() <= 1e-9 * size * expected[1].max(1.0)
        && (3..7).all(|i| (seen[i] - expected[i]).abs() <= 1e-9 * size)
}

#[test]
fn every_fixture_gives_the_positions_that_libe57format_reads() {
    let expected = golden::expected::<f64, 7>("e57");
    for fixture in common::fixtures() {
        let name = files::file_name(&fixture.path);
        let cloud = read(&name);
        assert!(cloud.errors.is_empty(), "{name}: {:?}", cloud.errors);
        let Some(expected) = expected.get(&name) else {
            assert_eq!((cloud.len(), name.as_str()), (0, "no_scans.e57"));
            continue;
        };
        for (axis, values) in ["x", "y", "z"].iter().zip(&cloud.xyz) {
            let (seen, expected) = (row(values), &expected[*axis]);
            assert!(same(&seen, expected), "{name} {axis}: {seen:?}, expected {expected:?}");
        }
    }
}

/// The values of one scan, distinguished by the scan index.
fn of_scan(cloud: &Cloud, name: &str, scan: f64) -> Vec<f64> {
    let (values, index) = (cloud.values(name), cloud.values("point source id"));
    values.iter().zip(index).filter(|(_, i)| *i == scan).map(|(v, _)| *v).collect()
}

#[test]
fn extra_fields_come_as_they_are_stored() {
    let expected = golden::expected::<f64, 7>("e57");
    let mut checked = 0;
    for (file, columns) in &expected {
        let cloud = read(file);
        for (column, expected) in columns.iter().filter(|(c, _)| c.contains('/')) {
            let (scan, field) = column.split_once('/').unwrap();
            let name = match field {
                "returnIndex" => "return number",
                "returnCount" => "number of returns",
                "nor:class" => "class",
                "demo:class" => "classification",
                field => field.rsplit(':').next().unwrap(),
            };
            let is_own = |prefix: &str| name.starts_with(prefix);
            let special = ["cartesian", "spherical", "color", "intensity", "normal", "is", "timeStamp"];
            if special.into_iter().any(is_own) {
                continue;
            }
            checked += 1;
            // returns are counted from 1, their indices from 0
            let first = f64::from(u8::from(field == "returnIndex"));
            let values: Vec<_> = of_scan(&cloud, name, scan.parse().unwrap()).iter().map(|v| v - first).collect();
            let seen = row(&values);
            assert!(same(&seen, expected), "{file} {column}: {seen:?}, expected {expected:?}");
        }
    }
    assert_eq!(checked, 17 + 3 + 4, "widths, normals, scans");
}

#[test]
fn columns_have_their_names_types_and_meaning() {
    let attributes = |file: &str| read(file).info.attributes;
    let names = |file: &str| attributes(file).iter().map(|a| a.name.clone()).collect::<Vec<_>>().join(", ");
    assert_eq!(
        names("scans.e57"),
        "rgb, intensity, point source id, rowIndex, columnIndex, return number, number of returns, timestamp"
    );
    assert_eq!(names("normals.e57"), "point source id, NormalX, NormalY, NormalZ, classification, class, reflectance");
    let of = |file: &str, name: &str| attributes(file).iter().find(|a| a.name == name).cloned().unwrap();
    let scaled = of("normals.e57", "class");
    assert_eq!((scaled.ty, scaled.scale[0], scaled.offset[0]), (AttributeType::Int16, 0.25, 10.0));
    assert_eq!(of("normals.e57", "classification").ty, AttributeType::UInt8);
    assert_eq!(of("normals.e57", "reflectance").ty, AttributeType::Float32);
    assert_eq!(of("scans.e57", "timestamp").ty, AttributeType::Float64, "single in one scan, double in another");
    assert_eq!(of("widths.e57", "w64").ty, AttributeType::Int64);
    assert_eq!(of("widths.e57", "w0").ty, AttributeType::UInt8);
    assert_eq!((of("scans.e57", "rgb").ty, of("scans.e57", "rgb").elements), (AttributeType::UInt16, 3));
}

#[test]
fn rows_and_columns_come_only_if_asked_for() {
    let scan = e57::open(files::fixture("e57").join("scans.e57")).unwrap();
    assert!(!scan.info().attributes.iter().any(|a| a.name.ends_with("Index")));
}

#[test]
fn a_selection_of_columns_leaves_the_others_empty_and_changes_no_value() {
    for fixture in common::fixtures() {
        columns_are_independent(e57::open(&fixture.path).unwrap().as_ref());
    }
}

#[test]
fn each_scan_has_its_points_its_place_and_its_box() {
    let parts = |file: &str| e57::open(files::fixture("e57").join(file)).unwrap().info().parts.clone();
    let scans = parts("scans.e57");
    assert_eq!(scans.iter().map(|p| p.number).collect::<Vec<_>>(), [1, 2, 3]);
    assert_eq!(scans.iter().map(|p| p.range.clone()).collect::<Vec<_>>(), [0..200, 200..400, 400..600]);
    let places = [[500_000.25, -4_000_000.5, 100.0], [0.0; 3], [1.0, 2.0, 3.0]];
    assert_eq!(scans.iter().map(|p| p.translation).collect::<Vec<_>>(), places);
    let cloud = read("scans.e57");
    let bounds = scans[0].bounds.unwrap();
    for i in (0..200).filter(|i| cloud.xyz[0][*i].is_finite()) {
        assert!((0..3).all(|a| cloud.xyz[a][i] > bounds.min[a] - 1e-6 && cloud.xyz[a][i] < bounds.max[a] + 1e-6));
    }
    assert!(bounds.extent().iter().all(|e| *e < 120.0), "the first scan's own box, turned: {bounds:?}");
    assert_eq!([scans[1].bounds, scans[2].bounds], [None; 2]);
    let empty: Vec<_> = parts("empty_scans.e57").into_iter().map(|p| p.range).collect();
    assert_eq!(empty, [0..0, 0..10, 10..10]);
    let info = cloud.info;
    assert_eq!([0, 199, 200, 599].map(|i| info.part_of(i).map(|p| p.number)), [Some(1), Some(1), Some(2), Some(3)]);
    assert_eq!(info.part_of(600), None);
}

#[test]
fn what_stands_around_the_points_is_told() {
    let info = |file: &str| e57::open(files::fixture("e57").join(file)).unwrap().info().clone();
    let scans = info("scans.e57");
    assert_eq!((scans.format.as_str(), scans.points_declared, scans.lattice), ("E57 1.0, 3 scans", 600, None));
    assert_eq!(scans.bounds_declared, None, "two scans declare none");
    assert_eq!(
        scans.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ["scan 3: the rotation is no unit quaternion; it is normalised"]
    );
    let empty = info("empty_scans.e57");
    assert_eq!(empty.crs.wkt.as_deref(), Some("PROJCS[\"Höhe & <Breite>\",GEOGCS[\"WGS 84\"],UNIT[\"metre\",1]]"));
    assert_eq!(
        empty.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ["2 images are in the file; they are not part of its points and not read"]
    );
    assert_eq!(
        info("no_scans.e57").warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ["the file has no scans"]
    );
    assert_eq!(
        info("no_z.e57").warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ["scan 1: its points have no z; it is taken as 0"]
    );
    assert_eq!(
        info("packets.e57").warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        ["scan 1: the field note holds text; it is not read"]
    );
    for quiet in ["spherical.e57", "both_systems.e57", "normals.e57", "widths.e57", "constant.e57"] {
        assert!(info(quiet).warnings.is_empty(), "{quiet}: {:?}", info(quiet).warnings);
    }
}
