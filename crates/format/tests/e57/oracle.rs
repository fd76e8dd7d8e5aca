//! Files of the `e57` crate's writer, of many pieces, against its simple reader.

use e57::{
    CartesianCoordinate, E57Reader, E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform,
    Translation,
};

use pointmill_testkit::files;

use crate::common::{E57, near};

const POINTS: usize = 120_000;

fn scaled() -> RecordDataType {
    RecordDataType::ScaledInteger { min: -500_000, max: 500_000, scale: 0.001, offset: 3.0 }
}

/// Two scans of doubles or scaled integers with colour, each turned and moved.
fn write(path: &std::path::Path) {
    let mut writer = E57Writer::from_file(path, "file").unwrap();
    for (scan, data_type) in [RecordDataType::F64, scaled()].into_iter().enumerate() {
        let position = |name| Record { name, data_type: data_type.clone() };
        let prototype = vec![
            position(RecordName::CartesianX),
            position(RecordName::CartesianY),
            position(RecordName::CartesianZ),
            Record::COLOR_RED_U8,
            Record::COLOR_GREEN_U8,
            Record::COLOR_BLUE_U8,
            Record { name: RecordName::Intensity, data_type: RecordDataType::Integer { min: 0, max: 4095 } },
            Record::CARTESIAN_INVALID_STATE,
        ];
        let mut cloud = writer.add_pointcloud(&format!("scan {scan}"), prototype).unwrap();
        cloud.set_transform(Some(Transform {
            rotation: Quaternion { w: 0.6, x: 0.0, y: 0.8, z: 0.0 },
            translation: Translation { x: 1e5 * scan as f64, y: -5.0, z: 0.125 },
        }));
        for i in 0..POINTS as i64 {
            let mix = |k: i64| (i * 7919 + k * 104_729) % 1_000_000 - 500_000;
            let position = |k: i64| match scan {
                0 => RecordValue::Double(mix(k) as f64 / 977.0),
                _ => RecordValue::ScaledInteger(mix(k)),
            };
            let int = |v: i64| RecordValue::Integer(v);
            let values = vec![
                position(1),
                position(2),
                position(3),
                int(i % 256),
                int(i / 256 % 256),
                int(255 - i % 256),
                int(i % 4096),
                int(i64::from(i % 1000 == 0) * 2),
            ];
            cloud.add_point(values).unwrap();
        }
        cloud.finalize().unwrap();
    }
    writer.finalize().unwrap();
}

#[test]
fn large_scans_equal_the_simple_reader_point_by_point() {
    let path = files::temporary(b"");
    write(&path);
    let cloud = E57.check(&path, "a file of many pieces").unwrap();
    assert!(cloud.errors.is_empty() && cloud.info.warnings.is_empty(), "{:?} {:?}", cloud.errors, cloud.info.warnings);
    assert_eq!((cloud.len(), cloud.promised), (2 * POINTS, 2 * POINTS as u64));
    let (rgb, intensity, index) = (cloud.values("rgb"), cloud.values("intensity"), cloud.values("point source id"));
    let bounds = cloud.info.bounds_declared.unwrap();
    let mut reader = E57Reader::from_file(&path).unwrap();
    let mut i = 0;
    for (scan, pc) in reader.pointclouds().iter().enumerate() {
        for point in reader.pointcloud_simple(pc).unwrap() {
            let point = point.unwrap();
            let seen = [0, 1, 2].map(|a| cloud.xyz[a][i]);
            match point.cartesian {
                CartesianCoordinate::Valid { x, y, z } => {
                    let same = [x, y, z].iter().zip(seen).all(|(a, b)| near(*a, b));
                    assert!(same, "point {i}: {seen:?}, not {:?}", [x, y, z]);
                    let edge = |a: usize| 1e-6 + 1e-12 * bounds.max[a].abs();
                    assert!((0..3).all(|a| seen[a] >= bounds.min[a] - edge(a) && seen[a] <= bounds.max[a] + edge(a)));
                }
                _ => assert!(seen.iter().all(|v| v.is_nan()), "point {i}"),
            }
            let colour = point.color.unwrap();
            let expected = [colour.red, colour.green, colour.blue].map(|v| (f64::from(v) * 65_535.0).round());
            assert_eq!(rgb[3 * i..3 * i + 3], expected);
            assert!((intensity[i] - f64::from(point.intensity.unwrap()) * 65_535.0).abs() <= 0.51);
            assert_eq!(index[i], scan as f64);
            i += 1;
        }
    }
    assert_eq!(i, 2 * POINTS);
}

#[test]
fn one_bad_page_costs_its_piece_and_names_the_byte() {
    let path = files::temporary(b"");
    write(&path);
    let whole = E57.read(&path).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    // in the middle of a packet of the first scan, away from heads
    let at = 1024 * 1200 + 500;
    bytes[at] ^= 1;
    let cloud = E57.read_bytes(&bytes).unwrap();
    assert_eq!(cloud.promised, whole.promised, "what is lost is still counted");
    assert_eq!(cloud.errors.len(), 1, "{:?}", cloud.errors);
    let error = cloud.errors[0].to_string();
    assert!(error.contains("page 1200 does not match its checksum (byte 1228800)"), "{error}");
    assert!(cloud.len() >= 2 * POINTS - 50_000);
}
