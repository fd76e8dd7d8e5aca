//! Folders of frames: trajectories of each kind, and what is missing in them.

use std::fs;
use std::path::Path;

use pointmill_format::scan::depth::is_sequence;
use pointmill_format::{DepthOptions, ScanKind};

use crate::common::{cloud, copy_of, open, refused, tum_options, write_depth};

const DEPTHS: [u16; 4] = [1000, 2000, 1500, 3000];
const CAMERA: &str = r#"{"fx": 1, "fy": 1, "cx": 1, "cy": 0, "width": 2, "height": 2, "depth_scale": 1000}"#;

/// A pose that moves by `x`.
fn moved(x: f64) -> String {
    format!("1 0 0 {x}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
}

/// Frames of one name each in `folder`, without files that describe a camera.
fn frames(folder: &Path, names: [&str; 2]) {
    fs::create_dir_all(folder).unwrap();
    for name in names {
        write_depth(folder, name, [2, 2], &DEPTHS, "");
        fs::remove_file(folder.join(format!("{name}.json"))).unwrap();
    }
}

/// The first x of each frame.
fn starts(folder: &Path) -> Vec<f64> {
    assert!(is_sequence(folder));
    assert_eq!(ScanKind::of_file(folder).unwrap(), Some(ScanKind::Depth));
    let cloud = cloud(folder, DepthOptions::default());
    assert!(cloud.errors.is_empty(), "{:?}", cloud.errors);
    cloud.xyz[0].chunks(4).map(|frame| frame[0]).collect()
}

#[test]
fn poses_come_from_files_of_each_kind() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    fs::write(at("camera.json"), CAMERA).unwrap();
    // 7-Scenes
    frames(dir.path(), ["frame-0.depth", "frame-1.depth"]);
    assert!(!is_sequence(dir.path()), "without poses");
    fs::write(at("frame-0.pose.txt"), moved(10.0)).unwrap();
    fs::write(at("frame-1.pose.txt"), moved(20.0)).unwrap();
    assert_eq!(starts(dir.path()), [9.0, 19.0]);
    // ScanNet; names are numbers, and 10 comes after 9
    let scannet = at("scannet");
    frames(&scannet.join("depth"), ["9", "10"]);
    fs::create_dir(scannet.join("pose")).unwrap();
    fs::write(scannet.join("pose/9.txt"), moved(1.0)).unwrap();
    fs::write(scannet.join("pose/10.txt"), moved(2.0)).unwrap();
    fs::write(scannet.join("intrinsics.json"), CAMERA).unwrap();
    assert_eq!(starts(&scannet), [0.0, 1.0]);
    // Redwood
    let redwood = at("redwood");
    frames(&redwood, ["a", "b"]);
    fs::write(redwood.join("camera.json"), CAMERA).unwrap();
    fs::write(redwood.join("trajectory.log"), format!("0 0 1\n{}1 1 2\n{}", moved(5.0), moved(7.0))).unwrap();
    assert_eq!(starts(&redwood), [4.0, 6.0]);
    fs::write(redwood.join("trajectory.log"), format!("0 0 1\n{}", moved(5.0))).unwrap();
    assert!(refused(&redwood, DepthOptions::default()).contains("there are 1 poses, and 2 depth maps in the folder"));
    // frames named by time, a list of times beside
    let timed = at("timed");
    frames(&timed.join("depth"), ["1.00", "1.50"]);
    fs::write(timed.join("camera.json"), CAMERA).unwrap();
    fs::write(timed.join("x.freiburg"), "1.51 3 0 0 0 0 0 1\n0.99 2 0 0 0 0 0 1\n").unwrap();
    assert_eq!(starts(&timed), [1.0, 2.0]);
}

