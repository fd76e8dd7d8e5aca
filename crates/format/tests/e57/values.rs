//! Colour, intensity, normals and times: what becomes of values that are scaled, turned or invalid.

use std::fs::File;
use std::io::BufReader;

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use e57::{E57Reader, RecordName};

use pointmill_format::{Changes, Scratch, Wanted};
use pointmill_testkit::files;

use crate::common::read;

/// Raw values of a scan by the `e57` crate: name in the file, values.
fn raw(file: &str, scan: usize, name: &str) -> Vec<f64> {
    let file = File::open(files::fixture("e57").join(file)).unwrap();
    let mut reader = E57Reader::new(BufReader::new(file)).unwrap();
    let cloud = reader.pointclouds()[scan].clone();
    let tag = |n: &RecordName| match n {
        RecordName::Unknown { name, .. } => name.clone(),
        n => format!("{n:?}"),
    };
    let field = cloud.prototype.iter().position(|r| tag(&r.name) == name).unwrap();
    let values = reader.pointcloud_raw(&cloud).unwrap();
    let data_type = cloud.prototype[field].data_type.clone();
    values.map(|v| v.unwrap()[field].to_f64(&data_type).unwrap()).collect()
}

fn to_16(v: f64, low: f64, high: f64) -> f64 {
    (((v - low) / (high - low)).clamp(0.0, 1.0) * 65_535.0).round()
}

#[test]
fn intensity_is_scaled_by_the_limits_or_what_stands_for_them() {
    let cloud = read("limits.e57");
    let ranges = [
        (-100.0, 200.0), // declared
        (0.0, 1.0),      // the field's own
        (0.0, 1.0),      // sampled
        (0.0, 255.0),    // sampled: 0 to 0 is no range
        (f64::NAN, 0.0), // sampled, what the values span
        (-66.0, 66.0),   // the integer's range
        (0.0, 255.0),    // sampled: 64 bits are no range
        (0.0, 255.0),    // a constant
        (-66.6, 66.6),   // the scaled integer's range
        (0.0, 2.0),      // declared as integers for floats
        (0.0, 4095.0),
    ];
    let intensity = cloud.values("intensity");
    for (scan, (low, high)) in ranges.into_iter().enumerate() {
        let raw = raw("limits.e57", scan, "Intensity");
        let span = raw.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let (low, high) = if low.is_nan() { span } else { (low, high) };
        for (i, v) in raw.iter().enumerate() {
            let seen = intensity[40 * scan + i];
            assert!((seen - to_16(*v, low, high)).abs() <= 1.0, "scan {scan}: {v} became {seen}");
        }
    }
    let sampled = "no limits are declared for its intensity; 0 to 255 are taken, by a sample of the values";
    assert!(cloud.warned(&format!("scans 4, 7, 8: {sampled}")), "{:?}", cloud.info.warnings);
    assert_eq!(cloud.info.warnings.len(), 4, "{:?}", cloud.info.warnings);
}

#[test]
fn colours_without_limits_share_one_range() {
    let cloud = read("limits.e57");
    let rgb = cloud.values("rgb");
    for (scan, high) in [(9, 1.0), (10, 255.0)] {
        for (element, name) in ["ColorRed", "ColorGreen", "ColorBlue"].into_iter().enumerate() {
            for (i, v) in raw("limits.e57", scan, name).into_iter().enumerate() {
                let seen = rgb[3 * (40 * scan + i) + element];
                assert!((seen - to_16(v, 0.0, high)).abs() <= 1.0, "scan {scan} {name}: {v} became {seen}");
            }
        }
    }
    assert!(rgb[..3 * 40 * 9].iter().all(|v| *v == 0.0), "scans without colour");
}

