//! Points against those that `fixtures/generators/depth.py` works out.

use pointmill_format::{DepthOptions, OpenOptions, open_scan};
use pointmill_testkit::files::fixture;
use pointmill_testkit::golden;
use pointmill_testkit::reader::{Cloud, columns_are_independent, doubles, keeps_promises};

use crate::common::{cloud, open, tum_options};

fn options(file: &str) -> DepthOptions {
    if file == "tum" { tum_options() } else { DepthOptions::default() }
}

fn summary(values: &[f64]) -> [f64; 6] {
    let (least, greatest) = values.iter().fold((f64::MAX, f64::MIN), |(l, g), v| (l.min(*v), g.max(*v)));
    [values.len() as f64, values.iter().sum(), least, greatest, values[0], values[values.len() - 1]]
}

#[test]
fn every_fixture_gives_the_points_that_were_drawn() {
    let expected = golden::expected::<f64, 6>("depth");
    assert_eq!(expected.keys().collect::<Vec<_>>(), ["single.png", "tum"]);
    for (file, expected) in &expected {
        let cloud = cloud(&fixture("depth").join(file), options(file));
        assert!(cloud.errors.is_empty() && cloud.info.warnings.is_empty(), "{file}: {:?}", cloud.info.warnings);
        let found = golden::columns(&cloud, |v| v, doubles);
        assert!(found.keys().eq(expected.keys()), "{file}: {:?}", found.keys());
        for (column, expected) in expected {
            for (k, (found, expected)) in summary(&found[column]).into_iter().zip(expected).enumerate() {
                // poses are matrices here, and products of quaternions there
                let tolerance = if k == 1 { 1e-9 } else { 1e-13 } * expected.abs().max(1.0);
                assert!((found - expected).abs() <= tolerance, "{file} {column} [{k}]: {found} {expected}");
            }
        }
    }
}

#[test]
fn readers_keep_their_promises_with_filters_and_normals_too() {
    for file in ["single.png", "tum"] {
        let mut options = options(file);
        options.normals = true;
        options.filters = vec![pointmill_format::DepthFilter::Median { window: 5 }];
        let scan = open(&fixture("depth").join(file), options).unwrap();
        keeps_promises(scan.as_ref(), &pointmill_format::Wanted::all(scan.info()), u64::MAX);
        columns_are_independent(scan.as_ref());
    }
}

#[test]
fn a_sequence_has_a_part_for_each_frame_with_its_pose() {
    let scan = open(&fixture("depth/tum"), tum_options()).unwrap();
    let info = scan.info();
    let starts: Vec<_> = info.parts.iter().map(|part| (part.number, part.translation)).collect();
    assert_eq!(starts, [(1, [1.5, -0.25, 0.0]), (2, [2.5, -0.25, 0.75]), (3, [3.5, -0.25, 1.5])]);
    assert_eq!(info.parts[1].name, "1305031102.194330");
    assert_eq!(scan.pieces().len(), 3);
    assert!(scan.pieces().iter().zip(&info.parts).all(|(piece, part)| piece.points == part.points));
    assert!(
        info.format.contains("3 depth maps with a trajectory, 32 × 24 pixels, fx 26.25 fy 26 cx 15.75"),
        "{}",
        info.format
    );
}

#[test]
fn chosen_frames_keep_their_numbers() {
    let options = OpenOptions::default().depth(tum_options()).scans(["3", "1305031102.160407"]);
    let scan = open_scan(fixture("depth/tum"), &options).unwrap();
    let numbers: Vec<_> = scan.info().parts.iter().map(|part| part.number).collect();
    assert_eq!(numbers, [1, 3]);
    let wanted = pointmill_format::Wanted::all(scan.info());
    let cloud: Cloud = pointmill_testkit::reader::read(scan.as_ref(), &wanted);
    let sources = cloud.column("point source id").values::<u16>().unwrap();
    assert!(sources.contains(&0) && sources.contains(&2) && !sources.contains(&1));
    assert_eq!(cloud.len() as u64, scan.info().points_declared);
}

#[test]
fn a_range_keeps_what_is_in_it_and_a_filter_drops_nothing() {
    let path = fixture("depth/single.png");
    let all = cloud(&path, DepthOptions::default()).len();
    let mut options = DepthOptions::default();
    options.range = Some(1.1..=1.5);
    let near = cloud(&path, options.clone()).len();
    assert!(near > 50 && near < 100, "{near}");
    options.filters = vec![pointmill_format::DepthFilter::Bilateral { window: 5, range_sigma: 0.05 }];
    assert_eq!(cloud(&path, options.clone()).len(), near);
    options.range = None;
    assert_eq!(cloud(&path, options).len(), all);
}