#[test]
fn what_is_wrong_with_a_pose_is_reported_at_its_line() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    fs::write(at("camera.json"), CAMERA).unwrap();
    frames(dir.path(), ["a", "b"]);
    // the second matrix starts at byte 44: 0 0 1, then four rows
    let first = format!("0 0 1\n{}", moved(5.0));
    let second = first.len() + "1 1 2\n".len();
    let rows = moved(7.0);
    let row = |n: usize| second + rows.match_indices('\n').nth(n - 1).map_or(0, |(end, _)| end + 1);
    let with = |wrong: &str, n: usize| {
        let lines: Vec<&str> = rows.lines().enumerate().map(|(i, line)| if i == n { wrong } else { line }).collect();
        format!("{first}1 1 2\n{}\n", lines.join("\n"))
    };
    for (text, byte, what) in [
        (with("0 NaN 0 0", 1), row(1), "no pose: a number is not finite"),
        (with("0 0 inf 0", 2), row(2), "no pose: a number is not finite"),
        (with("0 0 0 2", 3), row(3), "no pose: the last row"),
        (with("0 1 0 1e300", 1), row(1), "no pose: row 2 of the matrix places no point where coordinates can be"),
        (with("0 1 0", 1), row(1), "expected 4 numbers, a row of a matrix"),
        (with("0 1 0 x", 1), row(1), "expected 4 numbers, a row of a matrix"),
        (with("0 0 1 0", 1), second, "no pose: "),
        (format!("{first}1 1\n{rows}"), first.len(), "expected 3 numbers, those above a matrix"),
        (format!("{first}1 1 2\n1 0 0 7\n"), first.len(), "expected 3 numbers and the 4 rows of a matrix"),
    ] {
        fs::write(at("trajectory.log"), text).unwrap();
        let line = refused(dir.path(), DepthOptions::default());
        assert!(line.contains(&format!("trajectory.log: {what}")), "{line}");
        assert!(line.contains(&format!("(byte {byte})")), "{line}");
    }
    fs::remove_file(at("trajectory.log")).unwrap();
    fs::write(at("a.pose.txt"), moved(1.0)).unwrap();
    for (text, byte, what) in [
        ("1 0 0 7\n0 1 0 0\n0 0 -inf 0\n0 0 0 1\n", 16, "no pose: a number is not finite"),
        ("1 0 0 7\n0 1 x 0\n0 0 1 0\n0 0 0 1\n", 8, "not the 16 numbers of a pose"),
        ("1 0 0 7\n0 1 0 0\n", 0, "not the 16 numbers of a pose"),
    ] {
        fs::write(at("b.pose.txt"), text).unwrap();
        let [error] = &cloud(dir.path(), DepthOptions::default()).errors[..] else { panic!("{text}") };
        assert!(error.to_string().contains(&format!("b.pose.txt: {what} (byte {byte})")), "{error}");
    }
}

/// The first red value of each frame; none if there are no colours.
fn reds(folder: &Path) -> Option<Vec<u16>> {
    let cloud = cloud(folder, DepthOptions::default());
    assert!(cloud.errors.is_empty(), "{:?}", cloud.errors);
    cloud.info.attribute("rgb")?;
    Some(cloud.column("rgb").values::<u16>().unwrap().chunks(12).map(|frame| frame[0] / 257).collect())
}

#[test]
fn a_frame_has_the_colours_that_are_listed_near_in_time_else_those_of_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let picture = |name: &str, red: u8| {
        crate::common::write_png(&at(name), [2, 2], png::ColorType::Rgb, png::BitDepth::Eight, &[red; 12]);
    };
    fs::write(at("camera.json"), CAMERA).unwrap();
    frames(&at("depth"), ["1.00", "2.00"]);
    fs::write(at("groundtruth.txt"), "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n").unwrap();
    fs::create_dir(at("rgb")).unwrap();
    picture("rgb/2.00.png", 20);
    picture("listed.png", 50);
    assert_eq!(reds(dir.path()), Some(vec![0, 20]), "by name");
    fs::write(at("rgb.txt"), "1.01 listed.png\n").unwrap();
    assert_eq!(reds(dir.path()), Some(vec![50, 20]), "one from the list, one by name");
    fs::write(at("rgb.txt"), "2.01 listed.png\n").unwrap();
    assert_eq!(reds(dir.path()), Some(vec![0, 50]), "the list goes before the name");
    fs::remove_file(at("rgb/2.00.png")).unwrap();
    fs::write(at("rgb.txt"), "2.05 listed.png\n").unwrap();
    assert_eq!(reds(dir.path()), None);
    let warned = cloud(dir.path(), DepthOptions::default());
    assert!(
        warned.warned("none of the 2 depth maps has a picture near in time in the list of colours"),
        "{:?}",
        warned.info.warnings
    );
    // names that are no times, as 7-Scenes has
    let named = tempfile::tempdir().unwrap();
    fs::write(named.path().join("camera.json"), CAMERA).unwrap();
    frames(named.path(), ["frame-0.depth", "frame-1.depth"]);
    for name in ["frame-0", "frame-1"] {
        fs::write(named.path().join(format!("{name}.pose.txt")), moved(0.0)).unwrap();
        let path = named.path().join(format!("{name}.color.png"));
        crate::common::write_png(&path, [2, 2], png::ColorType::Rgb, png::BitDepth::Eight, &[30; 12]);
    }
    fs::write(named.path().join("rgb.txt"), "0 frame-1.color.png\n").unwrap();
    assert_eq!(reds(named.path()), Some(vec![30, 30]));
}

