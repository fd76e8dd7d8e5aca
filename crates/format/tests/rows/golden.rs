//! Files of plyfile, Open3D and numpy against what these read from them (`fixtures/rows/expected.tsv`).

use pointmill_testkit::golden;
use pointmill_testkit::reader::{Cloud, columns_are_independent, doubles};

use crate::common::{self, ROWS, read};

/// Points, sum, least, greatest, first, last.
fn summary(values: &[f64]) -> [f64; 6] {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (least, greatest) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    [values.len() as f64, finite().sum(), least, greatest, values[0], values[values.len() - 1]]
}

fn table(cloud: &Cloud) -> golden::Columns<f64, 6> {
    let columns = golden::columns(cloud, |v| v, doubles);
    columns.iter().map(|(name, values)| (name.clone(), summary(values))).collect()
}

#[test]
fn every_fixture_gives_the_columns_that_other_readers_give() {
    let expected = golden::expected::<f64, 6>("rows");
    assert_eq!(expected.len(), common::fixtures().len());
    for (file, expected) in &expected {
        let cloud = read(file);
        assert!(cloud.errors.is_empty(), "{file}: {:?}", cloud.errors);
        let found = table(&cloud);
        let names = |t: &golden::Columns<f64, 6>| t.keys().cloned().collect::<Vec<_>>();
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
fn sound_files_give_no_warning_but_of_what_is_interpreted() {
    for fixture in common::fixtures() {
        let (path, cloud) = (&fixture.path, ROWS.read(&fixture.path).unwrap());
        let told = if path.ends_with("padding_and_counts.pcd") {
            Some("viewpoint (1 2 3 1 0 0 0) is not applied")
        } else if fixture.name.contains("splats") {
            Some("there is no rgb; it is made from the splats' harmonics")
        } else {
            None
        };
        assert!(told.is_none_or(|what| cloud.warned(what)), "{path:?}: {:?}", cloud.info.warnings);
        assert_eq!(cloud.info.warnings.len(), told.iter().len(), "{path:?}: {:?}", cloud.info.warnings);
        assert_eq!(cloud.info.points_declared, cloud.len() as u64, "{path:?}");
    }
}

#[test]
fn the_encodings_of_one_cloud_give_the_same_points() {
    let pair = |a: &str, b: &str| {
        let [a, b] = [a, b].map(read);
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
    for fixture in common::fixtures() {
        columns_are_independent((ROWS.open)(&fixture.path).unwrap().as_ref());
    }
}

#[test]
fn attributes_have_the_names_and_types_of_the_field() {
    let attributes = |file: &str| read(file).attributes();
    assert_eq!(
        attributes("all_big.ply"),
        "rgb uint16x3, intensity uint16x1, classification uint8x1, NormalX floatx1, NormalY floatx1, NormalZ floatx1, \
         scalar_Quality floatx1, id int32x1, time doublex1"
    );
    assert_eq!(attributes("padding_and_counts.pcd"), "rgb uint16x3, alpha uint8x1, hist uint16x3, label int64x1");
    let rest: String = (0..9).map(|i| format!(", f_rest_{i} floatx1")).collect();
    assert_eq!(
        attributes("splats_compressed.ply"),
        "rgb uint16x3, f_dc_0 floatx1, f_dc_1 floatx1, f_dc_2 floatx1, alpha uint8x1, scale_0 floatx1, scale_1 floatx1, \
         scale_2 floatx1, rot_0 floatx1, rot_1 floatx1, rot_2 floatx1, rot_3 floatx1"
            .to_owned()
            + &rest
    );
    assert_eq!(attributes("two_scans.ptx"), "rgb uint16x3, intensity floatx1, point source id uint16x1");
    assert_eq!(attributes("two_counts.pts"), "intensity uint16x1");
}

#[test]
fn each_scan_of_a_ptx_has_its_points_and_its_place() {
    let parts = read("two_scans.ptx").info.parts;
    assert_eq!(parts.iter().map(|p| p.number).collect::<Vec<_>>(), [1, 2]);
    assert_eq!((parts[0].range.start, parts[0].range.end), (0, parts[1].range.start));
    assert_eq!((parts[1].range.end, parts[0].points + parts[1].points), (55, 55));
    assert_eq!(parts[0].translation, [500_000.0, 4_000_000.25, 100.0]);
}