#[test]
fn invalid_colours_and_intensities_are_zero_and_valid_ones_exact() {
    let cloud = read("scans.e57");
    let (rgb, intensity) = (cloud.values("rgb"), cloud.values("intensity"));
    let bad = raw("scans.e57", 0, "IsColorInvalid");
    for (i, red) in raw("scans.e57", 0, "ColorRed").into_iter().enumerate() {
        assert_eq!(rgb[3 * i], if bad[i] == 0.0 { red * 257.0 } else { 0.0 });
    }
    let bad = raw("scans.e57", 0, "IsIntensityInvalid");
    for (i, v) in raw("scans.e57", 0, "Intensity").into_iter().enumerate() {
        assert_eq!(intensity[i], if bad[i] == 0.0 { to_16(v, 0.0, 4095.0) } else { 0.0 });
    }
    // 16-bit colour comes as it is
    assert_eq!(rgb[3 * 400..].iter().step_by(3).copied().collect::<Vec<_>>(), raw("scans.e57", 2, "ColorRed"));
}

#[test]
fn invalid_times_are_nan() {
    let cloud = read("scans.e57");
    let bad = raw("scans.e57", 1, "IsTimeStampInvalid");
    for (i, v) in raw("scans.e57", 1, "TimeStamp").into_iter().enumerate() {
        let seen = cloud.values("timestamp")[200 + i];
        assert!(if bad[i] == 0.0 { seen == v } else { seen.is_nan() });
    }
    assert!(cloud.values("timestamp")[..200].iter().all(|v| *v == 0.0), "a scan without times");
}

#[test]
fn normals_turn_with_their_scan_and_are_not_moved() {
    let cloud = read("normals.e57");
    let local = ["normalX", "normalY", "normalZ"].map(|n| raw("normals.e57", 0, n));
    let points = ["CartesianX", "CartesianY", "CartesianZ"].map(|n| raw("normals.e57", 0, n));
    let seen = ["NormalX", "NormalY", "NormalZ"].map(|n| cloud.values(n));
    for i in 0..100 {
        let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // the angle to the way from point 0 to point i stays, for the whole scan is turned
        let way: [f64; 3] = std::array::from_fn(|a| points[a][i] - points[a][0]);
        let world: [f64; 3] = std::array::from_fn(|a| cloud.xyz[a][i] - cloud.xyz[a][0]);
        let (before, after) = (dot(way, [0, 1, 2].map(|a| local[a][i])), dot(world, [0, 1, 2].map(|a| seen[a][i])));
        assert!((before - after).abs() < 1e-4, "{before} {after}");
    }
    assert!((0..100).any(|i| (seen[0][i] - local[0][i]).abs() > 0.1), "they did turn");
}

#[test]
fn colours_of_declared_depth_stay_as_they_are() {
    let cloud = read("dark.e57");
    let expected: Vec<f64> = [0.0, 1.0, 100.0, 255.0].into_iter().flat_map(|v| [v; 3]).collect();
    assert_eq!(cloud.values("rgb"), expected);
    assert!(cloud.info.rgb_is_16_bit);
}

#[test]
fn values_outside_of_their_limits_are_counted_and_not_those_that_are_invalid() {
    let scan = pointmill_format::scan::e57::open(files::fixture("e57").join("outside.e57")).unwrap();
    let (wanted, mut scratch) = (Wanted::all(scan.info()), Scratch::default());
    let mut counted: BTreeMap<String, Changes> = BTreeMap::new();
    let mut intensity: Vec<u16> = Vec::new();
    for piece in 0..scan.pieces().len() {
        scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
            for (column, changes) in batch.changes() {
                counted.entry(batch.attributes()[column].name.clone()).or_default().merge(changes);
            }
            intensity.extend(batch.column::<u16>("intensity").unwrap());
            ControlFlow::Continue(())
        })
        .unwrap();
    }
    assert_eq!(intensity, [32_768, 0, 65_535, 0, 0, 65_535, 0, 0, 0, 0]);
    // two are invalid, and a second scan of two points has neither intensity nor colour
    let expected =
        Changes { clamped: 2, not_finite: 2, missing: 4, extremes: Some([-0.25, 3.0]), ..Changes::default() };
    assert_eq!(counted["intensity"], expected);
    let expected = Changes { clamped: 3, missing: 2, extremes: Some([300.0; 2]), ..Changes::default() };
    assert_eq!(counted["rgb"], expected);
    assert_eq!(counted.len(), 2);
}