#[test]
fn a_frame_whose_picture_was_cut_within_its_header_is_not_passed_over() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    fs::write(at("camera.json"), CAMERA).unwrap();
    frames(dir.path(), ["a", "b"]);
    fs::create_dir(at("pose")).unwrap();
    for name in ["a", "b"] {
        fs::write(at(&format!("pose/{name}.txt")), moved(1.0)).unwrap();
    }
    let whole = fs::read(at("b.png")).unwrap();
    for cut in [0, 4, 8, 20, 26, 33] {
        fs::write(at("b.png"), &whole[..cut]).unwrap();
        let cloud = cloud(dir.path(), DepthOptions::default());
        let [error] = &cloud.errors[..] else { panic!("cut to {cut}: {:?}", cloud.errors) };
        assert!(error.to_string().contains("b.png: the picture ends before its last pixel"), "cut to {cut}: {error}");
    }
}

#[test]
fn a_frame_that_cannot_be_read_is_an_error_of_its_own_piece() {
    type Change = (&'static str, fn(&Path), &'static str);
    let middle = "depth/1305031102.194330.png";
    let changes: [Change; 5] = [
        ("missing", |dir| fs::remove_file(dir.join("depth/1305031102.194330.png")).unwrap(), "no such picture"),
        (
            "cut",
            |dir| {
                let path = dir.join("depth/1305031102.194330.png");
                let bytes = fs::read(&path).unwrap();
                fs::write(path, &bytes[..200]).unwrap();
            },
            "the picture ends before its last pixel",
        ),
        (
            "colour missing",
            |dir| fs::remove_file(dir.join("rgb/1305031102.209430.png")).unwrap(),
            "1305031102.209430.png: no such picture",
        ),
        (
            "no pose",
            |dir| {
                let path = dir.join("groundtruth.txt");
                let text = fs::read_to_string(&path).unwrap().replace("1305031102.1903", "1305031102.1603");
                fs::write(path, text).unwrap();
            },
            "groundtruth.txt: no pose for 1305031102.194330: the nearest is 0.028 s away, more than 0.02 s (byte 242)",
        ),
        (
            "another size",
            |dir| {
                let path = dir.join("depth/1305031102.194330.png");
                crate::common::write_png(&path, [4, 4], png::ColorType::Grayscale, png::BitDepth::Sixteen, &[1; 32]);
            },
            "the picture has 4 × 4 pixels, the intrinsics are those of 32 × 24",
        ),
    ];
    let whole = cloud(&pointmill_testkit::files::fixture("depth/tum"), tum_options());
    for (name, change, what) in changes {
        let dir = copy_of("tum");
        assert!(dir.path().join(middle).is_file());
        change(dir.path());
        let cloud = cloud(dir.path(), tum_options());
        let [error] = &cloud.errors[..] else { panic!("{name}: {:?}", cloud.errors) };
        assert!(error.to_string().contains(what), "{name}: {error}");
        assert!(cloud.warned("1 of 3 depth maps cannot be read, the first: "), "{name}: {:?}", cloud.info.warnings);
        let sources = cloud.column("point source id").values::<u16>().unwrap();
        let others = whole.column("point source id").values::<u16>().unwrap().iter().filter(|source| **source != 1);
        assert!(sources.iter().eq(others), "{name}: the other frames are read");
    }
}

#[test]
fn what_is_wrong_with_all_frames_is_said_when_the_folder_is_opened() {
    let dir = copy_of("tum");
    assert!(refused(dir.path(), DepthOptions::default()).contains("nothing says the intrinsics of the camera"));
    let mut options = tum_options();
    options.intrinsics = options.intrinsics.map(|mut camera| {
        camera.size = Some([640, 480]);
        camera
    });
    assert!(refused(dir.path(), options).contains("the intrinsics are those of 640 × 480"));
    let mut posed = tum_options();
    posed.pose = Some(pointmill_format::Affine::IDENTITY);
    assert!(refused(dir.path(), posed).contains("has its own poses and colours"));
    fs::write(dir.path().join("groundtruth.txt"), "1 2 3\n").unwrap();
    assert!(
        refused(dir.path(), tum_options()).contains("expected the 8 numbers timestamp tx ty tz qx qy qz qw (byte 0)")
    );
    fs::write(dir.path().join("groundtruth.txt"), "# none\n").unwrap();
    assert!(refused(dir.path(), tum_options()).contains("no pose for 1305031102.160407: there are none in it"));
}

#[test]
fn a_frame_of_a_hostile_size_promises_no_more_than_its_camera() {
    let dir = copy_of("tum");
    let path = dir.path().join("depth/1305031102.194330.png");
    let mut bytes = fs::read(&path).unwrap();
    bytes[16..24].fill(0xff);
    fs::write(&path, bytes).unwrap();
    let mut options = tum_options();
    for (size, points) in [(Some([32, 24]), 768), (None, 1)] {
        options.intrinsics = options.intrinsics.map(|camera| pointmill_format::Intrinsics { size, ..camera });
        let scan = open(dir.path(), options.clone()).unwrap();
        assert_eq!(scan.info().parts[1].points, points);
        assert!(scan.decode_bytes(&pointmill_format::Wanted::all(scan.info())) < 4 << 20);
    }
    options.intrinsics =
        options.intrinsics.map(|camera| pointmill_format::Intrinsics { size: Some([u32::MAX; 2]), ..camera });
    assert!(refused(dir.path(), options).contains("the intrinsics are those of 4294967295 × 4294967295"));
    fs::remove_file(&path).unwrap();
    let scan = open(dir.path(), tum_options()).unwrap();
    assert_eq!(scan.info().parts[1].points, 32 * 24, "as many as its camera has pixels");
}

#[test]
fn options_that_make_no_sense_are_refused_by_the_library_too() {
    let path = pointmill_testkit::files::fixture("depth/single.png");
    let mut options = DepthOptions::default();
    options.filters = vec![pointmill_format::DepthFilter::Median { window: 4 }];
    assert!(refused(&path, options.clone()).contains("no odd window of 3 to 31 pixels"));
    options.filters.clear();
    options.units_per_metre = Some(0.0);
    assert!(refused(&path, options).contains("it counts units in a metre, 10 to 1000000"));
}

#[test]
fn frames_without_depth_or_colour_are_counted() {
    let dir = copy_of("tum");
    let path = dir.path().join("depth/1305031102.194330.png");
    crate::common::write_png(&path, [32, 24], png::ColorType::Grayscale, png::BitDepth::Sixteen, &[0; 32 * 24 * 2]);
    let list = dir.path().join("rgb.txt");
    let text = fs::read_to_string(&list).unwrap();
    let kept: Vec<&str> = text.lines().filter(|line| !line.contains("209430") && !line.contains("241838")).collect();
    fs::write(list, kept.join("\n")).unwrap();
    let scan = open(dir.path(), tum_options()).unwrap();
    assert_eq!(scan.pieces().len(), 2);
    let cloud = cloud(dir.path(), tum_options());
    assert!(cloud.warned("1 of 3 depth maps have no depth"), "{:?}", cloud.info.warnings);
    assert!(cloud.warned("1 of 3 depth maps have no colour picture; their colours are 0"));
    let last = cloud.column("rgb").values::<u16>().unwrap().last();
    assert_eq!(last, Some(&0));
}
